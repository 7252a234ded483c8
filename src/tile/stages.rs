//! The stages of sampled plans: noise becomes controls, costs add up, states move on.

use std::fmt;
use std::ops::Range;

use super::compiled::{Blocks, load, store};
use super::{Frame, GRANULE};
use crate::cost::{Cost, CostMap, Lookup};
use crate::real::Vector;
use crate::real::simd::{Formulas, Instructions};
use crate::system::System;

/// A system and a cost whose formulas are evaluated for the samples of a tile.
pub(crate) trait NativeStages: fmt::Debug + Send + Sync {
    /// Takes the samples through some stages.
    fn advance(&self, with: Instructions, stages: Stages<'_>);

    /// Adds what the end of a plan costs, where it does, to samples that all stages were charged to.
    fn end(&self, with: Instructions, stages: Stages<'_>);
}

/// Some stages of the samples of a tile.
#[derive(Debug)]
pub(crate) struct Stages<'a> {
    /// The states, and the cost so far in the row `total`.
    pub(crate) frame: &'a mut Frame,
    /// Number of that row.
    pub(crate) total: usize,
    /// Noise, then controls, `[groups, H, controls, group]`.
    pub(crate) controls: &'a mut [f32],
    /// Samples of a group, a multiple of a vector.
    pub(crate) group: usize,
    /// Samples that count; the others are computed along.
    pub(crate) lanes: usize,
    /// Which stages.
    pub(crate) steps: Range<usize>,
    /// Number of the step of a closed loop that the plan starts at.
    pub(crate) first_step: u32,
    /// The nominal plan, `[H, controls]`.
    pub(crate) plan: &'a [f32],
    /// What the cost wants to know, `[H, contexts]`, with a row behind them where the end costs.
    pub(crate) context: &'a [f32],
    /// Bounds of each control.
    pub(crate) bounds: &'a [[f32; 2]],
    /// `lambda Sigma^-1` row by row, where noise costs.
    pub(crate) penalty: Option<&'a [f32]>,
}

/// A control of the plan with its noise, within its bounds.
#[inline(always)]
pub(crate) fn clipped<V: Vector>(plan: f32, noise: V, [low, high]: [f32; 2]) -> V {
    (V::lit(plan) + noise).clamp(V::lit(low), V::lit(high))
}

/// `lambda plan' Sigma^-1 (u - plan)`.
#[inline(always)]
pub(crate) fn noise_cost<V: Vector>(penalty: &[f32], plan: &[f32], u: impl Fn(usize) -> V) -> V {
    let mut cost = V::lit(0.0);
    for (i, nominal) in plan.iter().enumerate() {
        let mut row = 0.0;
        for (j, nominal) in plan.iter().enumerate() {
            row += penalty[j * plan.len() + i] * nominal;
        }
        cost = cost + V::lit(row) * (u(i) - V::lit(*nominal));
    }
    cost
}

/// 2^23: added to a whole number below it, it leaves that number in the mantissa. A conversion to
/// an integer takes more instructions, for the sake of numbers that no integer holds.
const WHOLE: f32 = 8_388_608.0;
/// The mantissa.
const WHOLE_MASK: u32 = 0x7f_ffff;

/// The costs of the cells of the numbers `cell`; of NaN, whose mantissa is above any cell's number,
/// that of the last cell, one of the border.
#[inline(always)]
pub(crate) fn cell_cost<V: Vector>(map: &CostMap, cell: V) -> V {
    let cells = map.cells();
    // Lets the compiler leave out the test of each index.
    assert!(!cells.is_empty(), "a map has cells");
    let number = cell + V::lit(WHOLE);
    number.each(|number| cells[((number.to_bits() & WHOLE_MASK) as usize).min(cells.len() - 1)])
}

/// A system and a cost as compiled.
pub(crate) struct CompiledStages<S, C, const NX: usize, const NU: usize, const NC: usize> {
    pub(crate) system: S,
    pub(crate) cost: C,
}

impl<S, C, const NX: usize, const NU: usize, const NC: usize> fmt::Debug
    for CompiledStages<S, C, NX, NU, NC>
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "compiled stages of {NX} states, {NU} controls and {NC} contexts")
    }
}

impl<S, C, const NX: usize, const NU: usize, const NC: usize> NativeStages
    for CompiledStages<S, C, NX, NU, NC>
where
    S: System<NX, NU> + Send,
    C: Cost<NX, NU, NC> + Send,
{
    fn advance(&self, with: Instructions, stages: Stages<'_>) {
        with.call(Advance { formulas: self, stages });
    }

    fn end(&self, with: Instructions, stages: Stages<'_>) {
        with.call(End { formulas: self, stages });
    }
}

