//! MPPI on the device: noise drawn twice, once to roll it out and once to weigh it.

use std::ops::Range;
use std::sync::Arc;

use super::attempt::Attempt;
use super::batch::Batch;
use super::compose::{Kernel, PARTIAL_HEADER, Slot};
use super::flight::{Flight, Ticket};
use super::mppi_chunking::{DISPATCHES, MppiChunking};
use super::mppi_source::PlanSource;
use super::mppi_workspace::{PlanShape, PlanWorkspace, SentPlans, groups, words};
use super::opened::Opened;
use super::params::Params;
use crate::error::Result;
use crate::rollout::{CostQuery, HUGE, MppiProblem, MppiTask, Partial, PlanTally};

/// See [`crate::backend::PlanProgram::tally`]; tallies go to `sink` chunk by chunk, in order.
pub(super) fn tally(
    opened: &Opened,
    attempt: &Attempt,
    source: &Arc<PlanSource>,
    task: &MppiTask<'_>,
    samples: Range<u32>,
    sink: &mut dyn FnMut(Vec<PlanTally>),
) -> Result<()> {
    if task.problems.is_empty() {
        return Ok(());
    }
    // Before the first buffer is made: what fails from here on is this call's.
    let flight = opened.flight();
    let program = opened.plan_program(&flight, source)?;
    // Few shapes for a number of problems that falls one by one.
    let problems = task.problems.len().next_power_of_two();
    let size = source.size(problems, samples.end - samples.start);
    let chunking = MppiChunking::new(&opened.device.adapter, attempt.limit, &size)?;
    // A block is not halved: what is left of the limit is.
    attempt.columns.set(u64::from(chunking.stride).min(attempt.limit.columns));
    let mut space = program.take(&flight, PlanShape { chunking, costs: task.costs })?;
    let mut delivery = Delivery { source, chunking, tallies: Vec::new(), sink };
    for problems in task.problems.chunks(chunking.problems as usize) {
        let chunk = Chunk { flight: &flight, source, task, problems };
        chunk.tally(&mut space, samples.clone(), &mut delivery)?;
    }
    let last = space.results.last(&flight, |sent, bytes| delivery.take(sent, bytes))?;
    debug_assert!(last.is_some(), "a call has results");
    program.keep(space);
    Ok(())
}

/// Tallies of the problems of a chunk, as far as their samples have come in.
struct Delivery<'a> {
    source: &'a PlanSource,
    chunking: MppiChunking,
    tallies: Vec<PlanTally>,
    sink: &'a mut dyn FnMut(Vec<PlanTally>),
}

/// Problems that are improved at a time.
struct Chunk<'a> {
    flight: &'a Flight<'a>,
    source: &'a PlanSource,
    task: &'a MppiTask<'a>,
    problems: &'a [MppiProblem],
}

/// Dispatches of one submission, and the steps of all of them.
#[derive(Default)]
struct Timed<'a> {
    dispatches: Batch<'a>,
    steps: u32,
}

