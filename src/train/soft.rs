//! A model as tapes: its step, and the softened measures of a whole rollout.

use super::tape::Tape;
use crate::formula::{Expr, record};
use crate::model::{Model, Moment};
use crate::real::Real;
use crate::rollout::{Fold, RolloutSpec, Tightening};

/// The step: states, controls and the number of the step to the next states.
pub fn step_tape(model: &Model) -> Tape {
    moved(model, |x, u, step| model.next_at(x, u, step))
}

/// The parts of a step, in turn: states, controls and the number of the step to the states after the part.
pub fn part_tapes(model: &Model) -> Vec<Tape> {
    let part = |point| moved(model, |x, u, step| model.part_at(x, u, step, point));
    (0..model.points).map(part).collect()
}

/// What `of` makes of states, controls and the number of the step.
fn moved(model: &Model, of: impl Fn(&[Expr], &[Expr], Expr) -> Vec<Expr>) -> Tape {
    let (states, controls) = (model.states.len(), model.controls.len());
    Tape::hard(&record(states + controls + 1, |inputs| {
        let (x, rest) = inputs.split_at(states);
        let (u, step) = rest.split_at(controls);
        of(x, u, step[0])
    }))
}

/// The measures of a rollout: its states that are looked at, `[looks, states]`, to the softened G and, where the margins are
/// to lose something, the softened `V_check` (`docs/method.md`, sections 1 and 4).
///
/// Soft are the maximum and the minimum over time and the minima that the margins end in. At
/// temperature 0 they would be the measures that the engine computes.
pub fn measure_tape(model: &Model, spec: &RolloutSpec, tightening: Option<&Tightening>) -> Tape {
    let states = model.states.len();
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
