//! Rows of numbers as columns of lanes, and the formulas of a model over them: what plants are stepped
//! and judged with, many at a time.

use std::array::from_fn;

use super::backup::Margins;
use crate::formula::Graph;
use crate::model::{Interface, Model};
use crate::real::Lanes;
use crate::rollout::States;

/// Rows side by side.
pub(super) const WIDTH: usize = 16;

/// States of a model, each at a step of its own.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The model.
    pub model: &'a Model,
    /// The states.
    pub states: States<'a>,
    /// The step of each; all at the first step if there are none.
    pub steps: &'a [f32],
}

impl<'a> Rows<'a> {
    /// Numbers that are states of `model`, at the first step.
    pub fn new(model: &'a Model, numbers: &'a [f32]) -> Self {
        Self { model, states: States::of(numbers, model.states.len()), steps: &[] }
    }

    /// The next states under `controls`, row by row like them.
    pub fn next(&self, controls: &[f32]) -> Vec<f32> {
        self.each(&self.model.sampled().step, controls, &[])
    }

    /// The next states by `step`, of the inputs of the model and the numbers of a disturbance, under
    /// `controls` and `disturbances`.
    pub fn disturbed(&self, step: &Graph, controls: &[f32], disturbances: &[f32]) -> Vec<f32> {
        self.each(step, controls, disturbances)
    }

    /// What the network behind `interface` sees of each.
    pub fn seen(&self, interface: &Interface) -> Vec<f32> {
        match &interface.observe {
            Some(observe) => self.each(observe, &[], &[]),
            None => self.states.numbers().to_vec(),
        }
    }

    /// The controls that the `outputs` of the network behind `interface` are.
    pub fn controls(&self, interface: &Interface, outputs: &[f32]) -> Vec<f32> {
        match &interface.act {
            Some(act) => self.each(act, &[], outputs),
            None => outputs.to_vec(),
        }
    }

    /// The margins of each state.
    pub fn margins(&self) -> Vec<Margins<f32>> {
        let [targets, constraints] =
            [&self.model.target, &self.model.constraint].map(|margin| self.each(margin, &[], &[]));
        let pairs = targets.into_iter().zip(constraints);
        pairs.map(|(target, constraint)| Margins { target, constraint }).collect()
    }

    /// What `graph` makes of each and of `more` numbers for each, row by row; a control that is not given
    /// is 0.
    fn each(&self, graph: &Graph, controls: &[f32], more: &[f32]) -> Vec<f32> {
        let beyond = graph.inputs - self.model.inputs();
        let (states, outputs) = (self.states.size(), graph.outputs.len());
        let mut found = vec![0.0; self.states.len() * outputs];
        for (tile, found) in found.chunks_mut(WIDTH * outputs).enumerate() {
            let x = columns(self.states.numbers(), states, tile);
            let u = columns(controls, self.model.controls.len(), tile);
            let step = columns(self.steps, 1, tile);
            let mut inputs = self.model.arguments_at(&x, &u, [step[0]; 2]);
            inputs.extend(columns(more, beyond, tile));
            store(graph.eval(&inputs).into_iter(), found, outputs);
        }
        found
    }
}

/// The rows of tile number `tile` of `[rows, count]` numbers as columns of lanes; lanes without a row
/// hold zeros.
pub(super) fn columns(numbers: &[f32], count: usize, tile: usize) -> Vec<Lanes<WIDTH>> {
    let first = tile * WIDTH * count;
    let number = |row: usize, i: usize| numbers.get(first + row * count + i).copied();
    (0..count).map(|i| Lanes(from_fn(|row| number(row, i).unwrap_or(0.0)))).collect()
}

/// Columns of lanes as rows of `count` numbers.
pub(super) fn store(lanes: impl Iterator<Item = Lanes<WIDTH>>, rows: &mut [f32], count: usize) {
    for (i, lanes) in lanes.enumerate() {
        for (row, value) in rows.chunks_exact_mut(count).zip(lanes.0) {
            row[i] = value;
        }
    }
}
