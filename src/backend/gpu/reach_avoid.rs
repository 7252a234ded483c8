//! Reach-avoid measures on the device: chunks of trajectories, compacted where only signs count.

use super::buffer::{Buffer, Params};
use super::compose::{Kernel, Slot};
use super::drive::Drive;
use super::kernel::Bound;
use super::opened::Opened;
use super::plan::Work;
use super::recover::Attempt;
use super::run::{Batch, Job, check_starts, region_vectors, schedule, start_params};
use crate::backend::MeasureSink;
use crate::error::Result;
use crate::policy::{Mlp, Policy};
use crate::rollout::{Plant, Query, ReachAvoidTask};
use crate::system::System;

/// See [`crate::backend::Backend::reach_avoid`].
pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
    adapter: (&Opened, &Attempt),
    plant: Plant<'_, S, P>,
    task: &ReachAvoidTask<'_>,
    sink: MeasureSink<'_>,
) -> Result<()>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let count = task.range.end.saturating_sub(task.range.start);
    if count == 0 {
        return Ok(());
    }
    check_starts(&task.starts)?;
    let work = match task.query {
        Query::Measure => Work::Measure,
        Query::Sign => Work::Sign,
    };
    let job = Job::new(adapter, plant, work, count)?;
    let buffers = Buffers::new(&job, plant.policy.network(), task)?;
    let chunks = Chunks {
        kernels: [buffers.bind(&job, 0)?, buffers.bind(&job, 1)?],
        job: &job,
        buffers: &buffers,
        params: Params {
            stride: job.plan.stride,
            sign_only: u32::from(work == Work::Sign),
            ..start_params(&task.starts, &task.spec)
        },
    };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(job.plan.stride)) as u32;
        job.upload_starts(&task.starts, first, columns, &buffers.sets[0].state);
        chunks.run(first, columns)?;
        let values: Vec<f32> = buffers.measures.read(&job.call.device, columns as usize)?;
        sink(first, &values)?;
        first += u64::from(columns);
    }
    Ok(())
}

/// The buffers of a call.
struct Buffers {
    schedule: Buffer,
    region: Buffer,
    measures: Buffer,
    survivors: Buffer,
    sets: [Columns; 2],
    drive: Drive,
}

impl Buffers {
    fn new(job: &Job<'_>, network: Option<&Mlp>, task: &ReachAvoidTask<'_>) -> Result<Self> {
        Ok(Self {
            schedule: job.call.uploaded(&schedule(&task.spec, task.tightening)?),
            region: job.call.uploaded(&region_vectors(&task.starts)),
            measures: job.call.storage(4 * u64::from(job.plan.stride)),
            survivors: job.call.storage(4),
            sets: [Columns::new(job, task.starts.size()), Columns::new(job, task.starts.size())],
            drive: Drive::new(job, network),
        })
    }

    /// The kernels on the set `from`, which compact into the other one.
    fn bind(&self, job: &Job<'_>, from: usize) -> Result<Kernels> {
        let (set, kept) = (&self.sets[from], &self.sets[1 - from]);
        let buffer = |slot| match slot {
            Slot::Region => &self.region,
            Slot::Schedule => &self.schedule,
            Slot::State => &set.state,
            Slot::Folds => &set.folds,
            Slot::Origin => &set.origin,
            Slot::KeptState => &kept.state,
            Slot::KeptFolds => &kept.folds,
            Slot::KeptOrigin => &kept.origin,
            Slot::Survivors => &self.survivors,
            Slot::Control | Slot::Weights => self.drive.source().unwrap_or(&self.measures),
            _ => &self.measures,
        };
        Ok(Kernels {
            sample: job.bind(Kernel::Sample, buffer)?,
            rollout: job.bind(Kernel::ReachAvoid, buffer)?,
            compact: job.bind(Kernel::Compact, buffer)?,
            layers: self.drive.bind(job, &set.state)?,
        })
    }
}

/// One of the two sets of buffers that compaction moves trajectories between.
struct Columns {
    state: Buffer,
    folds: Buffer,
    origin: Buffer,
}

impl Columns {
    fn new(job: &Job<'_>, states: usize) -> Self {
        let stride = u64::from(job.plan.stride);
        Self {
            state: job.call.storage(16 * states.div_ceil(4) as u64 * stride),
            folds: job.call.storage(8 * stride),
            origin: job.call.storage(4 * stride),
        }
    }
}

/// The kernels bound to one set of buffers.
struct Kernels {
    sample: Bound,
    rollout: Bound,
    compact: Bound,
    layers: Vec<Bound>,
}

/// What the chunks of a call share.
struct Chunks<'a> {
    job: &'a Job<'a>,
    buffers: &'a Buffers,
    kernels: [Kernels; 2],
    params: Params,
}

impl Chunks<'_> {
    /// Rolls out the starts `first..first + columns`, until the horizon or until all are decided.
    fn run(&self, first: u64, columns: u32) -> Result<()> {
        let plan = self.job.plan;
        let mut params = self.params.at(first, columns);
        let mut batch = Batch::default();
        batch.push_columns(Kernel::Sample, &self.kernels[0].sample, &params);
        let (mut step, mut set) = (0, 0);
        while step <= params.horizon {
            let end = params.horizon.saturating_add(1).min(step + plan.segment);
            self.segment(&mut batch, set, params, step..end);
            step = end;
            if params.sign_only == 0 || step > params.horizon {
                self.job.call.submit(&batch, None)?;
            } else {
                let compact = &self.kernels[set].compact;
                batch.push_columns(Kernel::Compact, compact, &params);
                self.job.call.submit(&batch, Some(&self.buffers.survivors))?;
                params.columns = self.buffers.survivors.read::<u32>(&self.job.call.device, 1)?[0];
                set = 1 - set;
                if params.columns == 0 {
                    break;
                }
            }
            batch = Batch::default();
        }
        Ok(())
    }

    /// Adds the dispatches of some steps.
    fn segment<'a>(
        &'a self,
        batch: &mut Batch<'a>,
        set: usize,
        params: Params,
        steps: std::ops::Range<u32>,
    ) {
        let kernels = &self.kernels[set];
        let mut step = steps.start;
        while step < steps.end {
            let count = self.job.plan.steps.min(steps.end - step);
            if step < params.horizon {
                let drive = &self.buffers.drive;
                drive.forward(batch, &kernels.layers, params.columns, params.stride);
            }
            let params = params.over(step, count);
            batch.push_columns(Kernel::ReachAvoid, &kernels.rollout, &params);
            step += count;
        }
    }
}
