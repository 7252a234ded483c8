//! What a benchmark stores.

use serde::{Deserialize, Serialize};

use super::limits::{AdapterLimits, HostLimits};
use super::measure::{Protocol, Timing};

/// Version of the layout of [`BenchRecord`].
pub const BENCH_SCHEMA: u32 = 1;

/// Limits and workloads of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BenchRecord {
    /// [`BENCH_SCHEMA`].
    pub schema: u32,
    /// Version of this crate.
    pub version: String,
    /// Seed of networks, starts and noise.
    pub seed: u64,
    /// The machine in words.
    pub machine: MachineRecord,
    /// How long each workload was repeated.
    pub protocol: Protocol,
    /// Limits of the processor and its memory: the better of before and after the workloads.
    pub limits: HostLimits,
    /// The backends, in the order in which they ran.
    pub backends: Vec<BackendRecord>,
    /// Each workload on each backend.
    pub workloads: Vec<WorkloadRecord>,
    /// Workloads that were left out, and why.
    pub left_out: Vec<LeftOutRecord>,
    /// Batches of growing size.
    pub scaling: Vec<ScalingRecord>,
    /// What was still to come when this was written, each with its backend: something where the
    /// benchmark was interrupted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub to_come: Vec<String>,
}

/// The machine in words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineRecord {
    /// Model of the processor.
    pub cpu: String,
    /// Threads that it runs at once.
    pub cores: usize,
    /// Instruction set that the rollouts ran with.
    pub instructions: String,
    /// Threads of the CPU backend.
    pub threads: usize,
    /// Operating system and architecture.
    pub platform: String,
}

/// A backend that ran.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackendRecord {
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Processor or adapter, in words.
    pub device: String,
    /// What was measured of the adapter; none for the CPU.
    pub adapter: Option<AdapterLimits>,
}

/// A workload on a backend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkloadRecord {
    /// Its name.
    pub name: String,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// What is counted.
    pub unit: String,
    /// Units of a call.
    pub units: u64,
    /// Steps of a unit, a mean where they end early.
    #[serde(with = "crate::files::number")]
    pub steps_per_unit: f64,
    /// Floating-point operations of a unit.
    #[serde(with = "crate::files::number")]
    pub flops_per_unit: f64,
    /// Time of a call.
    pub timing: Timing,
    /// Units per second, at the median.
    #[serde(with = "crate::files::number")]
    pub units_per_second: f64,
    /// Steps per second, at the median.
    #[serde(with = "crate::files::number")]
    pub steps_per_second: f64,
    /// Floating-point operations per second, at the median.
    #[serde(with = "crate::files::number")]
    pub flops_per_second: f64,
    /// Rate of the best call over the limit of its backend, both undisturbed: matrix products of the
    /// CPU, multiply-adds in the adapter's registers.
    #[serde(with = "crate::files::number")]
    pub share: f64,
    /// Time on the adapter by kernel, the median of further calls; empty on the CPU, and where the
    /// adapter has no timestamps.
    pub kernels: Vec<KernelRecord>,
}

/// Time of one kernel on an adapter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KernelRecord {
    /// Entry point.
    pub kernel: String,
    /// How often a call dispatches it.
    pub dispatches: u64,
    /// Time of all of these, s.
    #[serde(with = "crate::files::number")]
    pub seconds: f64,
}

/// A workload that was left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOutRecord {
    /// Its name.
    pub name: String,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Why.
    pub reason: String,
}

/// A batch of one size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScalingRecord {
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Rollouts N.
    pub rollouts: u64,
    /// Time of a call.
    pub timing: Timing,
    /// Rollouts per second, at the median.
    #[serde(with = "crate::files::number")]
    pub rollouts_per_second: f64,
    /// Most memory that the process held during these calls, bytes; none where the system does
    /// not tell.
    pub peak_bytes: Option<u64>,
}
