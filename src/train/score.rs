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

/// The mean over `starts` of the measure in multiples of `unit`, none of them beyond 1 in size, so that no
/// start outweighs another; a rollout that is not finite counts -1.
///
/// # Errors
/// Those of the device.
pub fn mean_measure(
    backend: &Backend,
    plant: &Plant,
    spec: RolloutSpec,
    starts: States<'_>,
    unit: f64,
) -> Result<f64> {
    let measures = backend.prepare(plant)?.measures(starts, &spec)?;
    let scaled = |measure: &f32| match measure.is_nan() {
        true => -1.0,
        false => (f64::from(*measure) / unit).clamp(-1.0, 1.0),
    };
    Ok(measures.iter().map(scaled).sum::<f64>() / measures.len() as f64)
}

/// The share of those that hold.
pub fn share(successes: impl ExactSizeIterator<Item = bool>) -> f64 {
    let all = successes.len() as f64;
    successes.filter(|success| *success).count() as f64 / all
}
