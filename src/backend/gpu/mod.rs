//! The GPU backend: recorded physics spliced into the WGSL kernels, run through wgpu.

mod adapter;
mod attempt;
mod batch;
mod buffer;
mod cache;
mod call;
mod chain;
mod compiled;
pub mod compose;
mod deviation;
mod device;
mod fault;
mod flight;
mod inputs;
mod job;
mod kernel;
#[cfg(feature = "train-gpu")]
mod lent;
mod limits;
mod mppi;
mod mppi_network;
mod mppi_plan;
mod network;
mod opened;
mod params;
mod plan;
mod prepared;
mod program;
mod reach_avoid;
mod readback;
mod recover;
mod source;
mod state;
mod timing;
mod traffic;
mod typed;
mod workspace;

pub use adapter::Gpu;
pub(crate) use cache::folder as cache_folder;
#[cfg(feature = "train")]
pub(crate) use device::contained;
pub use device::{Adapter, AdapterKind, Choice, adapters};
pub use fault::Injection;
pub use limits::DeviceLimits;
pub use params::Params;
pub use plan::NetworkKernels;
pub(super) use prepared::Prepared;
pub use timing::KernelTime;
pub use traffic::Traffic;
