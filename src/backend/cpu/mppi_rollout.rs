//! MPPI on the CPU: samples of one problem rolled out tile by tile, their costs added up.

use std::marker::PhantomData;
use std::ops::Range;

use super::dispatch::Unit;
use super::kernel::Kernel;
use super::mlp::{Evaluator, Packed};
use super::mppi_update::Softmin;
use super::tile::is_finite;
use crate::backend::softmin::Partial;
use crate::cost::{Cost, CostMap};
use crate::real::simd::Body;
use crate::real::{Lanes, Real, Vector, load_rows, store_rows};
use crate::rollout::{HUGE, MppiProblem, MppiSpec, MppiTask, Noise, Stream};
use crate::system::System;

/// Consecutive samples of a problem for one thread; twin: `shaders/mppi_rollout.wgsl`.
#[derive(Debug)]
pub(super) struct MppiRollout<'a, S, C, const NX: usize, const NU: usize, const NC: usize> {
    /// The system.
    pub(super) system: &'a S,
    /// The cost.
    pub(super) cost: &'a C,
    /// The task.
    pub(super) task: &'a MppiTask<'a, NX, NU, NC>,
    /// The value network and that of the disturbance, packed for the kernel.
    pub(super) networks: [Option<&'a Packed>; 2],
    /// Which problem.
    pub(super) problem: usize,
    /// Which samples.
    pub(super) samples: Range<u32>,
    /// Where their costs go, if they are wanted.
    pub(super) costs: Option<&'a mut [f32]>,
}