impl Chunk<'_> {
    /// Sends the samples `samples` of each problem off; `delivery` takes what came before.
    fn tally(
        &self,
        space: &mut PlanWorkspace,
        samples: Range<u32>,
        delivery: &mut Delivery<'_>,
    ) -> Result<()> {
        let horizon = self.source.planning.spec.horizon();
        space.inputs.set(self.problems, horizon, self.source.planning.cost.rows(horizon));
        let most = space.shape.chunking.samples;
        for first in samples.clone().step_by(most as usize) {
            let end = samples.end.min(first + most);
            let ticket = self.run(space, first..end)?;
            let [partials, totals] = self.result_bytes(&space.shape.chunking, space.shape.costs);
            let sent = SentPlans {
                problems: self.problems.len(),
                samples: first..end,
                partials: partials as usize / size_of::<u32>(),
                ended: end == samples.end,
            };
            let take = |sent, bytes: &[u8]| delivery.take(sent, bytes);
            space.results.send(self.flight, (ticket, partials + totals), sent, take)?;
        }
        Ok(())
    }

    /// Rolls out the samples `samples` and weighs them.
    fn run(&self, space: &mut PlanWorkspace, samples: Range<u32>) -> Result<Ticket> {
        let (chunking, spec) = (space.shape.chunking, &self.source.planning.spec);
        let settings = spec.settings();
        let params = Params {
            first_low: samples.start,
            columns: self.problems.len() as u32 * chunking.width,
            stride: chunking.stride,
            horizon: settings.horizon,
            iteration: self.task.iteration,
            samples: samples.end - samples.start,
            width: chunking.width,
            rounds: chunking.rounds,
            temperature: settings.temperature,
            ..Params::default()
        };
        let PlanWorkspace { inputs, buffers, kernels, results, shape, .. } = space;
        let mut batch = Timed::default();
        batch.dispatches.push_columns(&kernels.start, &params);
        let mut room = |batch: &mut Timed<'_>, steps: u32| -> Result<()> {
            let full = batch.steps > 0 && batch.steps + steps > chunking.timely_steps;
            if full || batch.dispatches.len() >= DISPATCHES {
                inputs.0.write(&self.flight.device, &batch.dispatches);
                self.flight.submit(&batch.dispatches, |_| {}, |_| {})?;
                *batch = Timed::default();
            }
            batch.steps += steps;
            Ok(())
        };
        for step in (0..settings.horizon).step_by(chunking.rollout_steps as usize) {
            let steps = chunking.rollout_steps.min(settings.horizon - step);
            room(&mut batch, steps)?;
            for (layers, bound) in buffers.layers.iter().zip(&kernels.layers) {
                if let Some(layers) = layers {
                    let (columns, row) = (params.columns, params.stride);
                    layers.forward(&mut batch.dispatches, bound, columns, row);
                }
            }
            let params = params.over(step, steps);
            batch.dispatches.push_columns(&kernels.rollout, &params);
        }
        if let Some(terminal) = &kernels.terminal {
            room(&mut batch, 1)?;
            batch.dispatches.push_columns(terminal, &params);
        }
        for step in (0..settings.horizon).step_by(chunking.update_steps as usize) {
            let steps = chunking.update_steps.min(settings.horizon - step);
            room(&mut batch, steps)?;
            let groups = self.problems.len() as u32 * groups(&chunking);
            batch.dispatches.push(&kernels.update, &params.over(step, steps), [groups, 1]);
        }
        inputs.0.write(&self.flight.device, &batch.dispatches);
        let [partials, totals] = self.result_bytes(&chunking, shape.costs);
        self.flight.submit(
            &batch.dispatches,
            |_| {},
            |encoder| {
                results.free().copy(encoder, buffers.of(Slot::Partials), 0, partials);
                if totals > 0 {
                    results.free().copy(encoder, buffers.of(Slot::Totals), partials, totals);
                }
            },
        )
    }

    /// Bytes of the partials and of the costs of a chunk.
    fn result_bytes(&self, chunking: &MppiChunking, costs: CostQuery) -> [u64; 2] {
        let problems = self.problems.len() as u64;
        let partial = 4 * words(&self.source.planning.spec) as u64;
        let totals = match costs {
            CostQuery::Summary => 0,
            CostQuery::Each => 4 * problems * u64::from(chunking.width),
        };
        [problems * u64::from(groups(chunking)) * partial, totals]
    }
}

impl Delivery<'_> {
    /// Adds what the samples of `sent` came to, a block for each workgroup of the update; hands the
    /// tallies of a chunk on once all its samples are there.
    fn take(&mut self, sent: SentPlans, bytes: &[u8]) {
        let read = bytemuck::pod_collect_to_vec::<u8, u32>(bytes);
        let (partials, costs) = read.split_at(sent.partials);
        self.tallies.resize_with(sent.problems, PlanTally::default);
        let chunking = self.chunking;
        let words = words(&self.source.planning.spec);
        let covered = chunking.rounds * Kernel::MppiUpdate.workgroup();
        for (number, tally) in self.tallies.iter_mut().enumerate() {
            let mine =
                partials.chunks(groups(&chunking) as usize * words).nth(number).unwrap_or(&[]);
            let costs = costs.chunks(chunking.width as usize).nth(number).unwrap_or(&[]);
            for (group, first) in sent.samples.clone().step_by(covered as usize).enumerate() {
                let count = covered.min(sent.samples.end - first);
                let place = (first - sent.samples.start) as usize;
                let costs = costs.get(place..place + count as usize).unwrap_or(&[]);
                let costs = costs.iter().map(|bits| counted(f32::from_bits(*bits))).collect();
                tally.add(first, partial(count, &mine[group * words..][..words]), costs);
            }
        }
        if sent.ended {
            (self.sink)(std::mem::take(&mut self.tallies));
        }
    }
}

/// A cost, infinite where it is not finite.
fn counted(cost: f32) -> f32 {
    if cost.is_finite() && cost < HUGE { cost } else { f32::INFINITY }
}

/// A partial of `count` samples as the update writes it.
fn partial(count: u32, words: &[u32]) -> Partial {
    let (header, controls) = words.split_at(PARTIAL_HEADER as usize);
    let number = |bits: u32| f64::from(f32::from_bits(bits));
    let weight = number(header[2]);
    let found = weight > 0.0;
    Partial {
        count,
        least: if found { f32::from_bits(header[0]) } else { f32::INFINITY },
        best: if found { header[1] } else { 0 },
        weight,
        squares: number(header[3]),
        cost: number(header[4]),
        non_finite: header[5],
        controls: controls.iter().map(|bits| number(*bits)).collect(),
    }
}
