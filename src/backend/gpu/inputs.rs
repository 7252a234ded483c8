//! What the host sends with a submission: one buffer, one write.

use std::ops::Range;

use super::batch::Batch;
use super::buffer::{Buffer, Pool, Use};
use super::compose::Slot;
use super::device::Device;
use super::params::Params;
use crate::error::{Error, Result};
use crate::rollout::{Region, RolloutSpec, Starts, Tightening};

/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: usize = 16;

/// Sizes of the parts, in vectors of 4 numbers, and in blocks of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InputSizes {
    /// Of the parameters of the model.
    pub(super) values: usize,
    /// Of the schedule, one per step.
    pub(super) steps: usize,
    /// Of the region or of the starts that are listed.
    pub(super) region: usize,
    /// Dispatches of a submission.
    pub(super) dispatches: usize,
}

/// The parameters of the model, the schedule, the region or listed starts, then the parameters of
/// each dispatch, as the host has them and on the device.
pub(super) struct Inputs {
    buffer: Buffer,
    bytes: Vec<u8>,
    values: Range<usize>,
    schedule: Range<usize>,
    region: Range<usize>,
    blocks: Range<usize>,
    /// The device has what lies before.
    changed: usize,
}

impl Inputs {
    /// Room for `sizes`.
    pub(super) fn new(device: &Device, pool: &Pool, sizes: InputSizes) -> Self {
        let mut end = 0;
        let mut part = |bytes: usize| {
            let start = end;
            // Parts begin at the largest alignment that an adapter may ask for, and none is empty.
            end = (start + bytes.max(VECTOR_BYTES)).next_multiple_of(Params::PITCH);
            start..start + bytes.max(VECTOR_BYTES)
        };
        let values = part(VECTOR_BYTES * sizes.values);
        let schedule = part(VECTOR_BYTES * sizes.steps);
        let region = part(VECTOR_BYTES * sizes.region);
        let blocks = part(Params::PITCH * sizes.dispatches);
        let buffer = pool.take(device, Use::Inputs, end as u64);
        Self { buffer, bytes: vec![0; end], values, schedule, region, blocks, changed: 0 }
    }

    /// What a kernel sees of it in `slot`; `None` for any other.
    pub(super) fn binding(&self, slot: Slot) -> Option<wgpu::BufferBinding<'_>> {
        let part = match slot {
            Slot::Params => self.blocks.start..self.blocks.start + Params::SIZE.get() as usize,
            Slot::Values => self.values.clone(),
            Slot::Schedule => self.schedule.clone(),
            Slot::Region => self.region.clone(),
            _ => return None,
        };
        Some(self.buffer.part(part.start as u64, part.len() as u64))
    }

    /// Bytes of it.
    pub(super) fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Sets the numbers of `part` from the number `at` on.
    fn put(&mut self, part: &Range<usize>, at: usize, numbers: &[f32]) {
        let start = part.start + size_of::<f32>() * at;
        let bytes: &[u8] = bytemuck::cast_slice(numbers);
        self.bytes[start..start + bytes.len()].copy_from_slice(bytes);
        self.changed = self.changed.min(part.start);
    }

    /// Sets the parameters of the model.
    pub(super) fn set_values(&mut self, values: &[f32]) {
        self.put(&self.values.clone(), 0, values);
    }

    /// Sets the schedule, per step: discount, and what both margins lose. The discount is multiplied
    /// up step by step in f32, as the host's fold does.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the tightening has not one entry per step.
    pub(super) fn set_schedule(
        &mut self,
        spec: &RolloutSpec,
        tightening: &Tightening,
    ) -> Result<()> {
        check_tightening(spec, tightening)?;
        let losses = tightening.target.iter().zip(&tightening.constraint);
        let mut discount = 1.0;
        for (step, (&target, &constraint)) in losses.enumerate() {
            self.put(&self.schedule.clone(), 4 * step, &[discount, target, constraint, 0.0]);
            discount *= spec.gamma;
        }
        Ok(())
    }

    /// Sets the region that starts are drawn from, one vector per coordinate, as
    /// `shaders/sample.wgsl` reads them; nothing if they are listed.
    pub(super) fn set_region(&mut self, starts: &Starts<'_>) {
        let Starts::Drawn { region, .. } = starts else { return };
        for i in 0..region.size() {
            let vector = match region {
                Region::Box { low, high } => [low[i], high[i] - low[i], 1.0, 0.0],
                Region::Ball(ball) => {
                    let varies = f32::from(u8::from(ball.varies[i]));
                    [ball.center[i], ball.radius, varies, 0.0]
                }
            };
            self.put(&self.region.clone(), 4 * i, &vector);
        }
    }

    /// Sets the listed starts `first..first + columns`, `[states / 4, columns]` vectors; nothing if
    /// they are drawn.
    pub(super) fn set_starts(&mut self, starts: &Starts<'_>, first: u64, columns: u32) {
        let Starts::Listed(list) = starts else { return };
        let columns = columns as usize;
        for column in 0..columns {
            // Past its end, a list repeats its last start.
            let row = list.row((first as usize + column).min(list.len() - 1));
            for (quad, numbers) in row.chunks(4).enumerate() {
                self.put(&self.region.clone(), 4 * (quad * columns + column), numbers);
            }
        }
    }

    /// Writes what changed, and the parameters of `batch`, before the next submission.
    pub(super) fn write(&mut self, device: &Device, batch: &Batch<'_>) {
        let blocks = batch.blocks();
        let end = self.blocks.start + blocks.len();
        self.bytes[self.blocks.start..end].copy_from_slice(blocks);
        let start = self.changed.min(self.blocks.start);
        self.buffer.write_at(device, start as u64, &self.bytes[start..end]);
        self.changed = self.blocks.start;
    }
}

/// # Errors
/// [`Error::Invalid`] if the tightening has not one entry per step.
fn check_tightening(spec: &RolloutSpec, tightening: &Tightening) -> Result<()> {
    let rows = spec.horizon as usize + 1;
    let (target, constraint) = (tightening.target.len(), tightening.constraint.len());
    if target == rows && constraint == rows {
        return Ok(());
    }
    let problem = format!(
        "{target} and {constraint} entries for the target and constraint margin; \
         a horizon of {} needs {rows} each",
        spec.horizon
    );
    Err(Error::invalid("tightening", problem))
}
