//! Reach-avoid measures on the device: chunks of trajectories, compacted where only signs count.

use std::ops::Range;

use super::attempt::Attempt;
use super::batch::Batch;
use super::chain::ChainStep;
use super::chunking::{Chunking, Work};
use super::compose::Slot;
use super::job::{Job, Request, Subject};
use super::opened::Opened;
use super::params::Params;
use super::workspace::{Buffers, Kernels, MEASURES_AT, Workspace};
use crate::backend::MeasureSink;
use crate::error::Result;
use crate::rollout::{Query, ReachAvoidTask};

/// Bytes of the number of survivors.
const SURVIVORS_BYTES: u64 = 4;

/// See [`crate::backend::Program::reach_avoid`].
pub(super) fn reach_avoid(
    opened: &Opened,
    attempt: &Attempt,
    subject: Subject<'_>,
    task: &ReachAvoidTask<'_>,
    sink: MeasureSink<'_>,
) -> Result<()> {
    let count = task.range.end.saturating_sub(task.range.start);
    if count == 0 {
        return Ok(());
    }
    let (work, sign_only) = match task.query {
        Query::Measure => (Work::Measure, 0),
        Query::Sign => (Work::Sign, 1),
    };
    let (starts, spec, tightening) = (&task.starts, &task.spec, task.tightening);
    let request = Request { work, starts, spec, tightening, count };
    let mut job = Job::new(opened, attempt, subject, request)?;
    let stride = job.chunking.stride;
    let params = Params { stride, sign_only, ..Params::of_starts(starts, spec) };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(stride)) as u32;
        job.space.inputs.set_starts(starts, first, columns);
        let values = roll(&mut job, params.at(first, columns))?;
        sink(first, &values)?;
        first += u64::from(columns);
    }
    job.finish();
    Ok(())
}

/// Rolls out the starts of `params`, until the horizon or until all are decided: their values.
fn roll(job: &mut Job<'_>, mut params: Params) -> Result<Vec<f32>> {
    let measures = 4 * u64::from(params.columns);
    let Job { flight, chunking, space, .. } = job;
    let Workspace { inputs, readback, buffers, kernels, .. } = space;
    let mut batch = Batch::default();
    batch.push_columns(&kernels[0].sample, &params);
    let (mut step, mut set) = (0, 0);
    loop {
        let end = params.horizon.saturating_add(1).min(step + chunking.segment);
        segment(&mut batch, &kernels[set], buffers, *chunking, params, step..end);
        step = end;
        let last = step > params.horizon;
        let compacted = kernels[set].after.as_ref().filter(|_| !last);
        if let Some(compact) = compacted {
            batch.push_columns(compact, &params);
        }
        inputs.write(&flight.device, &batch);
        let clear = |encoder: &mut _| {
            if compacted.is_some() {
                buffers.of(Slot::Survivors).clear(encoder);
            }
        };
        // Measures come along with the number of survivors: there may be none.
        let copy = |encoder: &mut _| {
            if compacted.is_some() {
                readback.copy(encoder, buffers.of(Slot::Survivors), 0, SURVIVORS_BYTES);
            }
            if compacted.is_some() || last {
                readback.copy(encoder, buffers.of(Slot::Measures), MEASURES_AT, measures);
            }
        };
        flight.submit(&batch, clear, copy)?;
        batch = Batch::default();
        if compacted.is_none() && !last {
            continue;
        }
        let decided = compacted.is_some();
        let found = readback.read(flight, MEASURES_AT + measures, |bytes| {
            let (head, tail) = bytes.split_at(MEASURES_AT as usize);
            let survivors = if decided { bytemuck::pod_read_unaligned(&head[..4]) } else { 0 };
            let done = survivors == 0;
            (survivors, done.then(|| bytemuck::pod_collect_to_vec(tail)))
        })?;
        match found {
            (_, Some(values)) => return Ok(values),
            (survivors, None) => params.columns = survivors,
        }
        set = 1 - set;
    }
}

/// Adds the dispatches of some steps.
fn segment<'a>(
    batch: &mut Batch<'a>,
    kernels: &'a Kernels,
    buffers: &Buffers,
    chunking: Chunking,
    params: Params,
    steps: Range<u32>,
) {
    let mut step = steps.start;
    while step < steps.end {
        let count = chunking.steps.min(steps.end - step);
        let Params { columns, stride: row, horizon, .. } = params;
        kernels.chain(batch, ChainStep { step, horizon, columns, row, acting: row });
        if step < params.horizon {
            kernels.drive(batch, buffers, columns, row, step);
        }
        batch.push_columns(&kernels.rollout, &params.over(step, count));
        step += count;
    }
}
