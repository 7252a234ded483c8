//! Benchmarks: the limits of the machine, and how near the workloads come to them.

pub mod data;
pub mod export;
pub mod flops;
pub mod limits;
pub mod measure;
pub mod record;
pub mod run;
pub mod scaling;
pub mod workload;
