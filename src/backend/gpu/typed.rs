//! Calls of plants that are given as Rust types: recorded at every call.

use std::sync::Arc;

use super::adapter::Gpu;
use super::job::Subject;
use super::recover::{self, Instead};
use super::source::Source;
use super::traffic::Count;
use crate::backend::cpu::Cpu;
use crate::backend::{MeasureSink, PairSink};
use crate::error::Result;
use crate::model::{Controller, Model};
use crate::policy::Policy;
use crate::rollout::{DeviationTask, Farthest, Plant, ReachAvoidTask};
use crate::system::System;

impl Gpu {
    /// See [`crate::backend::Backend::reach_avoid`].
    pub(in crate::backend) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &ReachAvoidTask<'_>,
        sink: MeasureSink<'_>,
    ) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let source = self.recorded(plant)?;
        let subject = Subject { source: &source.0, values: &source.1 };
        recover::reach_avoid(self, (subject, &Typed(plant)), task, sink)
    }

    /// See [`crate::backend::Backend::deviation`].
    pub(in crate::backend) fn deviation<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &DeviationTask<'_>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let source = self.recorded(plant)?;
        let subject = Subject { source: &source.0, values: &source.1 };
        recover::deviation(self, (subject, &Typed(plant)), task, sink)
    }

    /// The source of a plant that is given as Rust types, and the values of its parameters: recorded
    /// and printed at every call.
    fn recorded<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
    ) -> Result<(Arc<Source>, Vec<f32>)>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let model = Model::recorded(plant.system);
        let controller = Controller::recorded(plant.system, plant.policy);
        self.opened().device.counters.add(Count::Text);
        let source = Source::new(&model, &controller)?;
        Ok((self.sources.shared(source), model.values()))
    }
}

/// A system and its policy as Rust types.
struct Typed<'a, S, P, const NX: usize, const NU: usize>(Plant<'a, S, P>);

impl<S, P, const NX: usize, const NU: usize> Instead for Typed<'_, S, P, NX, NU>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    fn reach_avoid(
        &self,
        cpu: &Cpu,
        task: &ReachAvoidTask<'_>,
        sink: MeasureSink<'_>,
    ) -> Result<()> {
        cpu.reach_avoid(self.0, task, sink)
    }

    fn deviation(
        &self,
        cpu: &Cpu,
        task: &DeviationTask<'_>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>> {
        cpu.deviation(self.0, task, sink)
    }
}
