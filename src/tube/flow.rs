//! One step of a set of states: controls, and the states after them.

use super::affine::{Affine, Symbols};
use super::evaluate;
use super::state::Set;
use crate::model::{Law, Model, Plant};

/// The inputs of the formulas of `model`, over forms.
pub(super) fn arguments(model: &Model, x: &[Affine], u: &[Affine], step: u32) -> Vec<Affine> {
    let number = |value: f32| Affine::constant(f64::from(value));
    let parameters = model.parameters.iter().map(|parameter| number(parameter.value));
    // A step is a whole number below 2^24, so the product is exact.
    let time = f64::from(step) * f64::from(model.period.unwrap_or(0.0));
    let clock = [Affine::constant(time), Affine::constant(f64::from(step))];
    x.iter().chain(u).cloned().chain(parameters).chain(clock).collect()
}

/// The same at a state, where no formula reads a control.
pub(super) fn at_state(model: &Model, x: &[Affine], step: u32) -> Vec<Affine> {
    arguments(model, x, &vec![Affine::constant(0.0); model.controls.len()], step)
}

/// The controls at the states of a set.
pub(super) fn control(
    plant: &Plant,
    x: &[Affine],
    step: u32,
    symbols: &mut Symbols,
) -> Vec<Affine> {
    let inputs = || at_state(&plant.model, x, step);
    match &plant.controller.law {
        Law::Formula(graph) => evaluate::outputs(graph, &inputs(), symbols),
        Law::Network { observe, network, act } => {
            let seen = match observe {
                Some(observe) => evaluate::outputs(observe, &inputs(), symbols),
                None => x.to_vec(),
            };
            let said = evaluate::network(network, seen, symbols);
            match act {
                Some(act) => evaluate::outputs(act, &[inputs(), said].concat(), symbols),
                None => said,
            }
        }
    }
}

/// The states after those of `set`, under the controls `u` that depend on the symbols of `set` and on those
/// up to `symbols`.
pub(super) fn next(model: &Model, set: &Set, u: &[Affine], step: u32, mut symbols: Symbols) -> Set {
    let inputs = arguments(model, &set.forms, u, step);
    Set::reduced(evaluate::outputs(&model.step, &inputs, &mut symbols))
}
