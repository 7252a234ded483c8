//! Controllers' parts: sampled plans, the barrier filter, and the tier of a state; a benchmark.

mod drive;
pub mod mppi;
pub mod tier;

pub use drive::DriveBenchmark;
