//! What policies are scored by: the engine's rollouts from held-out starts.

use crate::backend::Backend;
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{Plant, Query, ReachAvoidTask, RolloutSpec, Starts, Tightening};
use crate::system::System;

/// Whether the rollout from each of `starts` has G > 0.
///
/// # Errors
/// Those of the device.
pub fn successes<S, P, const NX: usize, const NU: usize>(
    backend: &Backend,
    plant: Plant<'_, S, P>,
    spec: RolloutSpec,
    starts: &[[f32; NX]],
) -> Result<Vec<bool>>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let task = ReachAvoidTask {
        starts: Starts::listed(starts),
        range: 0..starts.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Sign,
    };
    let mut successes = Vec::with_capacity(starts.len());
    backend.reach_avoid(plant, &task, &mut |_, signs| {
        successes.extend(signs.iter().map(|sign| *sign > 0.0));
        Ok(())
    })?;
    Ok(successes)
}

/// The share of those that hold.
pub fn share(successes: impl ExactSizeIterator<Item = bool>) -> f64 {
    let all = successes.len() as f64;
    successes.filter(|success| *success).count() as f64 / all
}
