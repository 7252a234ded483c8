//! A model that a disturbance pushes at each step.

use std::sync::Arc;

use crate::formula::{Expr, Scalar, record};
use crate::model::Model;
use crate::policy::Mlp;
use crate::real::Real;

/// `x` after the disturbance `d` has pushed it: `x + sum_j scale_j d_j` on the named coordinates.
pub fn pushed<R: Real>(x: &mut [R], entries: &[(usize, f32)], d: &[R]) {
    for (&(coordinate, scale), push) in entries.iter().zip(d) {
        x[coordinate] = x[coordinate] + R::lit(scale) * *push;
    }
}

/// `model` under a disturbance that `network` decides from the state, pushed on the coordinates
/// `entries` after each step.
///
/// # Panics
/// If the network has not an input for each state and an output for each of `entries`.
pub fn disturbed(model: &Model, network: &Arc<Mlp>, entries: &[(usize, f32)]) -> Model {
    assert_eq!(network.widths().last(), Some(&entries.len()), "outputs of the disturbance");
    let model = &*model.sampled();
    let step = record(model.inputs(), |inputs| {
        let mut x = model.step.recorded_at(inputs);
        pushed(&mut x, entries, &Expr::call(network, &inputs[..model.states.len()]));
        x
    });
    Model { step, native: None, ..model.clone() }
}
