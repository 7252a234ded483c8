//! Stages of plans whose model or cost is known at run time only: their formulas as tapes.

use std::ops::Range;
use std::sync::Arc;

use super::chained::{Chained, Pack};
use super::interpreted::{Held, Inputs};
use super::interpreted_cost::{CostRows, InterpretedCost};
use crate::cost::CostMap;
use crate::formula::Graph;
use crate::model::{Lookups, Model, StageCost};
use crate::real::Vector;
use crate::real::simd::{Formulas, Instructions};
use crate::tile::{Clock, NativeStages, Stages, cell_cost, clipped, noise_cost};

/// A model's step and the costs of its plans as tapes.
#[derive(Debug)]
pub(super) struct InterpretedStages {
    step: Chained,
    stage: InterpretedCost,
    terminal: Option<InterpretedCost>,
    cell: Option<(Arc<CostMap>, Chained)>,
    /// The rows of the contexts.
    contexts: Range<usize>,
    /// The row of a stage's cost, and that of the number of a cell.
    staged: usize,
    /// Whether a formula reads the row of steps.
    clock: Clock,
    /// Rows that they need, from the first one on.
    rows: usize,
}

impl InterpretedStages {
    /// The formulas of `model` and `cost`, whose rows begin at `first`; `pack` packs the networks that
    /// they call.
    pub(super) fn new(model: &Model, cost: &StageCost, first: usize, pack: Pack<'_>) -> Self {
        let values = model.values();
        let contexts = first..first + cost.contexts;
        let looked = contexts.end..contexts.end + most_lookups(cost);
        let (staged, own) = (looked.end, looked.end + 2);
        let held = || Inputs::new(model, &values, Held::Rows);
        let told = |controls| Inputs::new(model, &values, controls).followed_by(contexts.clone());
        let tape =
            |graph: &Graph, inputs: &Inputs, rows: &[usize]| inputs.chained(graph, rows, own, pack);
        let next: Vec<usize> = (0..model.states.len()).collect();
        let step = tape(&model.step, &held(), &next);
        let rows = CostRows { looked: looked.start, value: staged, own };
        let charged = |formula: &Graph, lookups: &Option<Lookups>, controls| {
            InterpretedCost::new(formula, lookups.as_ref(), &told(controls), rows, pack)
        };
        let stage = charged(&cost.stage, &cost.lookups, Held::Rows);
        let end = cost.terminal.as_ref();
        let terminal = end.map(|end| charged(&end.formula, &end.lookups, Held::Zeros));
        let cell = cost
            .map
            .as_ref()
            .map(|map| (Arc::clone(&map.map), tape(&map.cell, &held(), &[staged + 1])));
        let clock = Clock::Ignored;
        let formulas = Self { step, stage, terminal, cell, contexts, staged, clock, rows: 0 };
        let clock_row = held().step();
        let reads = formulas.tapes().any(|tape| tape.reads(clock_row));
        let clock = if reads { Clock::Read } else { Clock::Ignored };
        let most = formulas.tapes().map(Chained::own_rows).max().unwrap_or(0);
        Self { clock, rows: own + most - first, ..formulas }
    }

    /// All tapes.
    fn tapes(&self) -> impl Iterator<Item = &Chained> {
        let cell = self.cell.iter().map(|(_, tape)| tape);
        let costs = self.terminal.iter().chain([&self.stage]).flat_map(InterpretedCost::tapes);
        cell.chain(costs).chain([&self.step])
    }

    /// Tells the formulas the number of the step and the contexts of row `t`.
    fn tell(&self, stages: &mut Stages<'_>, t: usize) {
        if self.clock == Clock::Read {
            let step = stages.frame.step();
            stages.frame.row_mut(step).fill((stages.first_step + t as u32) as f32);
        }
        let context = &stages.context[t * self.contexts.len()..];
        for (row, number) in self.contexts.clone().zip(context) {
            stages.frame.row_mut(row).fill(*number);
        }
    }

    /// Rows that the formulas need, from the first one on.
    pub(super) fn rows(&self) -> usize {
        self.rows
    }
}

impl NativeStages for InterpretedStages {
    fn advance(&self, with: Instructions, mut stages: Stages<'_>) {
        for t in stages.steps.clone() {
            self.tell(&mut stages, t);
            with.call(Controls { stages: &mut stages, t });
            self.stage.evaluate(with, stages.frame, stages.lanes);
            if let Some((_, cell)) = &self.cell {
                cell.evaluate(with, stages.frame, stages.lanes);
            }
            with.call(Charge { formulas: self, stages: &mut stages, t });
            self.step.evaluate(with, stages.frame, stages.lanes);
        }
    }

    fn end(&self, with: Instructions, mut stages: Stages<'_>) {
        let Some(terminal) = &self.terminal else { return };
        let horizon = stages.plan.len() / stages.bounds.len();
        self.tell(&mut stages, horizon);
        terminal.charge(with, stages.frame, stages.total, stages.lanes);
    }
}

/// The most maps that a formula of `cost` asks.
fn most_lookups(cost: &StageCost) -> usize {
    let terminal = cost.terminal.as_ref().and_then(|terminal| terminal.lookups.as_ref());
    cost.lookups.iter().chain(terminal).map(|all| all.maps.len()).max().unwrap_or(0)
}

/// Noise becomes controls, in the rows of the frame and in place.
struct Controls<'a, 'b> {
    stages: &'a mut Stages<'b>,
    t: usize,
}

impl Formulas for Controls<'_, '_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { stages: Stages { frame, controls, group, lanes, plan, bounds, .. }, t } = self;
        let (group, count, first) = (*group, bounds.len(), frame.controls().start);
        let groups = controls.chunks_mut(plan.len() * group).take(lanes.div_ceil(group));
        for (number, rows) in groups.enumerate() {
            for (i, within) in bounds.iter().enumerate() {
                let row = &mut rows[(t * count + i) * group..][..group];
                let out = &mut frame.row_mut(first + i)[number * group..][..group];
                for at in (0..group).step_by(V::WIDTH) {
                    let u: V = clipped(plan[t * count + i], V::load(&row[at..]), *within);
                    u.store(&mut row[at..]);
                    u.store(&mut out[at..]);
                }
            }
        }
    }
}

/// Adds what a stage costs.
struct Charge<'a, 'b> {
    formulas: &'a InterpretedStages,
    stages: &'a mut Stages<'b>,
    t: usize,
}

impl Formulas for Charge<'_, '_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { formulas: InterpretedStages { staged, cell, .. }, stages, t } = self;
        let Stages { frame, total, lanes, plan, bounds, penalty, .. } = stages;
        let (count, first) = (bounds.len(), frame.controls().start);
        let nominal = &plan[t * count..][..count];
        for at in (0..*lanes).step_by(V::WIDTH) {
            let row = |row: usize| V::load(&frame.row(row)[at..]);
            let mut sum = row(*total) + row(*staged);
            if let Some(penalty) = penalty {
                sum = sum + noise_cost(penalty, nominal, |i| row(first + i));
            }
            if let Some((map, _)) = cell {
                sum = sum + cell_cost(map, row(staged + 1));
            }
            sum.store(&mut frame.row_mut(*total)[at..]);
        }
    }
}
