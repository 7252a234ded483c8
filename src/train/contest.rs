//! A model that a disturbance acts on at each step: bounded numbers that its formulas use, or pushes on its
//! states.

use std::sync::Arc;

use crate::formula::{Expr, Graph, Scalar, record};
use crate::model::Model;
use crate::policy::Mlp;
use crate::real::Real;

/// What a disturbance does at each step.
#[derive(Clone, Debug, PartialEq)]
pub struct Contest {
    /// The next state: of the inputs of the model, followed by the disturbance, a number from -1 to 1 each.
    pub step: Graph,
    /// Names of these numbers.
    pub names: Vec<String>,
}

impl Contest {
    /// `model` whose state is pushed after each step: `x + sum_j scale_j d_j` on the coordinates `entries`.
    pub fn pushing(model: &Model, entries: &[(usize, f32)]) -> Self {
        let none = Self { step: model.step.clone(), names: Vec::new() };
        none.and_pushing(model, entries)
    }

    /// The same with pushes on the coordinates `entries` after each step of `model`.
    #[must_use]
    pub fn and_pushing(self, model: &Model, entries: &[(usize, f32)]) -> Self {
        let inputs = model.inputs() + self.names.len();
        let step = record(inputs + entries.len(), |inputs_and_pushes| {
            let (inputs, pushes) = inputs_and_pushes.split_at(inputs);
            let mut x = self.step.recorded_at(inputs);
            pushed(&mut x, entries, pushes);
            x
        });
        let pushes = entries.iter().map(|(i, _)| format!("push_{}", model.states[*i].name));
        Self { step, names: self.names.into_iter().chain(pushes).collect() }
    }

    /// `model` under a disturbance that `network` decides from the state.
    ///
    /// # Panics
    /// If the network has not an input for each state and an output for each number of the disturbance.
    pub fn disturbed(&self, model: &Model, network: &Arc<Mlp>) -> Model {
        assert_eq!(network.widths().last(), Some(&self.names.len()), "outputs of the disturbance");
        let step = record(model.inputs(), |inputs| {
            let acts = Expr::call(network, &inputs[..model.states.len()]);
            self.step.recorded_at(&[inputs, &acts[..]].concat())
        });
        Model { step, native: None, ..model.clone() }
    }
}

/// `x` after the disturbance `d` has pushed it: `x + sum_j scale_j d_j` on the named coordinates.
pub fn pushed<R: Real>(x: &mut [R], entries: &[(usize, f32)], d: &[R]) {
    for (&(coordinate, scale), push) in entries.iter().zip(d) {
        x[coordinate] = x[coordinate] + R::lit(scale) * *push;
    }
}
