//! Results on their way to the host.

use super::buffer::{Buffer, Mapping, Pool, Use};
use super::device::Device;
use super::flight::{Flight, Ticket};
use crate::error::Result;

/// A buffer that the submission that makes results also copies them to: no submission and no wait of
/// its own.
pub(super) struct Readback {
    buffer: Buffer,
    coming: Option<(Ticket, Mapping)>,
}

impl Readback {
    /// Room for `bytes`.
    pub(super) fn new(device: &Device, pool: &Pool, bytes: u64) -> Self {
        Self { buffer: pool.take(device, Use::Readback, bytes), coming: None }
    }

    /// Copies the first `bytes` of `source` to `offset` when `encoder` runs.
    pub(super) fn copy(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        source: &Buffer,
        offset: u64,
        bytes: u64,
    ) {
        source.copy(encoder, &self.buffer, offset, bytes);
    }

    /// Asks for the first `bytes`, which the submission of `ticket` copies.
    fn ask(&mut self, ticket: Ticket, bytes: u64) {
        self.coming = Some((ticket, self.buffer.map(bytes)));
    }

    /// What `take` makes of what was asked for, once its submission is done.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    fn read<T>(&mut self, flight: &Flight<'_>, take: impl FnOnce(&[u8]) -> T) -> Result<T> {
        let Some((ticket, mapping)) = self.coming.take() else {
            // Nothing was asked for: nothing is read.
            return Ok(take(&[]));
        };
        flight.wait(ticket)?;
        self.buffer.mapped(&flight.device, mapping, take)
    }
}

/// Two buffers of results in turns: while the host reads one, the next submission fills the other. Each
/// result that is under way carries what the host knows of it.
pub(super) struct Turns<T> {
    buffers: [Readback; 2],
    /// The one that the next submission fills.
    free: usize,
    coming: Option<T>,
}

impl<T> Turns<T> {
    /// Room for two results of `bytes`.
    pub(super) fn new(device: &Device, pool: &Pool, bytes: u64) -> Self {
        let buffers = [(); 2].map(|()| Readback::new(device, pool, bytes));
        Self { buffers, free: 0, coming: None }
    }

    /// The buffer that the next submission copies its results to.
    pub(super) fn free(&self) -> &Readback {
        &self.buffers[self.free]
    }

    /// The submission of `ticket` copies `bytes` to the free buffer: `known` goes with them. The one
    /// before, if one is under way, is read by `take`.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn send<R>(
        &mut self,
        flight: &Flight<'_>,
        (ticket, bytes): (Ticket, u64),
        known: T,
        take: impl FnOnce(T, &[u8]) -> R,
    ) -> Result<Option<R>> {
        self.buffers[self.free].ask(ticket, bytes);
        let before = self.coming.replace(known);
        self.free = 1 - self.free;
        before.map(|known| self.buffers[self.free].read(flight, |all| take(known, all))).transpose()
    }

    /// What `take` makes of the one that is under way, if one is.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work.
    pub(super) fn last<R>(
        &mut self,
        flight: &Flight<'_>,
        take: impl FnOnce(T, &[u8]) -> R,
    ) -> Result<Option<R>> {
        let sent = &mut self.buffers[1 - self.free];
        self.coming.take().map(|known| sent.read(flight, |all| take(known, all))).transpose()
    }
}
