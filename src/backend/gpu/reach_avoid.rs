//! Reach-avoid measures on the device: chunks of trajectories, compacted where only signs count.

use std::ops::Range;

use super::attempt::Attempt;
use super::batch::Batch;
use super::chain::ChainStep;
use super::chunking::{Chunking, Work};
use super::compose::{Kernel, Slot};
use super::job::{Job, Request, Subject};
use super::opened::Opened;
use super::params::Params;
use super::workspace::{Buffers, Kernels, MEASURES_AT, Sent, Workspace};
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
    let mut delivery = Delivery { next: task.range.start, sink };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(stride)) as u32;
        job.space.inputs.set_starts(starts, first, columns);
        roll(&mut job, params.at(first, columns), first, &mut delivery)?;
        first += u64::from(columns);
    }
    let last = job.space.results.last(&job.flight, found)?;
    last.map_or(Ok(()), |found| delivery.take(found))?;
    job.finish();
    Ok(())
}

/// What a submission came to.
struct Found {
    sent: Sent,
    /// Measures or signs, once all trajectories have ended.
    values: Option<Vec<f32>>,
}

/// Results in order of index.
struct Delivery<'a> {
    /// The first start that the sink does not have yet.
    next: u64,
    sink: MeasureSink<'a>,
}

impl Delivery<'_> {
    /// Gives `found` to the sink, if it is the end of a chunk that the sink does not have yet.
    fn take(&mut self, Found { sent, values }: Found) -> Result<()> {
        let Some(values) = values.filter(|_| sent.first == self.next) else { return Ok(()) };
        (self.sink)(sent.first, &values)?;
        self.next += u64::from(sent.columns);
        Ok(())
    }

    /// Whether the sink has the chunk that begins with `first`.
    fn has(&self, first: u64) -> bool {
        self.next > first
    }
}

/// What is read back: the survivors where signs go on, then measures or signs.
fn found(sent: Sent, bytes: &[u8]) -> Found {
    let (head, tail) = bytes.split_at(MEASURES_AT as usize);
    let ended = sent.ended || bytemuck::pod_read_unaligned::<u32>(&head[..4]) == 0;
    Found { sent, values: ended.then(|| bytemuck::pod_collect_to_vec(tail)) }
}

/// Sends the starts of `params` off, the first of which has the index `first`, until the horizon or until
/// all are decided; takes over what the submissions before came to.
fn roll(job: &mut Job<'_>, params: Params, first: u64, delivery: &mut Delivery<'_>) -> Result<()> {
    let Job { flight, chunking, space, .. } = job;
    let Workspace { inputs, results, buffers, kernels, .. } = space;
    let bytes = 4 * u64::from(params.columns);
    let mut course = Course { params, chunking: *chunking, step: 0, set: 0 };
    let mut batch = Batch::default();
    batch.push_columns(Kernel::Sample, &kernels[0].sample, &params);
    while course.step <= params.horizon && !delivery.has(first) {
        let begins = course.step == 0;
        for _ in 0..chunking.rounds {
            if course.set > 0
                && let Some(narrow) = &kernels[course.set % 2].narrow
            {
                batch.narrow(narrow, inputs.counted());
            }
            course.segment(&mut batch, kernels, buffers);
            if course.ended() {
                break;
            }
        }
        inputs.write(&flight.device, &batch);
        let ended = course.ended();
        let counts = kernels[0].after.is_some();
        let before = |encoder: &mut _| {
            if begins && counts {
                buffers.of(Slot::Survivors).clear(encoder);
                buffers.of(Slot::Left).clear(encoder);
            }
        };
        // Measures come along with the number of survivors: there may be none.
        let after = |encoder: &mut _| {
            if counts && !ended {
                let survivors = buffers.of_set(Slot::Survivors, (course.set + 1) % 2);
                results.free().copy(encoder, survivors, 0, SURVIVORS_BYTES);
            }
            if counts || ended {
                results.free().copy(encoder, buffers.of(Slot::Measures), MEASURES_AT, bytes);
            }
        };
        let ticket = flight.submit(&batch, before, after)?;
        batch = Batch::default();
        if counts || ended {
            let sent = Sent { first, columns: params.columns, ended };
            let earlier = results.send(flight, (ticket, MEASURES_AT + bytes), sent, found)?;
            earlier.map_or(Ok(()), |found| delivery.take(found))?;
        }
    }
    Ok(())
}

/// How far the trajectories of a chunk have come.
struct Course {
    params: Params,
    chunking: Chunking,
    /// The next step.
    step: u32,
    /// Compactions so far: each changes the set of columns.
    set: usize,
}

impl Course {
    /// Whether the horizon is behind.
    fn ended(&self) -> bool {
        self.step > self.params.horizon
    }

    /// Adds the dispatches of a segment, and of the compaction behind it where signs go on.
    fn segment<'a>(&mut self, batch: &mut Batch<'a>, kernels: &'a [Kernels], buffers: &Buffers) {
        let Self { params, chunking, step, set } = *self;
        let kernels = &kernels[set % 2];
        let end = params.horizon.saturating_add(1).min(step + chunking.segment);
        steps(batch, kernels, buffers, chunking, params, step..end);
        self.step = end;
        if let Some(compact) = kernels.after.as_ref().filter(|_| !self.ended()) {
            batch.push_columns(Kernel::Compact, compact, &params);
            self.set += 1;
        }
    }
}

/// Adds the dispatches of some steps.
fn steps<'a>(
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
        batch.push_columns(Kernel::ReachAvoid, &kernels.rollout, &params.over(step, count));
        step += count;
    }
}
