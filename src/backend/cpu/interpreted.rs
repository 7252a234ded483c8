//! Plants and policies that are known at run time only: their formulas as tapes.

use super::chained::{Chained, Pack};
use crate::formula::Graph;
use crate::model::Model;
use crate::real::simd::Instructions;
use crate::tile::{Clock, Frame, Layout, NativeFormula, NativeSystem, Source};

/// Where the inputs of a model's formulas are in a frame: its states and controls in their rows,
/// the parameters as numbers, the time as a multiple of the row of steps, or of periods where a period has parts.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    layout: Layout,
    sources: Vec<Source>,
}

/// What controls are for a formula that does not have any yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Held {
    /// Those in the rows.
    Rows,
    /// Zeros: margins and policies are of states alone.
    Zeros,
}

impl Inputs {
    /// For `model` with the values `parameters` of its parameters.
    pub(super) fn new(model: &Model, parameters: &[f32], controls: Held) -> Self {
        let (states, count) = (model.states.len(), model.controls.len());
        let layout = Layout { states, controls: count, own: 0 };
        let controls = (states..states + count).map(|row| match controls {
            Held::Rows => Source::Row(row),
            Held::Zeros => Source::Number(0.0),
        });
        let step = layout.step();
        let row = if model.points > 1 { layout.elapsed() } else { step };
        let time = match model.period {
            Some(period) => Source::Multiple { row, of: period },
            None => Source::Number(0.0),
        };
        let sources = (0..states)
            .map(Source::Row)
            .chain(controls)
            .chain(parameters.iter().copied().map(Source::Number))
            .chain([time, Source::Row(step)])
            .collect();
        Self { layout, sources }
    }

    /// The same followed by the rows `rows`: what a network says.
    pub(super) fn followed_by(mut self, rows: std::ops::Range<usize>) -> Self {
        self.sources.extend(rows.map(Source::Row));
        self
    }

    /// `graph` as tapes, its outputs in `rows`; what lies between is in rows from `first_own` on,
    /// and `pack` packs the networks that it calls.
    pub(super) fn chained(
        &self,
        graph: &Graph,
        rows: &[usize],
        first_own: usize,
        pack: Pack<'_>,
    ) -> Chained {
        Chained::new(&[graph], &self.sources, rows, first_own, pack)
    }

    /// The row of the steps taken.
    pub(super) fn step(&self) -> usize {
        self.layout.step()
    }
}

/// A model's formulas as tapes.
#[derive(Debug)]
pub(super) struct InterpretedSystem {
    step: Chained,
    margins: Chained,
    layout: Layout,
}

impl InterpretedSystem {
    /// The formulas of `model` with the values `parameters` of its parameters; `pack` packs the networks
    /// that they call.
    pub(super) fn new(model: &Model, parameters: &[f32], pack: Pack<'_>) -> Self {
        let held = Inputs::new(model, parameters, Held::Rows);
        let free = Inputs::new(model, parameters, Held::Zeros);
        let layout = held.layout;
        let next: Vec<usize> = (0..layout.states).collect();
        let margins = [&model.target, &model.constraint];
        let own = layout.first_own();
        Self {
            step: Chained::new(&[&model.step], &held.sources, &next, own, pack),
            margins: Chained::new(&margins, &free.sources, &layout.margins(), own, pack),
            layout,
        }
    }

    /// How many rows of their own the formulas need, from the first one on.
    pub(super) fn own_rows(&self) -> usize {
        self.step.own_rows().max(self.margins.own_rows())
    }

    /// Whether they read the rows of steps and periods.
    pub(super) fn clock(&self) -> Clock {
        clock(&[&self.step, &self.margins], self.layout)
    }
}

impl NativeSystem for InterpretedSystem {
    fn step(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        self.step.evaluate(with, frame, lanes);
    }

    fn margins(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        self.margins.evaluate(with, frame, lanes);
    }

    fn widest(&self) -> Option<usize> {
        self.step.widest().max(self.margins.widest())
    }
}

/// A formula of a model's inputs as a tape.
#[derive(Debug)]
pub(super) struct InterpretedFormula {
    tape: Chained,
    layout: Layout,
}

impl InterpretedFormula {
    /// `graph` of `inputs`, its outputs in the rows from `to` on; what lies between is in rows from
    /// `first_own` on, and `pack` packs the networks that it calls.
    pub(super) fn new(
        graph: &Graph,
        inputs: &Inputs,
        to: usize,
        first_own: usize,
        pack: Pack<'_>,
    ) -> Self {
        let outputs: Vec<usize> = (to..to + graph.outputs.len()).collect();
        let tape = inputs.chained(graph, &outputs, first_own, pack);
        Self { tape, layout: inputs.layout }
    }

    /// How many rows of its own it needs, from the first one on.
    pub(super) fn own_rows(&self) -> usize {
        self.tape.own_rows()
    }

    /// Whether it reads the rows of steps and periods.
    pub(super) fn clock(&self) -> Clock {
        clock(&[&self.tape], self.layout)
    }
}

impl NativeFormula for InterpretedFormula {
    fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        self.tape.evaluate(with, frame, lanes);
    }

    fn widest(&self) -> Option<usize> {
        self.tape.widest()
    }
}

/// Whether one of `tapes` reads the row of steps or that of periods.
fn clock(tapes: &[&Chained], layout: Layout) -> Clock {
    let rows = [layout.step(), layout.elapsed()];
    let reads = |tape: &&Chained| rows.iter().any(|row| tape.reads(*row));
    if tapes.iter().any(reads) { Clock::Read } else { Clock::Ignored }
}
