//! The reports: one self-contained HTML page made from the record of a certificate, a race study, a
//! sweep, a run of training, a search for failures or plans in closed loop.
//!
//! Figures are written as SVG here rather than with a plot library: `plotters` writes each colour
//! and text size as a fixed value and its legend into the plot, so that the page could follow
//! neither the reader's light or dark setting nor a phone's width.

mod contour;
mod deterministic;
mod enclosed;
mod falsify;
mod falsify_figures;
pub(crate) mod figure;
mod figures;
mod growth;
mod html;
pub(crate) mod palette;
mod places;
mod plan;
mod plan_figures;
mod plan_paths;
mod plan_runs;
pub(crate) mod plot;
pub(crate) mod scale;
mod sequential;
mod sets;
pub(crate) mod sheet;
pub(crate) mod shell;
mod slice;
pub(crate) mod sortable;
pub(crate) mod span;
pub(crate) mod table;
pub(crate) mod text;
pub(crate) mod ticks;
mod tracks;
mod train;
mod words;

pub use falsify::{Search, falsify_html};
pub use html::html;
pub use plan::plan_html;
pub use plan_runs::PlanPage;
pub use train::train_html;
