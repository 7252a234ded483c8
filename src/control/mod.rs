//! Controllers' parts: sampled plans, the barrier filter, and the tier of a state; a benchmark.

#[cfg(feature = "cli")]
mod cbf;
mod drive;
pub mod mppi;
pub mod tier;

#[cfg(feature = "cli")]
pub use cbf::{BarrierFilter, BarrierForm, FilterStatus, Filtered, Widening};
pub use drive::DriveBenchmark;
