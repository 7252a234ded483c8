//! MPPI on the device: noise drawn twice, once to roll it out and once to weigh it.

use std::ops::Range;

use super::attempt::Attempt;
use super::batch::Batch;
use super::buffer::Buffer;
use super::call::Call;
use super::compose::{Kernel, MppiText, PARTIAL_HEADER, Slot, map_of};
use super::kernel::Bound;
use super::mppi_network::Network;
use super::mppi_plan::{MppiPlan, Size};
use super::opened::Opened;
use super::params::Params;
use crate::backend::softmin::Partial;
use crate::cost::{Cost, CostMap};
use crate::error::Result;
use crate::policy::Mlp;
use crate::rollout::{
    CostQuery, HUGE, MppiProblem, MppiResult, MppiTask, Noise, NoiseShape, SPLINE_SUPPORT,
};
use crate::system::System;

/// Most dispatches of a submission.
const DISPATCHES: u64 = 1024;

/// See [`crate::backend::Backend::mppi`]; results go to `sink` chunk by chunk, in order.
pub(super) fn mppi<S, C, const NX: usize, const NU: usize, const NC: usize>(
    (opened, attempt): (&Opened, &Attempt),
    (system, cost): (&S, &C),
    task: &MppiTask<'_, NX, NU, NC>,
    sink: &mut dyn FnMut(Vec<MppiResult<NU>>),
) -> Result<()>
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    let settings = task.spec.settings();
    let cells = map_of(cost).map_or(&[][..], CostMap::cells);
    let networks =
        [task.value.map(|term| term.network), task.disturbance.map(|asked| asked.network)];
    let text = MppiText::new(system, cost, task);
    let size = Size {
        states: NX,
        controls: NU,
        contexts: NC,
        cells: cells.len(),
        horizon: settings.horizon,
        samples: settings.samples,
        problems: task.problems.len(),
        // A line of the text is an operation.
        flops: text.compose(Kernel::MppiRollout).lines().count() as u64,
        networks,
    };
    let plan = MppiPlan::new(&opened.device.adapter, attempt.limit, &size)?;
    attempt.columns.set(u64::from(plan.stride));
    let layers = networks.into_iter().flatten().map(|mlp| mlp.layers().len() as u64).sum::<u64>();
    let call = Call::new(opened, DISPATCHES + layers + 1);
    let buffers = Buffers::new(&call, &size, &plan, task.spec.noise());
    let kernels = buffers.bind(&call, &text)?;
    let chunks = Chunks { call: &call, plan, buffers: &buffers, kernels, task, cells };
    for problems in task.problems.chunks(plan.problems as usize) {
        sink(chunks.improve(problems)?);
    }
    Ok(())
}

/// The buffers of a call.
struct Buffers<'a> {
    streams: Buffer,
    starts: Buffer,
    plans: Buffer,
    contexts: Buffer,
    spline: Buffer,
    state: Buffer,
    totals: Buffer,
    carry: Buffer,
    partials: Buffer,
    /// Value network and disturbance network.
    networks: [Option<Network<'a>>; 2],
}

impl<'a> Buffers<'a> {
    fn new<const NU: usize>(
        call: &Call<'_>,
        size: &Size<'a>,
        plan: &MppiPlan,
        noise: &Noise<NU>,
    ) -> Self {
        let (problems, stride) = (u64::from(plan.problems), u64::from(plan.stride));
        let words = |words: usize| call.storage(4 * problems * words as u64);
        let horizon = size.horizon as usize;
        let rows = spline_words(noise.shape());
        let spline = call.storage(4 * rows.len() as u64);
        spline.write(call.device(), &rows);
        let colored = matches!(noise.shape(), NoiseShape::Colored { .. });
        let groups = problems * u64::from(groups(plan));
        let network = |mlp: Option<&'a Mlp>| mlp.map(|mlp| Network::new(call, mlp, plan.stride));
        Self {
            streams: words(4),
            starts: words(size.states),
            plans: words(horizon * size.controls),
            contexts: call
                .storage(4 * (size.cells as u64 + problems * (horizon * size.contexts) as u64)),
            spline,
            state: call.storage(16 * size.states.div_ceil(4) as u64 * stride),
            totals: call.storage(4 * stride),
            carry: call.storage(if colored { 4 * size.controls as u64 * stride } else { 4 }),
            partials: call.storage(4 * groups * partial_words(size.horizon, size.controls) as u64),
            networks: size.networks.map(network),
        }
    }

