//! Pairs on the device: both rollouts of each side by side, the farthest pair of each step.

use super::buffer::{Buffer, Params};
use super::compose::{Kernel, Slot};
use super::drive::Drive;
use super::kernel::Bound;
use super::opened::Opened;
use super::plan::Work;
use super::recover::Attempt;
use super::run::{Batch, Job, check_starts, region_vectors, schedule, start_params};
use crate::backend::PairSink;
use crate::error::Result;
use crate::policy::{Mlp, Policy};
use crate::rollout::{DeviationTask, Farthest, PairControl, PairMeasure, Plant};
use crate::system::System;

/// See [`crate::backend::Backend::deviation`]; the farthest pairs are merged into `farthest` chunk by
/// chunk, as the measures go to the sink.
pub(super) fn deviation<S, P, const NX: usize, const NU: usize>(
    adapter: (&Opened, &Attempt),
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_>,
    (farthest, sink): (&mut [Farthest], PairSink<'_>),
) -> Result<()>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let rows = task.spec.horizon as usize + 1;
    let count = task.range.end.saturating_sub(task.range.start);
    if count == 0 {
        return Ok(());
    }
    check_starts(&task.pairs.nominal)?;
    let job = Job::new(adapter, plant, Work::Pairs, count)?;
    let buffers = Buffers::new(&job, plant.policy.network(), task)?;
    let chunks = Chunks {
        kernels: buffers.bind(&job)?,
        job: &job,
        drive: &buffers.drive,
        params: pair_params(task, job.plan.stride),
    };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(job.plan.stride)) as u32;
        job.upload_starts(&task.pairs.nominal, first, columns, &buffers.state);
        chunks.run(first, columns)?;
        let found: Vec<[u32; 2]> = buffers.farthest.read(&job.call.device, rows)?;
        let values: Vec<PairMeasure> = buffers.measures.read(&job.call.device, columns as usize)?;
        for (farthest, [bits, column]) in farthest.iter_mut().zip(found) {
            *farthest = farthest.merge(Farthest {
                distance: f32::from_bits(bits),
                pair: first + u64::from(column),
            });
        }
        sink(first, &values)?;
        first += u64::from(columns);
    }
    Ok(())
}

/// The buffers of a call.
struct Buffers {
    schedule: Buffer,
    region: Buffer,
    state: Buffer,
    folds: Buffer,
    origin: Buffer,
    measures: Buffer,
    distances: Buffer,
    farthest: Buffer,
    drive: Drive,
}

impl Buffers {
    fn new(job: &Job<'_>, network: Option<&Mlp>, task: &DeviationTask<'_>) -> Result<Self> {
        let (row, stride) = (u64::from(job.plan.row), u64::from(job.plan.stride));
        Ok(Self {
            schedule: job.call.uploaded(&schedule(&task.spec, task.tightening)?),
            region: job.call.uploaded(&region_vectors(&task.pairs.nominal)),
            state: job.call.storage(16 * task.pairs.nominal.size().div_ceil(4) as u64 * row),
            folds: job.call.storage(8 * row),
            origin: job.call.storage(4 * stride),
            measures: job.call.storage(8 * stride),
            distances: job.call.storage(4 * stride * u64::from(job.plan.segment)),
            farthest: job.call.storage(8 * (u64::from(task.spec.horizon) + 1)),
            drive: Drive::new(job, network),
        })
    }

    fn bind(&self, job: &Job<'_>) -> Result<Kernels> {
        let buffer = |slot| match slot {
            Slot::Region => &self.region,
            Slot::Schedule => &self.schedule,
            Slot::State => &self.state,
            Slot::Folds => &self.folds,
            Slot::Origin => &self.origin,
            Slot::Distances => &self.distances,
            Slot::Farthest => &self.farthest,
            Slot::Control | Slot::Weights => self.drive.source().unwrap_or(&self.measures),
            _ => &self.measures,
        };
        Ok(Kernels {
            sample: job.bind(Kernel::Sample, buffer)?,
            rollout: job.bind(Kernel::Deviation, buffer)?,
            reduce: job.bind(Kernel::Reduce, buffer)?,
            layers: self.drive.bind(job, &self.state)?,
        })
    }
}

/// The kernels bound to them.
struct Kernels {
    sample: Bound,
    rollout: Bound,
    reduce: Bound,
    layers: Vec<Bound>,
}

/// Parameters of the pairs.
fn pair_params(task: &DeviationTask<'_>, stride: u32) -> Params {
    let [pair_key_low, pair_key_high] = task.pairs.stream.key();
    Params {
        stride,
        pair_key_low,
        pair_key_high,
        pair_stream: task.pairs.stream.id(),
        pair_radius: task.pairs.radius,
        paired: 1,
        closed_loop: u32::from(task.control == PairControl::ClosedLoop),
        ..start_params(&task.pairs.nominal, &task.spec)
    }
}

/// What the chunks of a call share.
struct Chunks<'a> {
    job: &'a Job<'a>,
    drive: &'a Drive,
    kernels: Kernels,
    params: Params,
}

impl Chunks<'_> {
    /// Rolls out the pairs `first..first + columns`.
    fn run(&self, first: u64, columns: u32) -> Result<()> {
        let plan = self.job.plan;
        let params = self.params.at(first, columns);
        let mut batch = Batch::default();
        batch.push_columns(Kernel::Sample, &self.kernels.sample, &params);
        let mut step = 0;
        while step <= params.horizon {
            let count = plan.segment.min(params.horizon + 1 - step);
            self.segment(&mut batch, params, step, count);
            self.job.call.submit(&batch, None)?;
            batch = Batch::default();
            step += count;
        }
        Ok(())
    }

    /// Adds the dispatches of `count` steps, and the reduction of their distances.
    fn segment<'a>(&'a self, batch: &mut Batch<'a>, params: Params, first: u32, count: u32) {
        let plan = self.job.plan;
        let params = Params { segment_start: first, ..params };
        let mut step = first;
        while step < first + count {
            let steps = plan.steps.min(first + count - step);
            if step < params.horizon {
                // Perturbed states stand `stride` columns after the nominal ones.
                let columns = if params.closed_loop == 0 { params.columns } else { plan.row };
                self.drive.forward(batch, &self.kernels.layers, columns, plan.row);
            }
            batch.push_columns(Kernel::Deviation, &self.kernels.rollout, &params.over(step, steps));
            step += steps;
        }
        batch.push(&self.kernels.reduce, &params.over(first, count), [count, 1]);
    }
}
