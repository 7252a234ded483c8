//! MPPI on the CPU: samples of one problem rolled out tile by tile, their costs added up.

use std::marker::PhantomData;
use std::ops::Range;

use super::dispatch::Unit;
use super::kernel::Kernel;
use super::mlp::Evaluator;
use super::mppi_update::Softmin;
use super::planning::PreparedPlanning;
use super::tile::is_finite;
use crate::real::simd::{Body, Formulas, Instructions};
use crate::real::{Lanes, Vector};
use crate::rollout::{Disturbance, HUGE, MppiProblem, Noise, Partial, Stream, ValueTerm};
use crate::tile::{Aligned, Frame, Stages};

/// Consecutive samples of a problem for one thread; twin: `shaders/mppi_rollout.wgsl`.
#[derive(Debug)]
pub(super) struct MppiRollout<'a> {
    /// What is planned for.
    pub(super) prepared: &'a PreparedPlanning,
    /// The instructions of the formulas.
    pub(super) with: Instructions,
    /// The problem.
    pub(super) problem: &'a MppiProblem,
    /// Number of the iteration.
    pub(super) iteration: u32,
    /// Which samples.
    pub(super) samples: Range<u32>,
    /// Where their costs go, if they are wanted.
    pub(super) costs: Option<&'a mut [f32]>,
}

impl Unit for MppiRollout<'_> {
    type Output = Partial;

    const DRAWS: bool = true;

    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Partial {
        let Self { prepared, with, problem, iteration, samples, mut costs } = self;
        let spec = &prepared.planning.spec;
        let length = spec.horizon() * spec.controls();
        let mut softmin = Softmin::<N>::new(length, spec.settings().temperature);
        let count = (samples.end - samples.start) as usize;
        // Networks and tapes want wide tiles, plain rollouts stay in the registers of one group.
        let width = if prepared.by_the_step() { count.next_multiple_of(N) } else { N };
        let mut tile = Tile::<K, N>::new(kernel, with, prepared, width);
        for first in samples.clone().step_by(width) {
            let live = width.min((samples.end - first) as usize);
            tile.draw(problem, iteration, first, live);
            tile.roll(problem, live);
            for group in 0..live.div_ceil(N) {
                let at = first + (group * N) as u32;
                let live = N.min((samples.end - at) as usize);
                let (cost, controls) = tile.group(group);
                softmin.add(kernel, &cost, controls, at, live);
                if let Some(costs) = &mut costs {
                    let out = &mut costs[(at - samples.start) as usize..][..live];
                    write(&cost, out);
                }
            }
        }
        softmin.finish()
    }
}

/// The costs of a group, infinite where they are not finite.
fn write<const N: usize>(cost: &Lanes<N>, out: &mut [f32]) {
    for (out, cost) in out.iter_mut().zip(cost.0) {
        *out = if is_finite(cost) && cost < HUGE { cost } else { f32::INFINITY };
    }
}

/// Samples in lockstep, in groups of lanes.
struct Tile<'a, K, const N: usize> {
    kernel: K,
    with: Instructions,
    prepared: &'a PreparedPlanning,
    /// Value network, disturbance network.
    networks: [Option<Evaluator<'a, K>>; 2],
    normals: Vec<Lanes<N>>,
    /// Noise, then controls, `[groups, H, controls, N]`.
    controls: Aligned,
    /// States and costs.
    frame: Frame,
}

impl<'a, K: Kernel, const N: usize> Tile<'a, K, N> {
    /// Room for `width` samples.
    fn new(kernel: K, with: Instructions, prepared: &'a PreparedPlanning, width: usize) -> Self {
        let spec = &prepared.planning.spec;
        let zero = Lanes([0.0; N]);
        let networks = prepared
            .networks
            .each_ref()
            .map(|network| network.as_ref().map(|network| Evaluator::new(network, kernel, width)));
        Self {
            kernel,
            with,
            prepared,
            networks,
            normals: vec![zero; spec.noise().room()],
            controls: Aligned::zeros(width * spec.horizon() * spec.controls()),
            frame: Frame::new(prepared.layout, width),
        }
    }

    /// Controls of a sample.
    fn length(&self) -> usize {
        self.prepared.planning.spec.horizon() * self.prepared.planning.spec.controls()
    }

    /// Draws the noise of the samples `first..first + live`.
    fn draw(&mut self, problem: &MppiProblem, iteration: u32, first: u32, live: usize) {
        let length = self.length();
        let (controls, _) = self.controls.all_mut().as_chunks_mut::<N>();
        for (group, out) in controls.chunks_mut(length).take(live.div_ceil(N)).enumerate() {
            self.kernel.call(Draw::<K, N> {
                kernel: PhantomData,
                noise: self.prepared.planning.spec.noise(),
                stream: problem.stream,
                iteration,
                first: first + (group * N) as u32,
                normals: &mut self.normals,
                out,
            });
        }
    }

