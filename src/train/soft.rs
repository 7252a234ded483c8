//! A model as tapes: its step, what a network sees of it, and the softened measures of a whole rollout.

use super::tape::Tape;
use crate::formula::{Expr, record};
use crate::model::{Interface, Model, Moment, Role};
use crate::real::Real;
use crate::rollout::{Fold, RolloutSpec, Tightening};

/// The first part of a step, the whole where a period has one: states, outputs of the network behind
/// `interface` and the number of the step to the states after it.
pub fn step_tape(model: &Model, interface: &Interface) -> Tape {
    let (states, outputs) = (model.states.len(), interface.outputs);
    Tape::hard(&record(states + outputs + 1, |inputs| {
        let (x, rest) = inputs.split_at(states);
        let (out, step) = rest.split_at(outputs);
        let u = acted(model, interface, [x, out], step[0]);
        model.step.recorded_at(&model.part_inputs(x, &u, step[0], 0))
    }))
}

/// The parts of a step behind the first, in turn: states, those at the sample before, outputs of the network
/// there and the number of the step to the states after the part.
pub fn further_tapes(model: &Model, interface: &Interface) -> Vec<Tape> {
    let (states, outputs) = (model.states.len(), interface.outputs);
    let part = |point| {
        Tape::hard(&record(2 * states + outputs + 1, |inputs| {
            let (x, rest) = inputs.split_at(states);
            let (sample, rest) = rest.split_at(states);
            let (out, step) = rest.split_at(outputs);
            let u = acted(model, interface, [sample, out], step[0]);
            model.step.recorded_at(&model.part_inputs(x, &u, step[0], point))
        }))
    };
    (1..model.points).map(part).collect()
}

/// The controls that the outputs `out` of the network behind `interface` are at the state `x`.
fn acted(model: &Model, interface: &Interface, [x, out]: [&[Expr]; 2], step: Expr) -> Vec<Expr> {
    match &interface.act {
        None => out.to_vec(),
        Some(act) => act.recorded_at(&[at_state(model, x, step), out.to_vec()].concat()),
    }
}

/// What the network behind `interface` sees: states and the number of the step to its inputs; none where
/// it sees the states.
pub fn observe_tape(model: &Model, interface: &Interface) -> Option<Tape> {
    let states = model.states.len();
    interface.observe.as_ref().map(|observe| {
        Tape::hard(&record(states + 1, |inputs| {
            let (x, step) = inputs.split_at(states);
            observe.recorded_at(&at_state(model, x, step[0]))
        }))
    })
}

/// The inputs of the formulas at a state, where no formula reads a control.
fn at_state(model: &Model, x: &[Expr], step: Expr) -> Vec<Expr> {
    model.arguments_at(x, &vec![Real::lit(0.0); model.controls.len()], [step; 2])
}

/// What a measure is read from.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// Length and discount of a rollout.
    pub spec: &'a RolloutSpec,
    /// What the margins lose in `V_check`; without it there is none.
    pub tightening: Option<&'a Tightening>,
    /// The margin that counts as one in the mean over the steps; without it there is none.
    pub unit: Option<f32>,
}

/// The measures of a rollout: its states that are looked at, `[looks, states]`, to the softened G and, where
/// the margins are to lose something, the softened `V_check` (`docs/method.md`, sections 1 and 4); where a unit is given, the
/// mean over these states of `tanh(margin / unit)` of what has to hold at each.
///
/// Soft are the maximum and the minimum over time and the minima that the margins end in. At
/// temperature 0 they would be the measures that the engine computes.
pub fn measure_tape(model: &Model, measured: Measured<'_>) -> Tape {
    let (states, Measured { spec, tightening, unit }) = (model.states.len(), measured);
    Tape::soft(&record(states * model.looks(spec.horizon), |inputs| {
        let margins: Vec<(Moment, [Expr; 2])> = inputs
            .chunks_exact(states)
            .enumerate()
            .map(|(look, x)| (model.moment(look), x))
            .map(|(at, x)| (at, [model.target_at(x, at), model.constraint_at(x, at)]))
            .collect();
        let mut measures = vec![measure(model, spec, margins.iter().copied())];
        measures.extend(tightening.map(|tightening| {
            let tightened = margins.iter().map(|&(at, [target, constraint])| {
                let by = |losses: &[f32]| Expr::lit(losses[at.sample()]);
                let losses = [by(&tightening.target), by(&tightening.constraint)];
                (at, [target - losses[0], constraint - losses[1]])
            });
            measure(model, spec, tightened)
        }));
        measures.extend(unit.map(|unit| stepwise(model, spec, &margins, unit)));
        measures
    }))
}

/// The measure of margins of target and constraint, each with its place on the rollout.
fn measure(
    model: &Model,
    spec: &RolloutSpec,
    margins: impl Iterator<Item = (Moment, [Expr; 2])>,
) -> Expr {
    let (mut fold, mut step) = (Fold::new(), 0);
    for (at, [target, constraint]) in margins {
        if at.step > step {
            fold.advance(Real::lit(spec.gamma));
            step = at.step;
        }
        fold.look(model.task.role_at(at, spec.horizon), target, constraint);
    }
    fold.measure()
}

/// The mean over the states of `tanh(margin / unit)` of the margins that have to hold there; 0 without any.
fn stepwise(model: &Model, spec: &RolloutSpec, margins: &[(Moment, [Expr; 2])], unit: f32) -> Expr {
    let squashed = |margin: Expr| (margin * Expr::lit(1.0 / unit)).tanh();
    let held = margins.iter().flat_map(|&(at, [target, constraint])| {
        let role = model.task.role_at(at, spec.horizon);
        let constraint = role.has(Role::CONSTRAINT).then_some(constraint);
        [constraint, role.has(Role::REQUIREMENT).then_some(target)]
    });
    let held: Vec<Expr> = held.flatten().map(squashed).collect();
    let count = held.len().max(1) as f32;
    held.into_iter().fold(Expr::lit(0.0), |sum, term| sum + term) * Expr::lit(1.0 / count)
}