    /// The kernels on these buffers.
    fn bind(&self, call: &Call<'_>, text: &MppiText) -> Result<Kernels> {
        let [value, push] =
            self.networks.each_ref().map(|network| network.as_ref().map(Network::output));
        let buffer = |slot| match slot {
            Slot::Streams => &self.streams,
            Slot::Starts => &self.starts,
            Slot::Plans => &self.plans,
            Slot::Contexts => &self.contexts,
            Slot::Spline => &self.spline,
            Slot::State => &self.state,
            Slot::Carry => &self.carry,
            Slot::Partials => &self.partials,
            Slot::Value => value.unwrap_or(&self.totals),
            Slot::Push => push.unwrap_or(&self.totals),
            _ => &self.totals,
        };
        let bind = |kernel| call.bind(kernel, text.bindings(kernel), text.compose(kernel), buffer);
        let layers = |network: &Option<Network<'a>>| {
            network.as_ref().map_or(Ok(Vec::new()), |network| network.bind(call, &self.state))
        };
        let [value, push] = &self.networks;
        Ok(Kernels {
            start: bind(Kernel::MppiStart)?,
            rollout: bind(Kernel::MppiRollout)?,
            update: bind(Kernel::MppiUpdate)?,
            layers: [layers(value)?, layers(push)?],
        })
    }
}

/// The kernels bound to them.
struct Kernels {
    start: Bound,
    rollout: Bound,
    update: Bound,
    layers: [Vec<Bound>; 2],
}

/// Dispatches of one submission, and the steps of all of them.
#[derive(Default)]
struct Timed<'a> {
    dispatches: Batch<'a>,
    steps: u32,
}

/// What the chunks of a call share.
struct Chunks<'a, const NX: usize, const NU: usize, const NC: usize> {
    call: &'a Call<'a>,
    plan: MppiPlan,
    buffers: &'a Buffers<'a>,
    kernels: Kernels,
    task: &'a MppiTask<'a, NX, NU, NC>,
    /// The costs of the map's cells; none without a map.
    cells: &'a [f32],
}

