//! The report: one self-contained HTML page made from a stored certificate.
//!
//! Figures are written as SVG here rather than with a plot library. `plotters`, the one that was
//! tried, fixes every colour and text size in its output, so that the page could follow neither
//! the reader's light or dark setting nor a phone's width, and its legends sit inside the plot.

mod contour;
mod figure;
mod figures;
mod html;
mod palette;
mod plot;
mod slice;
mod table;
mod text;
mod words;

pub use html::html;
