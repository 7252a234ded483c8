//! What the host sends with a submission of rollouts.

use super::batch::{Batch, Counted};
use super::buffer::Pool;
use super::compose::Slot;
use super::device::Device;
use super::upload::Upload;
use crate::model::{Moment, Task};
use crate::rollout::{Effect, Region, RolloutSpec, Starts, Tightening};

/// In the last number of a row of the schedule: its bit for margins with factors, and where the role of the
/// step begins; twins in `shaders/judge.wgsl`.
const MULTIPLIED: u32 = 1;
const ROLE_SHIFT: u32 = 1;
/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: usize = 16;

/// Sizes of the parts, in vectors of 4 numbers, and in blocks of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InputSizes {
    /// Of the parameters of the model.
    pub(super) values: usize,
    /// Of the schedule, one per step, or two where there are points between.
    pub(super) schedule: usize,
    /// Of the region that starts are drawn from.
    pub(super) region: usize,
    /// Dispatches of a submission.
    pub(super) dispatches: usize,
    /// Dispatches that the device narrows at a time.
    pub(super) narrowed: usize,
}

/// Parts of the upload: the parameters of the model, the schedule, the region.
const VALUES: usize = 0;
const SCHEDULE: usize = 1;
const REGION: usize = 2;

/// What the host sends with a submission of rollouts.
pub(super) struct Inputs(Upload);

impl Inputs {
    /// Room for `sizes`.
    pub(super) fn new(device: &Device, pool: &Pool, sizes: InputSizes) -> Self {
        let parts =
            [sizes.values, sizes.schedule, sizes.region].map(|vectors| VECTOR_BYTES * vectors);
        Self(Upload::new(device, pool, &parts, sizes.dispatches, sizes.narrowed))
    }

    /// What a kernel sees of it in `slot`; `None` for any other.
    pub(super) fn binding(&self, slot: Slot) -> Option<wgpu::BufferBinding<'_>> {
        match slot {
            Slot::Params => Some(self.0.params()),
            Slot::Blocks => Some(self.0.narrowed()),
            Slot::Values => Some(self.0.part(VALUES)),
            Slot::Schedule => Some(self.0.part(SCHEDULE)),
            Slot::Region => Some(self.0.part(REGION)),
            _ => None,
        }
    }

    /// Where dispatches find the number of their workgroups that the device counts.
    pub(super) fn counted(&self) -> Counted {
        self.0.counted()
    }

    /// Bytes of it.
    pub(super) fn size(&self) -> u64 {
        self.0.size()
    }

    /// Sets the parameters of the model.
    pub(super) fn set_values(&mut self, values: &[f32]) {
        self.0.put(VALUES, 0, values);
    }

    /// Sets the schedule, per step: discount, what both margins lose, and a whole number of two parts:
    /// whether they are multiplied with it instead, and what the step is to `task`. The discount is
    /// multiplied up step by step in f32, as the host's fold does. Where a step has two rows, the second is that
    /// of the points behind it: they have its discount and lose what the next step does.
    pub(super) fn set_schedule(
        &mut self,
        spec: &RolloutSpec,
        task: Task,
        tightening: &Tightening,
        rows: u32,
    ) {
        let multiplied = match tightening.effect {
            Effect::Subtracted => 0,
            Effect::Multiplied => MULTIPLIED,
        };
        let Tightening { target, constraint, .. } = tightening;
        let mut discount = 1.0;
        for step in 0..=spec.horizon {
            for point in 0..rows {
                let moment = Moment { step, point };
                let (at, role) = (moment.sample(), task.role_at(moment, spec.horizon));
                let at = at.min(spec.horizon as usize);
                let marks = multiplied | (role.bits() << ROLE_SHIFT);
                // Below 64: a whole number that f32 holds.
                let row = [discount, target[at], constraint[at], marks as f32];
                self.0.put(SCHEDULE, 4 * (step * rows + point) as usize, &row);
            }
            discount *= spec.gamma;
        }
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
                Region::Ellipsoid(set) => {
                    let varies = f32::from(u8::from(set.half_axes[i] > 0.0));
                    [set.center[i], set.half_axes[i], varies, 0.0]
                }
            };
            self.0.put(REGION, 4 * i, &vector);
        }
    }

    /// Writes what changed, and the parameters of `batch`, before the next submission.
    pub(super) fn write(&mut self, device: &Device, batch: &Batch<'_>) {
        self.0.write(device, batch);
    }
}
