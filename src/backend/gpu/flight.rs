//! The submissions of one call.

use std::cell::Cell;

use super::batch::Batch;
use super::buffer::Pool;
use super::device::Device;
use super::timing::Clock;
use crate::error::Result;

/// The submissions of one call, at most two under way at a time.
pub(super) struct Flight<'a> {
    pub(super) device: Device,
    pub(super) pool: &'a Pool,
    clock: &'a Clock,
    in_flight: Cell<Option<wgpu::SubmissionIndex>>,
}

impl<'a> Flight<'a> {
    /// The submissions of a call that begins now: what fails on `device` from here on is the call's.
    pub(super) fn new(device: &Device, pool: &'a Pool, clock: &'a Clock) -> Self {
        Self { device: device.for_call(), pool, clock, in_flight: Cell::new(None) }
    }

    /// Starts `batch`, between what `before` and `after` record.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work of the call.
    pub(super) fn submit(
        &self,
        batch: &Batch<'_>,
        before: impl FnOnce(&mut wgpu::CommandEncoder),
        after: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<()> {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        before(&mut encoder);
        let stamps = self.clock.stamps(&self.device, self.pool, batch.len() as usize);
        batch.encode(&mut encoder, stamps.as_ref());
        after(&mut encoder);
        let index = self.device.submit(encoder.finish())?;
        if let Some(stamps) = &stamps {
            self.clock.add(&self.device, stamps, batch.kernels())?;
        }
        match self.in_flight.replace(Some(index)) {
            Some(before) => self.device.wait(Some(before)),
            None => self.device.check(),
        }
    }

    /// Waits for what was submitted last.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work of the call.
    pub(super) fn settle(&self) -> Result<()> {
        self.device.wait(self.in_flight.take())
    }
}