    /// Rolls the first `live` samples out and adds up their costs.
    fn roll(&mut self, problem: &MppiProblem, live: usize) {
        for (row, number) in self.frame.states().zip(&problem.start) {
            self.frame.row_mut(row).fill(*number);
        }
        self.frame.row_mut(self.prepared.total).fill(0.0);
        let horizon = self.prepared.planning.spec.horizon();
        let networked = self.networks.iter().any(Option::is_some);
        let stride = if networked { 1 } else { horizon };
        for t in (0..horizon).step_by(stride) {
            self.evaluate(live);
            self.advance(problem, t..t + stride, live);
            if networked {
                self.with.call(Said { prepared: self.prepared, frame: &mut self.frame, live });
            }
        }
        if self.prepared.planning.cost.terminal.is_some() {
            let prepared = self.prepared;
            prepared.stages.end(self.with, self.stages(problem, horizon..horizon, live));
        }
    }

    /// Evaluates the networks at the states.
    fn evaluate(&mut self, live: usize) {
        let sinks = [self.prepared.value.clone(), self.prepared.pushes.clone()];
        for (network, sink) in self.networks.iter_mut().zip(sinks) {
            if let Some(network) = network {
                let states = self.frame.states();
                network.forward(&mut self.frame, [states, sink], live);
            }
        }
    }

    /// Takes the first `live` samples through the stages `steps`.
    fn advance(&mut self, problem: &MppiProblem, steps: Range<usize>, live: usize) {
        let prepared = self.prepared;
        prepared.stages.advance(self.with, self.stages(problem, steps, live));
    }

    /// The stages `steps` of the first `live` samples.
    fn stages<'b>(
        &'b mut self,
        problem: &'b MppiProblem,
        steps: Range<usize>,
        live: usize,
    ) -> Stages<'b> {
        let spec = &self.prepared.planning.spec;
        Stages {
            frame: &mut self.frame,
            total: self.prepared.total,
            controls: self.controls.all_mut(),
            group: N,
            lanes: live,
            steps,
            first_step: problem.first_step,
            plan: &problem.plan,
            context: &problem.context,
            bounds: &spec.settings().bounds,
            penalty: spec.penalty(),
        }
    }

    /// Costs and controls of a group.
    fn group(&self, group: usize) -> (Lanes<N>, &[[f32; N]]) {
        let length = self.length();
        let costs = &self.frame.row(self.prepared.total)[group * N..];
        let (controls, _) = self.controls.all().as_chunks::<N>();
        (Vector::load(costs), &controls[group * length..][..length])
    }
}

/// The noise of a group.
struct Draw<'a, K, const N: usize> {
    kernel: PhantomData<K>,
    noise: &'a Noise,
    stream: Stream,
    iteration: u32,
    first: u32,
    normals: &'a mut [Lanes<N>],
    out: &'a mut [[f32; N]],
}

impl<K: Kernel, const N: usize> Body for Draw<'_, K, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.noise.fill::<K::Vector, N>(
            self.stream,
            self.iteration,
            self.first,
            self.normals,
            self.out,
        );
    }
}

/// What the networks, evaluated at the state before the step, add to cost and state.
struct Said<'a> {
    prepared: &'a PreparedPlanning,
    frame: &'a mut Frame,
    live: usize,
}

impl Formulas for Said<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { prepared: PreparedPlanning { planning, total, value, pushes, .. }, .. } = self;
        let mut add = |row: usize, more: &dyn Fn(&Frame, usize) -> V| {
            for at in (0..self.live).step_by(V::WIDTH) {
                let sum = V::load(&self.frame.row(row)[at..]) + more(self.frame, at);
                sum.store(&mut self.frame.row_mut(row)[at..]);
            }
        };
        if let Some(ValueTerm { weight, threshold, .. }) = planning.value {
            add(*total, &|frame, at| {
                let short = V::lit(threshold) - V::load(&frame.row(value.start)[at..]);
                let short = short.max(V::lit(0.0));
                V::lit(weight) * (short * short)
            });
        }
        if let Some(Disturbance { entries, .. }) = &planning.disturbance {
            for ((state, scale), push) in entries.iter().zip(pushes.clone()) {
                add(*state, &|frame, at| V::lit(*scale) * V::load(&frame.row(push)[at..]));
            }
        }
    }
}
