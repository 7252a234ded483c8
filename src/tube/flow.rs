//! One step of a set of states: controls, and the states after them.

use super::affine::{Affine, Symbols};
use super::evaluate;
use super::state::Set;
use crate::model::{Law, Model, Moment, Plant};

/// The inputs of the formulas of `model`, over forms.
pub(super) fn arguments(model: &Model, x: &[Affine], u: &[Affine], at: Moment) -> Vec<Affine> {
    let number = |value: f32| Affine::constant(f64::from(value));
    let parameters = model.parameters.iter().map(|parameter| number(parameter.value));
    // Both factors are numbers of f32, so the product is exact.
    let time = f64::from(at.elapsed(model.points)) * f64::from(model.period.unwrap_or(0.0));
    let clock = [Affine::constant(time), Affine::constant(f64::from(at.step))];
    x.iter().chain(u).cloned().chain(parameters).chain(clock).collect()
}

/// The same at a state, where no formula reads a control.
pub(super) fn at_state(model: &Model, x: &[Affine], at: Moment) -> Vec<Affine> {
    arguments(model, x, &vec![Affine::constant(0.0); model.controls.len()], at)
}

/// The controls at the states of a set.
pub(super) fn control(
    plant: &Plant,
    x: &[Affine],
    step: u32,
    symbols: &mut Symbols,
) -> Vec<Affine> {
    let inputs = || at_state(&plant.model, x, step.into());
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

/// The states after those of `set` that are looked at, at the points of a period and at the next sample, up to
/// the last of which something is known; under the controls `u` that depend on the symbols of `set` and on those
/// up to `symbols`.
pub(super) fn period(
    model: &Model,
    set: &Set,
    u: &[Affine],
    step: u32,
    mut symbols: Symbols,
) -> Vec<Set> {
    let mut sets: Vec<Set> = Vec::with_capacity(model.points as usize);
    for point in 0..model.points {
        let x = sets.last().map_or(&set.forms, |set| &set.forms);
        let inputs = arguments(model, x, u, Moment { step, point });
        let forms = evaluate::outputs(&model.step, &inputs, &mut symbols);
        // The controls hold on to the symbols of the sample as long as the period lasts.
        let next = match point + 1 == model.points {
            true => Set::reduced(forms),
            false => Set { forms, symbols },
        };
        if !next.known() {
            break;
        }
        sets.push(next);
    }
    sets
}
