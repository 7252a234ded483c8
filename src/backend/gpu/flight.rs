//! The submissions of one call.

use std::cell::{Cell, RefCell};

use super::batch::Batch;
use super::buffer::Pool;
use super::device::Device;
use super::timing::Clock;
use super::traffic::Count;
use crate::error::Result;

/// The number of a submission of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Ticket(u64);

/// The submissions of one call, at most two under way at a time.
pub(super) struct Flight<'a> {
    pub(super) device: Device,
    pub(super) pool: &'a Pool,
    clock: &'a Clock,
    sent: Cell<u64>,
    /// The last submission that is not known to be done.
    under_way: RefCell<Option<(Ticket, wgpu::SubmissionIndex)>>,
}

impl<'a> Flight<'a> {
    /// The submissions of a call that begins now: what fails on `device` from here on is the call's.
    pub(super) fn new(device: &Device, pool: &'a Pool, clock: &'a Clock) -> Self {
        let (device, under_way) = (device.for_call(), RefCell::default());
        Self { device, pool, clock, sent: Cell::new(0), under_way }
    }

    /// Starts `batch`, between what `before` and `after` record; waits for the submission before it.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work of the call.
    pub(super) fn submit(
        &self,
        batch: &Batch<'_>,
        before: impl FnOnce(&mut wgpu::CommandEncoder),
        after: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<Ticket> {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        before(&mut encoder);
        let stamps = self.clock.stamps(&self.device, self.pool, batch.len() as usize);
        let passes = batch.encode(&mut encoder, stamps.as_ref());
        self.device.counters.add_many(Count::Pass, passes);
        after(&mut encoder);
        let index = self.device.submit(encoder.finish())?;
        if let Some(stamps) = &stamps {
            self.clock.add(&self.device, stamps, batch.kernels())?;
        }
        let ticket = Ticket(self.sent.replace(self.sent.get() + 1));
        match self.under_way.replace(Some((ticket, index))) {
            Some((_, before)) => self.device.wait(Some(before))?,
            None => self.device.check()?,
        }
        Ok(ticket)
    }

    /// Waits for the submission of `ticket`.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`], also for failures of earlier work of the call.
    pub(super) fn wait(&self, ticket: Ticket) -> Result<()> {
        let mut under_way = self.under_way.borrow_mut();
        match under_way.take_if(|(last, _)| *last <= ticket) {
            Some((_, index)) => self.device.wait(Some(index)),
            // It was waited for when the next one was submitted.
            None => self.device.check(),
        }
    }
}
