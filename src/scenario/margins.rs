//! `V_check` of any states: the measure with margins that lose something, on the backend, near zero in f64.

use super::Context;
use crate::error::Result;
use crate::rollout::{
    Keep, Query, ReachAvoidTask, RolloutSpec, Starts, States, Tightening, replay,
};

/// `V_check` (or its sign) of each of `states`; a measure within `band` of zero is that of f64.
pub fn check_margins(
    context: Context<'_>,
    spec: &RolloutSpec,
    tightening: &Tightening,
    states: States<'_>,
    query: Query,
    band: f64,
) -> Result<Vec<f32>> {
    if states.is_empty() {
        return Ok(Vec::new());
    }
    let (starts, range) = (Starts::Listed(states), 0..states.len() as u64);
    let task = ReachAvoidTask { starts, range: range.clone(), spec: *spec, tightening, query };
    let advance = &mut |count| context.watch.advance(count);
    let tally = context.program.tally_told(&task, Keep::Measures, advance)?;
    let mut margins = tally.finish(range)?.values;
    if query == Query::Measure {
        let near = |margin: &&mut f32| f64::from(margin.abs()) <= band;
        let pairs = margins.iter_mut().zip(states.iter());
        for (margin, start) in pairs.filter(|(margin, _)| near(margin)) {
            // Rounding to f32 keeps the sign.
            *margin = replay::measure(context.plant(), start, spec, tightening) as f32;
        }
    }
    Ok(margins)
}
