//! Pairs on the device: both rollouts of each side by side, the farthest pair of each step.

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
use crate::backend::sink::{Asked, PairsSink};
use crate::error::Result;
use crate::model::Moment;
use crate::rollout::{DeviationTask, Farthest, PairControl, PairCounts, PairMeasure};

/// Bytes of the measures of a pair.
const PAIR_BYTES: u64 = 8;

/// What a call asks for, besides the farthest pair of each step.
#[derive(Clone, Copy)]
pub(super) struct Asking<'a> {
    pub(super) subject: Subject<'a>,
    pub(super) task: &'a DeviationTask<'a>,
    pub(super) asked: Asked,
}

/// What some pairs came to.
pub(super) enum CameTo {
    /// Both measures of each.
    Each(Vec<PairMeasure>),
    /// How they fared.
    Counts(PairCounts),
}

impl CameTo {
    /// How many pairs there are.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Each(pairs) => pairs.len(),
            Self::Counts(counts) => counts.pairs as usize,
        }
    }

    /// Gives it to `sink`, which asked for it; `first` is the index of the first pair.
    ///
    /// # Errors
    /// The sink's.
    pub(super) fn hand_to(&self, first: u64, sink: &mut PairsSink<'_>) -> Result<()> {
        match (self, sink) {
            (Self::Each(pairs), sink) => sink.take(first, pairs),
            (Self::Counts(counts), PairsSink::Counts(sink)) => sink(first, counts),
            (Self::Counts(_), PairsSink::Each(_)) => unreachable!("each was asked for"),
        }
    }
}

/// Receives what pairs came to, the first of which has the index given; in order.
type Sink<'a> = &'a mut dyn FnMut(u64, CameTo) -> Result<()>;

/// See [`crate::backend::Program::deviation`]; the farthest pairs are merged into `farthest` chunk by
/// chunk, as the results go to the sink.
pub(super) fn deviation(
    opened: &Opened,
    attempt: &Attempt,
    Asking { subject, task, asked }: Asking<'_>,
    farthest: &mut [Farthest],
    sink: Sink<'_>,
) -> Result<()> {
    let count = task.range.end.saturating_sub(task.range.start);
    if count == 0 {
        return Ok(());
    }
    let (starts, spec, tightening) = (&task.pairs.nominal, &task.spec, task.tightening);
    let request = Request { work: Work::Pairs, asked, starts, spec, tightening, count };
    let mut job = Job::new(opened, attempt, subject, request)?;
    let params = pair_params(task, job.chunking.stride);
    let rows = subject.source.text.rows();
    let mut delivery = Delivery { asked, rows, farthest, sink };
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(job.chunking.stride)) as u32;
        let list = job.list(starts, first, columns);
        let chunk = Chunk { params: params.at(first, columns), first, list: list.as_deref() };
        roll(&mut job, chunk, &mut delivery)?;
        first += u64::from(columns);
    }
    let last = job.space.results.last(&job.flight, |sent, bytes| rolled(asked, sent, bytes))?;
    last.map_or(Ok(()), |rolled| delivery.take(rolled))?;
    job.finish();
    Ok(())
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
        ..Params::of_starts(&task.pairs.nominal, &task.spec)
    }
}

/// What a chunk of pairs comes to.
struct Rolled {
    first: u64,
    came_to: CameTo,
    /// Bits of the largest distance of each step, and the column that attains it.
    found: Vec<[u32; 2]>,
}

/// Bytes of what `columns` pairs come to.
fn result_bytes(asked: Asked, columns: u32) -> u64 {
    match asked {
        Asked::Each => PAIR_BYTES * u64::from(columns),
        Asked::Counts => counting::pair_bytes(columns),
    }
}

/// What is read back: what was asked for, then the largest distances.
fn rolled(asked: Asked, Sent { first, columns, .. }: Sent, bytes: &[u8]) -> Rolled {
    let results = result_bytes(asked, columns) as usize;
    let (results, found) = bytes[MEASURES_AT as usize..].split_at(results);
    let came_to = match asked {
        Asked::Each => CameTo::Each(bytemuck::pod_collect_to_vec(results)),
        Asked::Counts => CameTo::Counts(counting::pairs(columns, results)),
    };
    Rolled { first, came_to, found: bytemuck::pod_collect_to_vec(found) }
}

/// Results in order of index.
struct Delivery<'a> {
    asked: Asked,
    /// Rows of distances for each step.
    rows: u32,
    farthest: &'a mut [Farthest],
    sink: Sink<'a>,
}

