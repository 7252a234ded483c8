//! The native CPU backend: tiles of trajectories in SIMD lanes, tiles spread over threads.

use super::{MeasureSink, PairSink};
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{DeviationTask, Farthest, Plant, ReachAvoidTask};
use crate::system::System;

/// The host's processor.
#[derive(Debug)]
pub struct Cpu {}

impl Cpu {
    /// The processor in words.
    pub fn device(&self) -> String {
        String::new()
    }

    /// See [`super::Backend::reach_avoid`].
    pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
        &self,
        _plant: Plant<'_, S, P>,
        _task: &ReachAvoidTask<'_, NX>,
        _sink: MeasureSink<'_>,
    ) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        Ok(())
    }

    /// See [`super::Backend::deviation`].
    pub(super) fn deviation<S, P, const NX: usize, const NU: usize>(
        &self,
        _plant: Plant<'_, S, P>,
        _task: &DeviationTask<'_, NX>,
        _sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        Ok(Vec::new())
    }
}
