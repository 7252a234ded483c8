//! Results on their way to the host.

use super::buffer::{Buffer, Pool, Use};
use super::device::Device;
use super::flight::Flight;
use crate::error::Result;

/// A buffer that the submission that makes results also copies them to, and that is read once it is
/// done: no submission and no wait of its own.
pub(super) struct Readback(Buffer);

impl Readback {
    /// Room for `bytes`.
    pub(super) fn new(device: &Device, pool: &Pool, bytes: u64) -> Self {
        Self(pool.take(device, Use::Readback, bytes))
    }

    /// Copies the first `bytes` of `source` to `offset` when `encoder` runs.
    pub(super) fn copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        source: &Buffer,
        offset: u64,
        bytes: u64,
    ) {
        source.copy(encoder, &self.0, offset, bytes);
    }

    /// What `take` makes of the first `bytes`, once the last submission of `flight` is done.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn read<T>(
        &mut self,
        flight: &Flight<'_>,
        bytes: u64,
        take: impl FnOnce(&[u8]) -> T,
    ) -> Result<T> {
        self.0.mapped(&flight.device, bytes, || flight.settle(), take)
    }
}
