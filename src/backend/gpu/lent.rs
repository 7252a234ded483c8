//! An adapter opened for a library with kernels of its own.

use super::listing::{Adapter, found_again, instance};
use crate::error::{Error, Result};

/// What such a library takes over, failures of the device included.
pub(crate) struct Lent {
    pub(crate) instance: wgpu::Instance,
    pub(crate) adapter: wgpu::Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
}

impl Lent {
    /// Opens `adapter` with all that it can do: the library asks the adapter what that is.
    ///
    /// # Errors
    /// [`Error::Device`] if it is gone or does not open.
    pub(super) fn open(adapter: &Adapter) -> Result<Self> {
        let instance = instance();
        let handle = found_again(&instance, adapter)?;
        // Experimental features need leave, and buffers that are mapped while kernels see them
        // cost speed on cards with memory of their own.
        let left_out =
            wgpu::Features::all_experimental_mask().union(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("reachcast, lent"),
            required_features: handle.features() - left_out,
            required_limits: handle.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(handle.request_device(&descriptor))
            .map_err(|e| Error::Device(format!("{adapter} does not open: {e}")))?;
        Ok(Self { instance, adapter: handle, device, queue })
    }
}
