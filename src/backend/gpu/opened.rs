//! An opened adapter: its device, and what is kept on it between calls.

use std::sync::Arc;

use super::buffer::Pool;
use super::device::Device;
use super::kernel::{Edit, Pipelines};
use super::plan::NetworkKernels;
use super::timing::Clock;
use crate::error::Result;

/// How the kernels of an adapter are built and timed, however often it is opened.
#[derive(Clone, Default)]
pub(super) struct Setup {
    pub(super) edit: Option<Edit>,
    pub(super) networks: NetworkKernels,
    pub(super) clock: Arc<Clock>,
}

/// A device with its pipelines and buffers.
pub(super) struct Opened {
    pub(super) device: Device,
    pub(super) pipelines: Arc<Pipelines>,
    pub(super) pool: Pool,
    pub(super) setup: Setup,
}

impl Opened {
    /// Nothing compiled yet, no buffer made.
    pub(super) fn new(device: Device, setup: Setup) -> Self {
        let pipelines = match &setup.edit {
            Some(edit) => Pipelines::edited(Arc::clone(edit)),
            None => Pipelines::new(&device),
        };
        Self { device, pipelines: Arc::new(pipelines), pool: Pool::default(), setup }
    }

    /// The same device, changed by `change`, which leaves kernels and buffers as they are.
    pub(super) fn changed(&self, change: impl FnOnce(Device) -> Device) -> Self {
        Self {
            device: change(self.device.clone()),
            pipelines: Arc::clone(&self.pipelines),
            pool: self.pool.clone(),
            setup: self.setup.clone(),
        }
    }

    /// The same adapter with a new device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if it is gone or does not open.
    pub(super) fn again(&self) -> Result<Self> {
        Ok(Self::new(self.device.reopened()?, self.setup.clone()))
    }
}