impl<const NX: usize, const NU: usize, const NC: usize> Chunks<'_, NX, NU, NC> {
    /// The results of `problems`, as many as a chunk takes at most.
    fn improve(&self, problems: &[MppiProblem<NX, NU, NC>]) -> Result<Vec<MppiResult<NU>>> {
        let settings = self.task.spec.settings();
        self.upload(problems);
        let none = Partial::none(settings.horizon as usize);
        let mut merged = vec![(none, Vec::new()); problems.len()];
        let mut first = 0;
        while first < settings.samples {
            let end = settings.samples.min(first + self.plan.samples);
            self.run(problems.len() as u32, first..end)?;
            self.merge(&mut merged)?;
            if self.task.costs == CostQuery::Each {
                self.read_costs(&mut merged, end - first)?;
            }
            first = end;
        }
        let finished = merged.into_iter().zip(problems).map(|((partial, costs), problem)| {
            partial.finish(settings.samples, &problem.plan, &settings.bounds, costs)
        });
        Ok(finished.collect())
    }

    fn upload(&self, problems: &[MppiProblem<NX, NU, NC>]) {
        let stream = |problem: &MppiProblem<NX, NU, NC>| {
            let [low, high] = problem.stream.key();
            [low, high, problem.stream.id(), 0]
        };
        let streams: Vec<[u32; 4]> = problems.iter().map(stream).collect();
        let starts: Vec<f32> = problems.iter().flat_map(|problem| problem.start).collect();
        let plans = problems.iter().flat_map(|problem| problem.plan.iter().flatten());
        let plans: Vec<f32> = plans.copied().collect();
        let contexts = problems.iter().flat_map(|problem| problem.context.iter().flatten());
        let contexts: Vec<f32> = self.cells.iter().chain(contexts).copied().collect();
        let device = self.call.device();
        self.buffers.streams.write(device, &streams);
        self.buffers.starts.write(device, &starts);
        self.buffers.plans.write(device, &plans);
        self.buffers.contexts.write(device, &contexts);
    }

    /// Rolls out the samples `samples` of the first `problems` problems and weighs them.
    fn run(&self, problems: u32, samples: Range<u32>) -> Result<()> {
        let settings = self.task.spec.settings();
        let params = Params {
            first_low: samples.start,
            columns: problems * self.plan.width,
            stride: self.plan.stride,
            horizon: settings.horizon,
            iteration: self.task.iteration,
            samples: samples.end - samples.start,
            width: self.plan.width,
            rounds: self.plan.rounds,
            temperature: settings.temperature,
            ..Params::default()
        };
        let mut batch = Timed::default();
        batch.dispatches.push_columns(Kernel::MppiStart, &self.kernels.start, &params);
        for step in (0..settings.horizon).step_by(self.plan.rollout_steps as usize) {
            let steps = self.plan.rollout_steps.min(settings.horizon - step);
            self.make_room(&mut batch, steps)?;
            for (network, layers) in self.buffers.networks.iter().zip(&self.kernels.layers) {
                if let Some(network) = network {
                    let (columns, row) = (params.columns, params.stride);
                    network.forward(&mut batch.dispatches, layers, (columns, row));
                }
            }
            let (kernel, params) = (&self.kernels.rollout, params.over(step, steps));
            batch.dispatches.push_columns(Kernel::MppiRollout, kernel, &params);
        }
        for step in (0..settings.horizon).step_by(self.plan.update_steps as usize) {
            let steps = self.plan.update_steps.min(settings.horizon - step);
            self.make_room(&mut batch, steps)?;
            let groups = problems * groups(&self.plan);
            batch.dispatches.push(&self.kernels.update, &params.over(step, steps), [groups, 1]);
        }
        self.call.submit(&batch.dispatches)
    }

    /// Submits a batch that has no room for a dispatch of `steps` more steps.
    fn make_room<'a>(&'a self, batch: &mut Timed<'a>, steps: u32) -> Result<()> {
        let full = batch.steps > 0 && batch.steps + steps > self.plan.timely_steps;
        if full || batch.dispatches.len() >= DISPATCHES {
            self.call.submit(&batch.dispatches)?;
            *batch = Timed::default();
        }
        batch.steps += steps;
        Ok(())
    }

    /// Adds the partials of a chunk, workgroup by workgroup.
    fn merge(&self, merged: &mut [(Partial<NU>, Vec<f32>)]) -> Result<()> {
        let settings = self.task.spec.settings();
        let words = partial_words(settings.horizon, NU);
        let groups = groups(&self.plan) as usize;
        let count = merged.len() * groups * words;
        let read: Vec<u32> = self.buffers.partials.read(self.call.device(), count)?;
        for ((all, _), problem) in merged.iter_mut().zip(read.chunks(groups * words)) {
            for group in problem.chunks(words) {
                all.merge(&partial(group), settings.temperature);
            }
        }
        Ok(())
    }

    /// Appends the costs of the `samples` samples of a chunk to those of each problem.
    fn read_costs(&self, merged: &mut [(Partial<NU>, Vec<f32>)], samples: u32) -> Result<()> {
        let width = self.plan.width as usize;
        let count = merged.len() * width;
        let read: Vec<f32> = self.buffers.totals.read(self.call.device(), count)?;
        for ((_, costs), problem) in merged.iter_mut().zip(read.chunks(width)) {
            let counts = |cost: f32| cost.is_finite() && cost < HUGE;
            let cost = |&cost: &f32| if counts(cost) { cost } else { f32::INFINITY };
            costs.extend(problem[..samples as usize].iter().map(cost));
        }
        Ok(())
    }
}

/// Workgroups of the update for each problem of a chunk.
fn groups(plan: &MppiPlan) -> u32 {
    plan.width / (Kernel::MppiUpdate.workgroup() * plan.rounds)
}

/// Numbers of a partial.
fn partial_words(horizon: u32, controls: usize) -> usize {
    PARTIAL_HEADER as usize + horizon as usize * controls
}

/// A partial as the update writes it.
fn partial<const NU: usize>(words: &[u32]) -> Partial<NU> {
    let (header, controls) = words.split_at(PARTIAL_HEADER as usize);
    let number = |bits: u32| f64::from(f32::from_bits(bits));
    let weight = number(header[2]);
    let found = weight > 0.0;
    Partial {
        least: if found { f32::from_bits(header[0]) } else { f32::INFINITY },
        best: if found { header[1] } else { 0 },
        weight,
        squares: number(header[3]),
        cost: number(header[4]),
        non_finite: header[5],
        controls: controls.as_chunks::<NU>().0.iter().map(|u| u.map(number)).collect(),
    }
}

/// The rows of a spline as the shaders read them; one number where there is none.
fn spline_words(shape: &NoiseShape) -> Vec<u32> {
    let NoiseShape::Spline { rows, .. } = shape else {
        return vec![0];
    };
    let words = rows.iter().flat_map(|row| {
        let weights: [u32; SPLINE_SUPPORT] = row.weights.map(f32::to_bits);
        std::iter::once(row.first).chain(weights)
    });
    words.collect()
}