impl<S, C, const NX: usize, const NU: usize, const NC: usize> Unit
    for MppiRollout<'_, S, C, NX, NU, NC>
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    type Output = Partial<NU>;

    const DRAWS: bool = true;

    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Partial<NU> {
        let settings = self.task.spec.settings();
        let horizon = settings.horizon as usize;
        let mut softmin = Softmin::<N, NU>::new(horizon, settings.temperature);
        let count = (self.samples.end - self.samples.start) as usize;
        // Networks want wide tiles, plain rollouts stay in the registers of one group.
        let networked = self.networks.iter().any(Option::is_some);
        let width = if networked { count.next_multiple_of(N) } else { N };
        let mut tile = Tile::<K, N, NX, NU>::new(kernel, self.task.spec, self.networks, width);
        let Self { task, problem, samples, mut costs, .. } = self;
        let asked = (task, &task.problems[problem]);
        for first in samples.clone().step_by(width) {
            let live = width.min((samples.end - first) as usize);
            tile.draw(asked, first, live);
            tile.roll((self.system, self.cost), asked, live);
            for (group, (cost, controls)) in tile.groups(live).enumerate() {
                let at = first + (group * N) as u32;
                let live = N.min((samples.end - at) as usize);
                softmin.add(kernel, cost, controls, at, live);
                if let Some(costs) = &mut costs {
                    let out = &mut costs[(at - samples.start) as usize..][..live];
                    write(cost, out);
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
struct Tile<'a, K, const N: usize, const NX: usize, const NU: usize> {
    kernel: K,
    horizon: usize,
    /// Value network, disturbance network.
    networks: [Option<Evaluator<'a, K>>; 2],
    normals: Vec<Lanes<N>>,
    /// Noise, then controls, `[groups, H]`.
    controls: Vec<[Lanes<N>; NU]>,
    states: Vec<[Lanes<N>; NX]>,
    costs: Vec<Lanes<N>>,
    values: Vec<[Lanes<N>; 1]>,
    pushes: Vec<[Lanes<N>; NX]>,
}

impl<'a, K: Kernel, const N: usize, const NX: usize, const NU: usize> Tile<'a, K, N, NX, NU> {
    /// Room for `width` samples.
    fn new(
        kernel: K,
        spec: &MppiSpec<NU>,
        networks: [Option<&'a Packed>; 2],
        width: usize,
    ) -> Self {
        let groups = width.div_ceil(N);
        let horizon = spec.settings().horizon as usize;
        let zero = Lanes([0.0; N]);
        let evaluator = |network: Option<&'a Packed>| {
            network.map(|network| Evaluator::new(network, kernel, width))
        };
        Self {
            kernel,
            horizon,
            networks: networks.map(evaluator),
            normals: vec![zero; spec.noise().room()],
            controls: vec![[zero; NU]; groups * horizon],
            states: vec![[zero; NX]; groups],
            costs: vec![zero; groups],
            values: vec![[zero]; groups],
            pushes: vec![[zero; NX]; groups],
        }
    }

    /// Draws the noise of the samples `first..first + live`.
    fn draw<const NC: usize>(
        &mut self,
        (task, problem): (&MppiTask<'_, NX, NU, NC>, &MppiProblem<NX, NU, NC>),
        first: u32,
        live: usize,
    ) {
        let groups = self.controls.chunks_mut(self.horizon).take(live.div_ceil(N));
        for (group, controls) in groups.enumerate() {
            self.kernel.call(Draw::<K, N, NU> {
                kernel: PhantomData,
                noise: task.spec.noise(),
                source: (problem.stream, task.iteration),
                first: first + (group * N) as u32,
                normals: &mut self.normals,
                out: controls,
            });
        }
    }

    /// Rolls the first `live` samples out and adds up their costs.
    fn roll<S, C, const NC: usize>(
        &mut self,
        (system, cost): (&S, &C),
        (task, problem): (&MppiTask<'_, NX, NU, NC>, &MppiProblem<NX, NU, NC>),
        live: usize,
    ) where
        S: System<NX, NU>,
        C: Cost<NX, NU, NC>,
    {
        let groups = live.div_ceil(N);
        self.states[..groups].fill(problem.start.map(Lanes::lit));
        self.costs[..groups].fill(Lanes([0.0; N]));
        let networked = self.networks.iter().any(Option::is_some);
        let stride = if networked { 1 } else { self.horizon };
        for t in (0..self.horizon).step_by(stride) {
            self.evaluate(task, live);
            for group in 0..groups {
                self.kernel.call(Advance::<K, S, C, N, NX, NU, NC> {
                    kernel: PhantomData,
                    system,
                    cost,
                    spec: task.spec,
                    problem,
                    steps: t..t + stride,
                    x: &mut self.states[group],
                    total: &mut self.costs[group],
                    controls: &mut self.controls[group * self.horizon..][..self.horizon],
                });
                self.kernel.call(Networks {
                    task,
                    value: &self.values[group][0],
                    push: &self.pushes[group],
                    x: &mut self.states[group],
                    total: &mut self.costs[group],
                });
            }
        }
    }

    /// Evaluates the networks at the states.
    fn evaluate<const NC: usize>(&mut self, task: &MppiTask<'_, NX, NU, NC>, live: usize) {
        let [value, disturbance] = &mut self.networks;
        if let Some(value) = value {
            value.forward_some(&self.states, live, &mut self.values, 1);
        }
        if let (Some(disturbance), Some(asked)) = (disturbance, &task.disturbance) {
            let outputs = asked.entries.len();
            disturbance.forward_some(&self.states, live, &mut self.pushes, outputs);
        }
    }

    /// Cost and controls of the first `live` samples, group by group.
    fn groups(&self, live: usize) -> impl Iterator<Item = (&Lanes<N>, &[[Lanes<N>; NU]])> {
        self.costs.iter().zip(self.controls.chunks(self.horizon)).take(live.div_ceil(N))
    }
}

/// The noise of a group.
struct Draw<'a, K, const N: usize, const NU: usize> {
    kernel: PhantomData<K>,
    noise: &'a Noise<NU>,
    source: (Stream, u32),
    first: u32,
    normals: &'a mut [Lanes<N>],
    out: &'a mut [[Lanes<N>; NU]],
}

impl<K: Kernel, const N: usize, const NU: usize> Body for Draw<'_, K, N, NU> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.noise.fill::<K::Vector, N>(self.source, self.first, self.normals, self.out);
    }
}

/// Some steps of a group: noise becomes controls, states and costs move on.
struct Advance<'a, K, S, C, const N: usize, const NX: usize, const NU: usize, const NC: usize> {
    kernel: PhantomData<K>,
    system: &'a S,
    cost: &'a C,
    spec: &'a MppiSpec<NU>,
    problem: &'a MppiProblem<NX, NU, NC>,
    steps: Range<usize>,
    x: &'a mut [Lanes<N>; NX],
    total: &'a mut Lanes<N>,
    controls: &'a mut [[Lanes<N>; NU]],
}

impl<K, S, C, const N: usize, const NX: usize, const NU: usize, const NC: usize> Body
    for Advance<'_, K, S, C, N, NX, NU, NC>
where
    K: Kernel,
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for at in (0..N).step_by(K::Vector::WIDTH) {
            let mut x: [K::Vector; NX] = load_rows(self.x, at);
            let mut total = K::Vector::load(&self.total.0[at..]);
            for t in self.steps.clone() {
                let controls = &mut self.controls[t];
                let plan = lit(&self.problem.plan[t]);
                let u = bounded(load_rows(controls, at), &plan, &self.spec.settings().bounds);
                store_rows(u, controls, at);
                total = total + self.cost.stage(x, u, lit(&self.problem.context[t]));
                if let Some(penalty) = self.spec.penalty() {
                    total = total + noise_cost(penalty, &self.problem.plan[t], &u);
                }
                if let Some((map, place)) = self.cost.map(x) {
                    total = total + map_cost(map, place);
                }
                x = self.system.step(x, u);
            }
            store_rows(x, self.x, at);
            total.store(&mut self.total.0[at..]);
        }
    }
}

