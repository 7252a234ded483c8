//! Measures of starts in one call: what most users ask a program first.

use super::Program;
use crate::error::Result;
use crate::rollout::{Keep, Query, ReachAvoidTask, RolloutSpec, Starts, States, Tightening};

impl Program<'_> {
    /// The reach-avoid measure of each of `starts`, in their order: `[starts]`. Positive where the rollout
    /// gets into the target before it violates the constraint; a start that is at neither is 0 or below.
    ///
    /// All of them are held in memory; [`Program::reach_avoid`] hands them on piece by piece, draws starts
    /// by itself, and stops a rollout once its sign is decided.
    ///
    /// # Errors
    /// Those of [`Program::reach_avoid`].
    pub fn measures<'s>(
        &self,
        starts: impl Into<States<'s>>,
        spec: &RolloutSpec,
    ) -> Result<Vec<f32>> {
        let starts = starts.into();
        let range = 0..starts.len() as u64;
        let task = ReachAvoidTask {
            starts: Starts::Listed(starts),
            range: range.clone(),
            spec: *spec,
            tightening: &Tightening::none(spec),
            query: Query::Measure,
        };
        Ok(self.tally(&task, Keep::Measures)?.finish(range)?.values)
    }
}
