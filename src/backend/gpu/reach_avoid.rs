//! Reach-avoid measures on the device: chunks of trajectories, compacted where only signs count.

use std::ops::Range;

use super::attempt::Attempt;
use super::batch::Batch;
use super::chain::ChainStep;
use super::chunking::{Chunking, Work};
use super::compose::Slot;
use super::counting;
use super::job::{Job, Request, Subject};
use super::opened::Opened;
use super::params::Params;
use super::workspace::{Buffers, Chunk, Kernels, MEASURES_AT, Sent, Workspace};
use crate::backend::sink::{Asked, StartSink};
use crate::error::Result;
use crate::rollout::{MeasureCounts, Query, ReachAvoidTask};

/// Bytes of the number of survivors.
const SURVIVORS_BYTES: u64 = 4;

/// What a call asks for.
#[derive(Clone, Copy)]
pub(super) struct Asking<'a> {
    pub(super) subject: Subject<'a>,
    pub(super) task: &'a ReachAvoidTask<'a>,
    pub(super) asked: Asked,
}

/// What some starts came to.
pub(super) enum CameTo {
    /// Measures or signs.
    Each(Vec<f32>),
    /// Counts of them.
    Counts(MeasureCounts),
}

impl CameTo {
    /// How many starts there are.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Each(values) => values.len(),
            Self::Counts(counts) => counts.starts as usize,
        }
    }

    /// Gives it to `sink`, which asked for it; `first` is the index of the first start.
    ///
    /// # Errors
    /// The sink's.
    pub(super) fn hand_to(&self, first: u64, sink: &mut StartSink<'_>) -> Result<()> {
        match (self, sink) {
            (Self::Each(values), sink) => sink.take(first, values),
            (Self::Counts(counts), StartSink::Counts(sink)) => sink(first, counts),
            (Self::Counts(_), StartSink::Each(_)) => unreachable!("each was asked for"),
        }
    }
}

/// Receives what starts came to, the first of which has the index given; in order.
type Sink<'a> = &'a mut dyn FnMut(u64, CameTo) -> Result<()>;

/// See [`crate::backend::Program::reach_avoid`].
pub(super) fn reach_avoid(
    opened: &Opened,
    attempt: &Attempt,
    Asking { subject, task, asked }: Asking<'_>,
    sink: Sink<'_>,
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
    let request = Request { work, asked, starts, spec, tightening, count };
    let mut job = Job::new(opened, attempt, subject, request)?;
    let stride = job.chunking.stride;
    let params = Params { stride, sign_only, ..Params::of_starts(starts, spec) };
    let mut delivery = Delivery { next: task.range.start, asked, sink };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(stride)) as u32;
        let list = job.list(starts, first, columns);
        let chunk = Chunk { params: params.at(first, columns), first, list: list.as_deref() };
        roll(&mut job, chunk, &mut delivery)?;
        first += u64::from(columns);
    }
    let last = job.space.results.last(&job.flight, |sent, bytes| found(asked, sent, bytes))?;
    last.map_or(Ok(()), |found| delivery.take(found))?;
    job.finish();
    Ok(())
}

/// What a submission came to.
struct Found {
    sent: Sent,
    /// What its trajectories came to, once all have ended.
    came_to: Option<CameTo>,
}

/// Results in order of index.
struct Delivery<'a> {
    /// The first start that the sink does not have yet.
    next: u64,
    asked: Asked,
    sink: Sink<'a>,
}

impl Delivery<'_> {
    /// Gives `found` to the sink, if it is the end of a chunk that the sink does not have yet.
    fn take(&mut self, Found { sent, came_to }: Found) -> Result<()> {
        let Some(came_to) = came_to.filter(|_| sent.first == self.next) else { return Ok(()) };
        (self.sink)(sent.first, came_to)?;
        self.next += u64::from(sent.columns);
        Ok(())
    }

    /// Whether the sink has the chunk that begins with `first`.
    fn has(&self, first: u64) -> bool {
        self.next > first
    }
}

/// What is read back: the survivors where signs go on, then what was asked for.
fn found(asked: Asked, sent: Sent, bytes: &[u8]) -> Found {
    let (head, tail) = bytes.split_at(MEASURES_AT as usize);
    let ended = sent.ended || bytemuck::pod_read_unaligned::<u32>(&head[..4]) == 0;
    let came_to = || match asked {
        Asked::Each => CameTo::Each(bytemuck::pod_collect_to_vec(tail)),
        Asked::Counts => CameTo::Counts(counting::measures(sent.first, sent.columns, tail)),
    };
    Found { sent, came_to: ended.then(came_to) }
}

/// Sends the starts of `chunk` off, until the horizon or until all are decided; takes over what the
/// submissions before came to.
fn roll(job: &mut Job<'_>, chunk: Chunk<'_>, delivery: &mut Delivery<'_>) -> Result<()> {
    let Chunk { params, first, list } = chunk;
    let Job { flight, chunking, space, .. } = job;
    let Workspace { inputs, listed, results, buffers, kernels, .. } = space;
    let (asked, columns) = (delivery.asked, params.columns);
    let (slot, bytes) = match asked {
        Asked::Each => (Slot::Measures, 4 * u64::from(columns)),
        Asked::Counts => (Slot::Counts, counting::measure_bytes(columns)),
    };
    let mut course = Course { params, chunking: *chunking, step: 0, set: 0 };
    let mut batch = Batch::default();
    batch.push_columns(&kernels[0].sample, &params);
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
        let ended = course.ended();
        let counts = kernels[0].after.is_some();
        if let Some(count) = kernels[0].count.as_ref().filter(|_| counts || ended) {
            batch.widen();
            batch.push(count, &params, [counting::groups(columns), 1]);
        }
        inputs.write(&flight.device, &batch);
        let before = |encoder: &mut wgpu::CommandEncoder| {
            if let (Some(listed), Some(list)) = (&mut *listed, list) {
                listed.take(encoder, list);
            }
            if begins && counts {
                buffers.of(Slot::Survivors).clear(encoder);
                buffers.of(Slot::Left).clear(encoder);
            }
        };
        // Results come along with the number of survivors: there may be none.
        let after = |encoder: &mut _| {
            if counts && !ended {
                let survivors = buffers.of_set(Slot::Survivors, (course.set + 1) % 2);
                results.free().copy(encoder, survivors, 0, SURVIVORS_BYTES);
            }
            if counts || ended {
                results.free().copy(encoder, buffers.of(slot), MEASURES_AT, bytes);
            }
        };
        let ticket = flight.submit(&batch, before, after)?;
        batch = Batch::default();
        if counts || ended {
            let (sent, bytes) = (Sent { first, columns, ended }, MEASURES_AT + bytes);
            let take = |sent, bytes: &[u8]| found(asked, sent, bytes);
            let earlier = results.send(flight, (ticket, bytes), sent, take)?;
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
            batch.push_columns(compact, &params);
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
        batch.push_columns(&kernels.rollout, &params.over(step, count));
        step += count;
    }
}
