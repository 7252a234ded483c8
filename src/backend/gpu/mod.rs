//! The GPU backend: recorded physics spliced into the WGSL kernels, run through wgpu.

mod adapter;
mod attempt;
mod batch;
mod buffer;
mod cache;
mod call;
mod chain;
mod chain_load;
mod chunking;
mod compiled;
pub mod compose;
mod counting;
mod deviation;
mod device;
mod fault;
mod flight;
mod fusing;
mod inputs;
mod job;
mod kernel;
#[cfg(feature = "train-gpu")]
mod lent;
mod limits;
mod listing;
mod lists;
mod mppi;
mod mppi_chunking;
mod mppi_compiled;
mod mppi_program;
mod mppi_source;
mod mppi_workspace;
mod network;
mod opened;
mod params;
mod prepared;
mod prepared_plans;
mod program;
mod reach_avoid;
mod readback;
mod recent;
mod recover;
mod remembered;
mod source;
mod state;
mod timing;
mod traffic;
mod upload;
mod workspace;

pub use adapter::Gpu;
pub use compose::Form;
#[cfg(feature = "train")]
pub(crate) use device::contained;
pub use fault::Injection;
pub use fusing::NetworkKernels;
pub use limits::DeviceLimits;
pub use listing::{Adapter, AdapterKind, Choice, Listing, PciAddress, adapters, listing};
pub use params::Params;
pub(super) use prepared::Prepared;
pub(super) use prepared_plans::PreparedPlanning;
pub use remembered::has_hardware;
pub use timing::KernelTime;
pub use traffic::Traffic;

use crate::error::Result;

/// The hardware adapter of this machine, if it has one.
///
/// # Errors
/// [`crate::Error::Device`] if it does not open.
pub(super) fn hardware() -> Result<Option<Gpu>> {
    has_hardware().then(|| Gpu::open(&Choice::Hardware)).transpose()
}

/// Any adapter, hardware before software.
///
/// # Errors
/// [`crate::Error::Device`] if there is none or it does not open.
pub(super) fn any() -> Result<Gpu> {
    Gpu::open(&Choice::Any)
}
