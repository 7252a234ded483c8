//! Pairs on the device: both rollouts of each side by side, the farthest pair of each step.

use super::attempt::Attempt;
use super::batch::Batch;
use super::chain::ChainStep;
use super::chunking::{Chunking, Work};
use super::compose::Slot;
use super::job::{Job, Request, Subject};
use super::opened::Opened;
use super::params::Params;
use super::workspace::{Buffers, Kernels, MEASURES_AT, Workspace};
use crate::backend::PairSink;
use crate::error::Result;
use crate::rollout::{DeviationTask, Farthest, PairControl, PairMeasure};

/// See [`crate::backend::Program::deviation`]; the farthest pairs are merged into `farthest` chunk by
/// chunk, as the measures go to the sink.
pub(super) fn deviation(
    opened: &Opened,
    attempt: &Attempt,
    subject: Subject<'_>,
    task: &DeviationTask<'_>,
    farthest: &mut [Farthest],
    sink: PairSink<'_>,
) -> Result<()> {
    let count = task.range.end.saturating_sub(task.range.start);
    if count == 0 {
        return Ok(());
    }
    let (starts, spec, tightening) = (&task.pairs.nominal, &task.spec, task.tightening);
    let request = Request { work: Work::Pairs, starts, spec, tightening, count };
    let mut job = Job::new(opened, attempt, subject, request)?;
    let params = pair_params(task, job.chunking.stride);
    let mut first = task.range.start;
    while first < task.range.end {
        let columns = (task.range.end - first).min(u64::from(job.chunking.stride)) as u32;
        job.space.inputs.set_starts(starts, first, columns);
        let Rolled { measures, found } = roll(&mut job, params.at(first, columns))?;
        for (farthest, [bits, column]) in farthest.iter_mut().zip(found) {
            *farthest = farthest.merge(Farthest {
                distance: f32::from_bits(bits),
                pair: first + u64::from(column),
            });
        }
        sink(first, &measures)?;
        first += u64::from(columns);
    }
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
    measures: Vec<PairMeasure>,
    /// Bits of the largest distance of each step, and the column that attains it.
    found: Vec<[u32; 2]>,
}

/// Rolls out the pairs of `params`.
fn roll(job: &mut Job<'_>, params: Params) -> Result<Rolled> {
    let measures = 8 * u64::from(params.columns);
    let farthest = 8 * (u64::from(params.horizon) + 1);
    let Job { flight, chunking, space, .. } = job;
    let Workspace { inputs, readback, buffers, kernels, .. } = space;
    let kernels = &kernels[0];
    let mut batch = Batch::default();
    batch.push_columns(&kernels.sample, &params);
    let mut step = 0;
    while step <= params.horizon {
        let count = chunking.segment.min(params.horizon + 1 - step);
        segment(&mut batch, kernels, buffers, *chunking, params, step, count);
        step += count;
        inputs.write(&flight.device, &batch);
        let copy = |encoder: &mut _| {
            if step > params.horizon {
                let [first, second] = [MEASURES_AT, MEASURES_AT + measures];
                readback.copy(encoder, buffers.of(Slot::Measures), first, measures);
                readback.copy(encoder, buffers.of(Slot::Farthest), second, farthest);
            }
        };
        flight.submit(&batch, |_| {}, copy)?;
        batch = Batch::default();
    }
    readback.read(flight, MEASURES_AT + measures + farthest, |bytes| {
        let (measured, found) = bytes[MEASURES_AT as usize..].split_at(measures as usize);
        Rolled {
            measures: bytemuck::pod_collect_to_vec(measured),
            found: bytemuck::pod_collect_to_vec(found),
        }
    })
}

/// Adds the dispatches of `count` steps from `first` on, and the reduction of their distances.
fn segment<'a>(
    batch: &mut Batch<'a>,
    kernels: &'a Kernels,
    buffers: &Buffers,
    chunking: Chunking,
    params: Params,
    first: u32,
    count: u32,
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
        batch.push(reduce, &params.over(first, count), [count, 1]);
    }
}
