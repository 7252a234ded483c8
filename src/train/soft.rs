//! A system as tapes: its step, and the softened measures of a whole rollout.

use super::tape::Tape;
use crate::error::Result;
use crate::formula::{Expr, record};
use crate::real::Real;
use crate::rollout::{RolloutSpec, Tightening, reach_avoid};
use crate::system::System;

/// The step: states and controls `[NX + NU]` to the next states `[NX]`.
///
/// # Errors
/// As [`Tape::hard`].
pub fn step_tape<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> Result<Tape> {
    Tape::hard(&record(NX + NU, |inputs| {
        let x = std::array::from_fn(|i| inputs[i]);
        let u = std::array::from_fn(|i| inputs[NX + i]);
        system.step(x, u).to_vec()
    }))
}

/// The measures of a rollout: its states `[T + 1, NX]` to the softened G and, where the margins are
/// to lose something, the softened `V_check` (`docs/method.md`, sections 1 and 4).
///
/// Soft are the maximum and the minimum over time and the minima that the margins end in. At
/// temperature 0 they would be the measures that the engine computes.
///
/// # Errors
/// As [`Tape::hard`].
pub fn measure_tape<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    spec: &RolloutSpec,
    tightening: Option<&Tightening>,
) -> Result<Tape> {
    let steps = spec.horizon as usize + 1;
    Tape::soft(&record(NX * steps, |inputs| {
        let margins: Vec<(Expr, Expr)> = inputs
            .chunks_exact(NX)
            .map(|state| {
                let x: [Expr; NX] = std::array::from_fn(|i| state[i]);
                (system.target(x), system.constraint(x))
            })
            .collect();
        let gamma = Real::lit(spec.gamma);
        let mut measures = vec![reach_avoid(margins.iter().copied(), gamma)];
        measures.extend(tightening.map(|tightening| {
            let tightened = margins.iter().enumerate().map(|(t, &(target, constraint))| {
                let tightened = |margin, by: &[f32]| margin - Expr::lit(by[t]);
                (
                    tightened(target, &tightening.target),
                    tightened(constraint, &tightening.constraint),
                )
            });
            reach_avoid(tightened, gamma)
        }));
        measures
    }))
}
