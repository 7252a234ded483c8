//! Rows of numbers as columns of lanes, and the formulas of a model over them: what plants are stepped
//! and judged with, many at a time.

use std::array::from_fn;

use super::backup::Margins;
use crate::formula::Graph;
use crate::model::Model;
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
        self.each(self.model.states.len(), controls, |x, u, step| self.model.next_at(x, u, step))
    }

    /// The margins of each state.
    pub fn margins(&self) -> Vec<Margins<f32>> {
        let of = |margin: &Graph| {
            self.each(1, &[], |x, u, step| {
                margin.eval(&self.model.arguments_at(x, u, [step, step]))
            })
        };
        let [targets, constraints] = [of(&self.model.target), of(&self.model.constraint)];
        let pairs = targets.into_iter().zip(constraints);
        pairs.map(|(target, constraint)| Margins { target, constraint }).collect()
    }

    /// The `outputs` numbers that `of` makes of the state, the controls and the step of each, row by row; a
    /// control that is not given is 0.
    fn each(
        &self,
        outputs: usize,
        controls: &[f32],
        of: impl Fn(&[Lanes<WIDTH>], &[Lanes<WIDTH>], Lanes<WIDTH>) -> Vec<Lanes<WIDTH>>,
    ) -> Vec<f32> {
        let states = self.states.size();
        let mut found = vec![0.0; self.states.len() * outputs];
        for (tile, found) in found.chunks_mut(WIDTH * outputs).enumerate() {
            let x = columns(self.states.numbers(), states, tile);
            let u = columns(controls, self.model.controls.len(), tile);
            let step = columns(self.steps, 1, tile);
            store(of(&x, &u, step[0]).into_iter(), found, outputs);
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
