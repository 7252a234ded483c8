//! Controllers' parts: sampled plans, the barrier filter, and the tier of a state; a benchmark.

mod cbf;
mod drive;
pub mod mppi;
pub mod tier;

pub use cbf::{BarrierFilter, BarrierForm, FilterStatus, Filtered, Widening};
pub use drive::DriveBenchmark;
