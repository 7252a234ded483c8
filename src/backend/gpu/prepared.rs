//! A plant as an adapter runs it.

use std::sync::Arc;

use super::adapter::Gpu;
use super::fusing;
use super::job::Subject;
use super::recover;
use super::source::Source;
use super::traffic::Count;
use crate::backend::sink::{PairsSink, StartSink};
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{DeviationTask, Farthest, ReachAvoidTask};

/// A plant prepared on an adapter: printed once, its network's parameters uploaded once, each kernel
/// compiled when it is first needed. Where the adapter is opened again, so is all of that.
pub(in crate::backend) struct Prepared<'a> {
    gpu: &'a Gpu,
    source: Arc<Source>,
    /// The values of the model's parameters.
    values: Vec<f32>,
    plant: Plant,
}

impl Gpu {
    /// See [`crate::backend::Backend::prepare`].
    pub(in crate::backend) fn prepare(&self, plant: &Plant) -> Result<Prepared<'_>> {
        let opened = self.opened();
        let printed = || opened.device.counters.add(Count::Text);
        let source = self.sources.of_plant(plant, printed)?;
        let flight = opened.flight();
        let program = opened.program(&flight, &source);
        match program.map(drop).and_then(|()| flight.device.check()) {
            // A call will meet it again, and knows what to do.
            Err(Error::DeviceFailed { .. }) => opened.clear(),
            Err(Error::Device(_)) if self.fallback.is_some() => {}
            other => other?,
        }
        Ok(Prepared { gpu: self, source, values: plant.model.values(), plant: plant.clone() })
    }
}

impl Prepared<'_> {
    /// See [`crate::backend::Program::reach_avoid`].
    pub(in crate::backend) fn reach_avoid(
        &self,
        task: &ReachAvoidTask<'_>,
        sink: StartSink<'_>,
    ) -> Result<()> {
        recover::reach_avoid(self.gpu, self.subject(), &self.plant, task, sink)
    }

    /// See [`crate::backend::Program::deviation`].
    pub(in crate::backend) fn deviation(
        &self,
        task: &DeviationTask<'_>,
        sink: PairsSink<'_>,
    ) -> Result<Vec<Farthest>> {
        recover::deviation(self.gpu, self.subject(), &self.plant, task, sink)
    }

    /// See [`crate::backend::Program::networks`].
    pub(in crate::backend) fn networks(&self) -> Option<String> {
        if self.source.text.chain().is_some() {
            return Some(
                "in layers, a dispatch for each of a step: formulas call networks".to_owned(),
            );
        }
        let network = self.source.network.as_ref()?;
        let (adapter, wanted) = (&self.gpu.adapter, self.gpu.setup.networks);
        fusing::words(adapter, network, wanted).ok()
    }

    /// What calls roll out.
    fn subject(&self) -> Subject<'_> {
        Subject { source: &self.source, task: self.plant.model.task, values: &self.values }
    }
}
