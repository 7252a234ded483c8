//! A model as tapes: its step, what a network sees of it, and the softened measures of a whole rollout.

use super::tape::Tape;
use crate::formula::{Expr, record};
use crate::model::{Interface, Model, Role};
use crate::real::Real;
use crate::rollout::{RolloutSpec, Tightening, measure_as};

/// The step: states, outputs of the network behind `interface` and the number of the step to the next
/// states.
pub fn step_tape(model: &Model, interface: &Interface) -> Tape {
    let (states, outputs) = (model.states.len(), interface.outputs);
    Tape::hard(&record(states + outputs + 1, |inputs| {
        let (x, rest) = inputs.split_at(states);
        let (out, step) = rest.split_at(outputs);
        match &interface.act {
            None => model.step.recorded_at(&model.arguments_at(x, out, step[0])),
            Some(act) => {
                let u = act.recorded_at(&[at_state(model, x, step[0]), out.to_vec()].concat());
                model.step.recorded_at(&model.arguments_at(x, &u, step[0]))
            }
        }
    }))
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
    model.arguments_at(x, &vec![Real::lit(0.0); model.controls.len()], step)
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

/// The measures of a rollout: its states `[T + 1, states]` to the softened G and, where the margins are
/// to lose something, the softened `V_check` (`docs/method.md`, sections 1 and 4); where a unit is given, the
/// mean over the steps of `tanh(margin / unit)` of what has to hold at each.
///
/// Soft are the maximum and the minimum over time and the minima that the margins end in. At
/// temperature 0 they would be the measures that the engine computes.
pub fn measure_tape(model: &Model, measured: Measured<'_>) -> Tape {
    let (states, Measured { spec, tightening, unit }) = (model.states.len(), measured);
    Tape::soft(&record(states * (spec.horizon as usize + 1), |inputs| {
        let margins: Vec<(Expr, Expr)> = (0..)
            .zip(inputs.chunks_exact(states))
            .map(|(step, x)| (model.target_at(x, step), model.constraint_at(x, step)))
            .collect();
        let gamma = Real::lit(spec.gamma);
        let roles = || model.task.roles(spec.horizon);
        let mut measures = vec![measure_as(roles(), margins.iter().copied(), gamma)];
        measures.extend(tightening.map(|tightening| {
            let tightened = margins.iter().enumerate().map(|(t, &(target, constraint))| {
                let tightened = |margin, by: &[f32]| margin - Expr::lit(by[t]);
                (
                    tightened(target, &tightening.target),
                    tightened(constraint, &tightening.constraint),
                )
            });
            measure_as(roles(), tightened, gamma)
        }));
        measures.extend(unit.map(|unit| stepwise(&model.task.roles(spec.horizon), &margins, unit)));
        measures
    }))
}

/// The mean over the steps of `tanh(margin / unit)` of the margins that have to hold there; 0 without any.
fn stepwise(roles: &[Role], margins: &[(Expr, Expr)], unit: f32) -> Expr {
    let squashed = |margin: Expr| (margin * Expr::lit(1.0 / unit)).tanh();
    let held = roles.iter().zip(margins).flat_map(|(role, &(target, constraint))| {
        let constraint = role.has(Role::CONSTRAINT).then_some(constraint);
        [constraint, role.has(Role::REQUIREMENT).then_some(target)]
    });
    let held: Vec<Expr> = held.flatten().map(squashed).collect();
    let count = held.len().max(1) as f32;
    held.into_iter().fold(Expr::lit(0.0), |sum, term| sum + term) * Expr::lit(1.0 / count)
}
