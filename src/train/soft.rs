//! A model as tapes: its step, and the softened measures of a whole rollout.

use super::tape::Tape;
use crate::formula::{Expr, record};
use crate::model::Model;
use crate::real::Real;
use crate::rollout::{RolloutSpec, Tightening, measure_as};

/// The step: states, controls and the number of the step to the next states.
pub fn step_tape(model: &Model) -> Tape {
    let (states, controls) = (model.states.len(), model.controls.len());
    Tape::hard(&record(states + controls + 1, |inputs| {
        let (x, rest) = inputs.split_at(states);
        let (u, step) = rest.split_at(controls);
        model.step.eval(&model.arguments_at(x, u, step[0]))
    }))
}

/// The measures of a rollout: its states `[T + 1, states]` to the softened G and, where the margins are
/// to lose something, the softened `V_check` (`docs/method.md`, sections 1 and 4).
///
/// Soft are the maximum and the minimum over time and the minima that the margins end in. At
/// temperature 0 they would be the measures that the engine computes.
pub fn measure_tape(model: &Model, spec: &RolloutSpec, tightening: Option<&Tightening>) -> Tape {
    let states = model.states.len();
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
        measures
    }))
}
