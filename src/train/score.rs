//! What policies are scored by: the engine's rollouts from held-out starts.

use crate::backend::Backend;
use crate::error::Result;
use crate::model::Plant;
use crate::rollout::{Query, ReachAvoidTask, RolloutSpec, Starts, States, Tightening};

/// Whether the rollout from each of `starts` has G > 0.
///
/// # Errors
/// Those of the device.
pub fn successes(
    backend: &Backend,
    plant: &Plant,
    spec: RolloutSpec,
    starts: States<'_>,
) -> Result<Vec<bool>> {
    let task = ReachAvoidTask {
        starts: Starts::Listed(starts),
        range: 0..starts.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Sign,
    };
    let mut successes = Vec::with_capacity(starts.len());
    backend.prepare(plant)?.reach_avoid(&task, &mut |_, signs| {
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
