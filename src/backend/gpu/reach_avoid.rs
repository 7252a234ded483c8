//! Reach-avoid measures on the device: chunks of trajectories, compacted where only signs count.

use super::Gpu;
use super::buffer::{Buffer, Params};
use super::compose::{Kernel, Slot};
use super::kernel::Bound;
use super::network::Network;
use super::plan::Work;
use super::run::{Batch, Job, check_starts, region_vectors, schedule, start_params};
use crate::backend::MeasureSink;
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{Plant, Query, ReachAvoidTask};
use crate::system::System;

/// See [`crate::backend::Backend::reach_avoid`].
pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
    gpu: &Gpu,
    plant: Plant<'_, S, P>,
    task: &ReachAvoidTask<'_, NX>,
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
    let job = Job::new(gpu, plant, work, count)?;
    let schedule = job.uploaded(&schedule(&task.spec, task.tightening)?);
    let region = job.uploaded(&region_vectors(&task.starts));
    let params = Params {
        stride: job.plan.stride,
        sign_only: u32::from(work == Work::Sign),
        ..start_params(&task.starts, &task.spec)
    };
    let network = plant
        .policy
        .network()
        .map(|mlp| Network::new(&job, mlp, job.plan.row));
    let measures = job.storage(4 * u64::from(job.plan.stride));
    let survivors = job.storage(4);
    let sets = [Columns::new(&job, NX), Columns::new(&job, NX)];
    let bind = |from: usize| {
        let (set, kept) = (&sets[from], &sets[1 - from]);
        let buffer = |slot| match slot {
            Slot::Region => &region,
            Slot::Schedule => &schedule,
            Slot::State => &set.state,
            Slot::Folds => &set.folds,
            Slot::Origin => &set.origin,
            Slot::KeptState => &kept.state,
            Slot::KeptFolds => &kept.folds,
            Slot::KeptOrigin => &kept.origin,
            Slot::Survivors => &survivors,
            Slot::Control => network.as_ref().map_or(&measures, Network::control),
            _ => &measures,
        };
        Ok(Kernels {
            sample: job.bind(Kernel::Sample, buffer)?,
            rollout: job.bind(Kernel::ReachAvoid, buffer)?,
            compact: job.bind(Kernel::Compact, buffer)?,
            layers: match &network {
                Some(network) => network.bind(&job, &set.state)?,
                None => Vec::new(),
            },
        })
    };
    let chunks = Chunks {
        kernels: [bind(0)?, bind(1)?],
        job: &job,
        network: network.as_ref(),
        survivors: &survivors,
        params,
    };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(job.plan.stride)) as u32;
        job.upload_starts(&task.starts, first, columns, &sets[0].state);
        chunks.run(first, columns)?;
        let values: Vec<f32> = measures.read(job.device, columns as usize)?;
        sink(first, &values)?;
        first += u64::from(columns);
    }
    Ok(())
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
            state: job.storage(16 * states.div_ceil(4) as u64 * stride),
            folds: job.storage(8 * stride),
            origin: job.storage(4 * stride),
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
    network: Option<&'a Network>,
    survivors: &'a Buffer,
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
                self.job.submit(&batch, None)?;
            } else {
                let compact = &self.kernels[set].compact;
                batch.push_columns(Kernel::Compact, compact, &params);
                self.job.submit(&batch, Some(self.survivors))?;
                params.columns = self.survivors.read::<u32>(self.job.device, 1)?[0];
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
            if let Some(network) = self.network
                && step < params.horizon
            {
                network.forward(batch, &kernels.layers, params.columns, params.stride);
            }
            let params = params.over(step, count);
            batch.push_columns(Kernel::ReachAvoid, &kernels.rollout, &params);
            step += count;
        }
    }
}
