//! A program: a plant prepared on a backend once, and called any number of times.

use super::sink::{PairsSink, StartSink};
use super::task::check_task;
use super::{Backend, MeasureSink, PairSink, cpu, gpu};
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{DeviationTask, Farthest, ReachAvoidTask, RolloutSpec, Starts, Tightening};

/// A plant prepared on a backend: nothing that its calls could share is done again by any of them.
pub struct Program<'a> {
    backend: &'a Backend,
    plant: Plant,
    prepared: Prepared<'a>,
}

/// What each backend keeps of a plant.
#[cfg_attr(
    not(feature = "gpu"),
    allow(clippy::large_enum_variant, reason = "without adapters there is but one variant")
)]
enum Prepared<'a> {
    Cpu(&'a cpu::Cpu, cpu::Prepared),
    Gpu(gpu::Prepared<'a>),
}

impl Backend {
    /// Prepares `plant`: its formulas for this backend, its network packed.
    ///
    /// # Errors
    /// [`Error::Invalid`] where formulas, network and model do not fit each other, and those of the
    /// device.
    pub fn prepare(&self, plant: &Plant) -> Result<Program<'_>> {
        plant.check()?;
        let prepared = match self {
            Self::Cpu(cpu) => Prepared::Cpu(cpu, cpu.prepare(plant)?),
            Self::Gpu(gpu) => Prepared::Gpu(gpu.prepare(plant)?),
        };
        Ok(Program { backend: self, plant: plant.clone(), prepared })
    }
}

impl Program<'_> {
    /// The backend that it runs on.
    pub fn backend(&self) -> &Backend {
        self.backend
    }

    /// What it rolls out.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// How an adapter runs the plant's networks, in words: fused into its rollouts, or in layers and why. None
    /// without a network and on the CPU, which has one way.
    pub fn networks(&self) -> Option<String> {
        match &self.prepared {
            Prepared::Cpu(..) => None,
            Prepared::Gpu(prepared) => prepared.networks(),
        }
    }

    /// The measure by the model's task, or its sign, of each start of `task`; sent to `sink` in order.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the parts of the task do not fit, those of the device, and the first
    /// of the sink.
    pub fn reach_avoid(&self, task: &ReachAvoidTask<'_>, sink: MeasureSink<'_>) -> Result<()> {
        self.roll_out(task, StartSink::Each(sink))
    }

    /// [`Program::reach_avoid`], of which each measure is asked for or what they count up to.
    pub(super) fn roll_out(
        &self,
        task: &ReachAvoidTask<'_>,
        mut sink: StartSink<'_>,
    ) -> Result<()> {
        self.check(&task.starts, task.range.end, task.tightening, &task.spec)?;
        // Nothing after the last step that matters changes a measure.
        let last = self.plant.model.task.last(task.spec.horizon).max(1);
        let spec = RolloutSpec { horizon: last, ..task.spec };
        let shorter = (spec != task.spec).then(|| ReachAvoidTask { spec, ..task.clone() });
        let task = shorter.as_ref().unwrap_or(task);
        match &self.prepared {
            Prepared::Cpu(cpu, prepared) => {
                prepared.reach_avoid(cpu, task, &mut |first, values| sink.take(first, values))
            }
            Prepared::Gpu(prepared) => prepared.reach_avoid(task, sink),
        }
    }

    /// Rolls pairs out side by side: the farthest pair of each step, `[T + 1]`, and the measures
    /// of each pair sent to `sink` in order.
    ///
    /// # Errors
    /// Those of [`Program::reach_avoid`].
    pub fn deviation(&self, task: &DeviationTask<'_>, sink: PairSink<'_>) -> Result<Vec<Farthest>> {
        self.roll_out_pairs(task, PairsSink::Each(sink))
    }

    /// [`Program::deviation`], of which the measures of each pair are asked for or what they count up to.
    pub(super) fn roll_out_pairs(
        &self,
        task: &DeviationTask<'_>,
        mut sink: PairsSink<'_>,
    ) -> Result<Vec<Farthest>> {
        self.check(&task.pairs.nominal, task.range.end, task.tightening, &task.spec)?;
        match &self.prepared {
            Prepared::Cpu(cpu, prepared) => {
                prepared.deviation(cpu, task, &mut |first, pairs| sink.take(first, pairs))
            }
            Prepared::Gpu(prepared) => prepared.deviation(task, sink),
        }
    }

    /// Checks a task once, in front of both backends.
    fn check(
        &self,
        starts: &Starts<'_>,
        end: u64,
        tightening: &Tightening,
        spec: &RolloutSpec,
    ) -> Result<()> {
        let (states, size) = (self.plant.model.states.len(), starts.size());
        if size != states {
            let problem = format!("starts of {size} numbers; the model has {states} states");
            return Err(Error::invalid("starts", problem));
        }
        check_task(starts, end, tightening, spec)?;
        self.plant.model.task.check(spec.horizon)
    }
}