/// Numbers that are the same for all samples.
#[inline(always)]
fn lit<V: Vector, const R: usize>(numbers: &[f32; R]) -> [V; R] {
    let mut vectors = [V::lit(0.0); R];
    for (vector, number) in vectors.iter_mut().zip(numbers) {
        *vector = V::lit(*number);
    }
    vectors
}

/// The plan with noise, within its bounds.
#[inline(always)]
fn bounded<V: Vector, const NU: usize>(
    noise: [V; NU],
    plan: &[V; NU],
    bounds: &[[f32; 2]; NU],
) -> [V; NU] {
    let mut u = noise;
    for i in 0..NU {
        let [low, high] = bounds[i];
        u[i] = (plan[i] + noise[i]).clamp(V::lit(low), V::lit(high));
    }
    u
}

/// `lambda plan' Sigma^-1 (u - plan)`.
#[inline(always)]
fn noise_cost<V: Vector, const NU: usize>(
    penalty: &[[f32; NU]; NU],
    plan: &[f32; NU],
    u: &[V; NU],
) -> V {
    let mut cost = V::lit(0.0);
    for i in 0..NU {
        let mut row = 0.0;
        for j in 0..NU {
            row += penalty[j][i] * plan[j];
        }
        cost = cost + V::lit(row) * (u[i] - V::lit(plan[i]));
    }
    cost
}

/// 2^23: added to a whole number below it, it leaves that number in the mantissa. A conversion to
/// an integer takes more instructions, for the sake of numbers that no integer holds.
const WHOLE: f32 = 8_388_608.0;
/// The mantissa.
const WHOLE_MASK: u32 = 0x7f_ffff;

/// The costs of the cells at `place`; of NaN, whose mantissa is above any cell's number, that of the
/// last cell, one of the border.
#[inline(always)]
fn map_cost<V: Vector>(map: &CostMap, place: [V; 2]) -> V {
    let cells = map.cells();
    // Lets the compiler leave out the test of each index.
    assert!(!cells.is_empty(), "a map has cells");
    let number = map.cell(place) + V::lit(WHOLE);
    number.each(|number| cells[((number.to_bits() & WHOLE_MASK) as usize).min(cells.len() - 1)])
}

/// What the networks, evaluated at the state before the step, add to cost and state.
struct Networks<'a, const N: usize, const NX: usize, const NU: usize, const NC: usize> {
    task: &'a MppiTask<'a, NX, NU, NC>,
    value: &'a Lanes<N>,
    push: &'a [Lanes<N>; NX],
    x: &'a mut [Lanes<N>; NX],
    total: &'a mut Lanes<N>,
}

impl<const N: usize, const NX: usize, const NU: usize, const NC: usize> Body
    for Networks<'_, N, NX, NU, NC>
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        if let Some(term) = &self.task.value {
            let short = (Lanes::lit(term.threshold) - *self.value).max(Lanes::lit(0.0));
            *self.total = *self.total + Lanes::lit(term.weight) * (short * short);
        }
        if let Some(disturbance) = &self.task.disturbance {
            for ((state, scale), push) in disturbance.entries.iter().zip(self.push) {
                self.x[*state] = self.x[*state] + Lanes::lit(*scale) * *push;
            }
        }
    }
}
