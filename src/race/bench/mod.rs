//! What benchmarks run: networks and starts of the race, and its plans.

pub mod data;
pub(crate) mod export;
mod scaling;
pub(crate) mod workload;
