//! A call whose kernels are given as text: buffers, bound kernels, submissions.

use super::batch::Batch;
use super::buffer::{Buffer, Use};
use super::compose::{Access, Kernel, Slot};
use super::device::Device;
use super::flight::Flight;
use super::kernel::{Bound, Composed, Pipelines};
use super::opened::Opened;
use super::params::Params;
use super::traffic::Count;
use crate::error::Result;

/// One call on the device.
pub(super) struct Call<'a> {
    flight: Flight<'a>,
    pipelines: &'a Pipelines,
    uniform: Buffer,
}

impl<'a> Call<'a> {
    /// A call with at most `dispatches` dispatches per submission.
    pub(super) fn new(opened: &'a Opened, dispatches: u64) -> Self {
        let bytes = dispatches * Params::PITCH as u64;
        // Before the first buffer is made: what fails from here on is this call's.
        let flight = opened.flight();
        let uniform = opened.pool.take(&flight.device, Use::Uniform, bytes);
        Self { flight, pipelines: &opened.pipelines, uniform }
    }

    /// The device.
    pub(super) fn device(&self) -> &Device {
        &self.flight.device
    }

    /// A storage buffer.
    pub(super) fn storage(&self, bytes: u64) -> Buffer {
        self.flight.pool.take(self.device(), Use::Storage, bytes)
    }

    /// `kernel` of this text with its buffers.
    pub(super) fn bind<'b>(
        &self,
        kernel: Kernel,
        bindings: Vec<(Slot, Access)>,
        text: String,
        buffer: impl Fn(Slot) -> &'b Buffer,
    ) -> Result<Bound> {
        self.device().counters.add(Count::Text);
        let columns = kernel.workgroup();
        let composed = Composed { kernel, bindings, columns, text };
        let pipeline = self.pipelines.pipeline(self.device(), composed)?;
        Ok(pipeline.bind(self.device(), |slot| match slot {
            Slot::Params => self.uniform.part(0, Params::SIZE.get()),
            _ => buffer(slot).binding(),
        }))
    }

    /// Starts `batch`; at most two submissions are under way at a time.
    pub(super) fn submit(&self, batch: &Batch<'_>) -> Result<()> {
        self.uniform.write(self.device(), batch.blocks());
        self.flight.submit(batch, |_| {}, |_| {}).map(drop)
    }
}