/// The end of all samples.
struct End<'a, S, C, const NX: usize, const NU: usize, const NC: usize> {
    formulas: &'a CompiledStages<S, C, NX, NU, NC>,
    stages: Stages<'a>,
}

impl<S, C, const NX: usize, const NU: usize, const NC: usize> Formulas for End<'_, S, C, NX, NU, NC>
where
    C: Cost<NX, NU, NC>,
{
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Stages { frame, total, lanes, context, .. } = self.stages;
        let untold = untold(1);
        let Some(context) = told::<NC>(context, &untold).last() else { return };
        for at in (0..lanes).step_by(V::WIDTH) {
            let row = |row: usize| V::load(&frame.row(row)[at..]);
            let x: [V; NX] = std::array::from_fn(row);
            if let Some(cost) = self.formulas.cost.terminal(x, lit(context)) {
                (row(total) + cost).store(&mut frame.row_mut(total)[at..]);
            }
        }
    }
}

/// The stages of all samples, a vector of them at a time: the states stay in registers.
struct Advance<'a, S, C, const NX: usize, const NU: usize, const NC: usize> {
    formulas: &'a CompiledStages<S, C, NX, NU, NC>,
    stages: Stages<'a>,
}

impl<S, C, const NX: usize, const NU: usize, const NC: usize> Formulas
    for Advance<'_, S, C, NX, NU, NC>
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    #[inline(always)]
    fn run<V: Vector>(self) {
        // Samples of a group, known to the compiler: it leaves out all tests of indices.
        match self.stages.group {
            32 => self.groups::<V, 32>(),
            _ => self.groups::<V, 16>(),
        }
    }
}

impl<S, C, const NX: usize, const NU: usize, const NC: usize> Advance<'_, S, C, NX, NU, NC>
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    /// The stages of all samples in groups of `N`.
    #[inline(always)]
    fn groups<V: Vector, const N: usize>(self) {
        let CompiledStages { system, cost } = self.formulas;
        let Stages { frame, total, controls, group, lanes, steps, plan, context, .. } = self.stages;
        assert_eq!(group, N, "samples of a group");
        let (bounds, penalty) = (self.stages.bounds.as_chunks::<NU>().0, self.stages.penalty);
        let [bounds] = bounds else { unreachable!("bounds of each control") };
        let untold = untold(steps.end);
        let (plan, context) = (plan.as_chunks::<NU>().0, told(context, &untold));
        let (horizon, plan, context) = (plan.len(), &plan[steps.clone()], &context[steps.clone()]);
        let blocks = Blocks::new(frame, lanes.next_multiple_of(N));
        let (states, totals) = (blocks.rows::<NX>(0), blocks.rows::<1>(total));
        let rows = controls.as_chunks_mut::<N>().0.as_chunks_mut::<NU>().0;
        for (number, rows) in rows.chunks_mut(horizon).take(lanes.div_ceil(N)).enumerate() {
            for at in (0..N).step_by(V::WIDTH) {
                let (block, within) = ((number * N + at) / GRANULE, (number * N + at) % GRANULE);
                let mut x: [V; NX] = load(&states, block, within);
                let [mut total]: [V; 1] = load(&totals, block, within);
                let stages = rows[steps.clone()].iter_mut().zip(plan).zip(context);
                for ((row, nominal), stage) in stages {
                    let mut u = [V::lit(0.0); NU];
                    for i in 0..NU {
                        u[i] = clipped(nominal[i], V::load(&row[i][at..]), bounds[i]);
                        u[i].store(&mut row[i][at..]);
                    }
                    total = total + cost.stage(x, u, lit(stage));
                    if let Some(penalty) = penalty {
                        total = total + noise_cost(penalty, nominal, |i| u[i]);
                    }
                    if let Some(Lookup { map, place }) = cost.map(x) {
                        total = total + cell_cost(map, map.cell(place));
                    }
                    x = system.step(x, u);
                }
                store(x, &states, block, within);
                store([total], &totals, block, within);
            }
        }
    }
}

/// The contexts of `rows` stages of a cost that wants to know nothing; none of one that does.
fn untold<const NC: usize>(rows: usize) -> Vec<[f32; NC]> {
    if NC == 0 { vec![[0.0; NC]; rows] } else { Vec::new() }
}

/// The contexts, a row for each stage; `untold` of a cost that wants to know nothing.
fn told<'a, const NC: usize>(context: &'a [f32], untold: &'a [[f32; NC]]) -> &'a [[f32; NC]] {
    // Rows of no numbers cannot be cut from a list.
    if NC == 0 { untold } else { context.as_chunks().0 }
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
