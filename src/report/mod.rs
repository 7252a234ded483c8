//! The reports: one self-contained HTML page made from the record of a certificate, a race study, a
//! sweep or a run of training.
//!
//! Figures are written as SVG here rather than with a plot library: `plotters` writes each colour
//! and text size as a fixed value and its legend into the plot, so that the page could follow
//! neither the reader's light or dark setting nor a phone's width.

mod contour;
mod figure;
mod figures;
mod html;
mod losses;
mod palette;
mod plot;
mod race;
mod scale;
mod sheet;
mod shell;
mod slice;
mod sortable;
mod span;
mod sweep;
mod table;
mod text;
mod train;
mod verdicts;
mod words;

pub use html::html;
pub use race::race_html;
pub use sweep::sweep_html;
pub use train::train_html;
