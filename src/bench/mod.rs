//! Benchmarks: the limits of the machine, and how near the workloads come to them.

pub mod flops;
pub mod limits;
pub mod measure;
pub mod record;
pub mod run;
pub mod scaling;
pub mod workload;

use crate::rollout::Purpose;

/// What weights and starts of benchmarks are drawn for.
pub const PURPOSE: Purpose = Purpose::numbered(15);
