//! What benchmarks run: networks and starts of the race, and its plans.

pub mod data;
pub(crate) mod export;
pub(crate) mod workload;