impl Delivery<'_> {
    /// Merges the farthest pairs of a chunk, and gives what it came to to the sink.
    fn take(&mut self, Rolled { first, came_to, found }: Rolled) -> Result<()> {
        for (row, [bits, column]) in (0..).zip(found) {
            // The second row of a step is that of the points behind it, which count at the next one.
            let step = Moment { step: row / self.rows, point: row % self.rows }.sample();
            let Some(farthest) = self.farthest.get_mut(step) else { continue };
            *farthest = farthest.merge(Farthest {
                distance: f32::from_bits(bits),
                pair: first + u64::from(column),
            });
        }
        (self.sink)(first, came_to)
    }
}

/// Sends the pairs of `chunk` off; takes over what the chunk before came to.
fn roll(job: &mut Job<'_>, chunk: Chunk<'_>, delivery: &mut Delivery<'_>) -> Result<()> {
    let Chunk { params, first, list } = chunk;
    let (asked, columns) = (delivery.asked, params.columns);
    let slot = if asked == Asked::Each { Slot::Measures } else { Slot::Counts };
    let bytes = result_bytes(asked, columns);
    let farthest = 8 * u64::from(delivery.rows) * (u64::from(params.horizon) + 1);
    let Job { flight, chunking, space, .. } = job;
    let Workspace { inputs, listed, results, buffers, kernels, .. } = space;
    let kernels = &kernels[0];
    let mut batch = Batch::default();
    batch.push_columns(&kernels.sample, &params);
    let mut step = 0;
    while step <= params.horizon {
        let count = chunking.segment.min(params.horizon + 1 - step);
        let span = Span { first: step, count, rows: delivery.rows };
        segment(&mut batch, kernels, buffers, *chunking, params, span);
        step += count;
        let ended = step > params.horizon;
        if let Some(count) = kernels.count.as_ref().filter(|_| ended) {
            batch.push(count, &params, [counting::groups(columns), 1]);
        }
        inputs.write(&flight.device, &batch);
        let copy = |encoder: &mut _| {
            if ended {
                let [first, second] = [MEASURES_AT, MEASURES_AT + bytes];
                results.free().copy(encoder, buffers.of(slot), first, bytes);
                results.free().copy(encoder, buffers.of(Slot::Farthest), second, farthest);
            }
        };
        let before = |encoder: &mut wgpu::CommandEncoder| {
            if let (Some(listed), Some(list)) = (&mut *listed, list) {
                listed.take(encoder, list);
            }
        };
        let ticket = flight.submit(&batch, before, copy)?;
        batch = Batch::default();
        if ended {
            let (sent, bytes) = (Sent { first, columns, ended }, MEASURES_AT + bytes + farthest);
            let take = |sent, bytes: &[u8]| rolled(asked, sent, bytes);
            let earlier = results.send(flight, (ticket, bytes), sent, take)?;
            earlier.map_or(Ok(()), |rolled| delivery.take(rolled))?;
        }
    }
    Ok(())
}

/// Steps that are reduced together.
#[derive(Clone, Copy)]
struct Span {
    first: u32,
    count: u32,
    /// Rows of distances for each.
    rows: u32,
}

/// Adds the dispatches of the steps of a span, and the reduction of their distances.
fn segment<'a>(
    batch: &mut Batch<'a>,
    kernels: &'a Kernels,
    buffers: &Buffers,
    chunking: Chunking,
    params: Params,
    Span { first, count, rows }: Span,
) {
    let params = Params { segment_start: first, ..params };
    let mut step = first;
    while step < first + count {
        let steps = chunking.steps.min(first + count - step);
        let (row, horizon) = (chunking.row, params.horizon);
        let acting = if params.closed_loop == 0 { chunking.stride } else { row };
        kernels.chain(batch, ChainStep { step, horizon, columns: row, row, acting });
        if step < params.horizon {
            // Perturbed states stand `stride` columns after the nominal ones.
            let columns = if params.closed_loop == 0 { params.columns } else { chunking.row };
            kernels.drive(batch, buffers, columns, chunking.row, step);
        }
        batch.push_columns(&kernels.rollout, &params.over(step, steps));
        step += steps;
    }
    if let Some(reduce) = &kernels.after {
        batch.push(reduce, &params.over(rows * first, rows * count), [rows * count, 1]);
    }
}
