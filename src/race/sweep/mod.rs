//! Sweeps: a grid of settings, raced or certified point by point.

mod certificate;
mod notes;
mod race;
pub mod record;
mod store;
mod table;

pub use certificate::{certificate_point, certificate_sha256, certificate_sweep};
pub use store::{Computed, Store};
pub use table::table;
