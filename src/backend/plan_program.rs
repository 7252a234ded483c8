//! A plan program: model, cost and samples prepared on a backend once, for any number of plans.

use std::ops::Range;
use std::sync::Arc;

use super::{Backend, cpu, gpu};
use crate::error::{Error, Result};
use crate::rollout::{MppiProblem, MppiResult, MppiTask, Origin, PlanTally, Planning};

/// What is planned for, prepared on a backend: nothing that its calls could share is done again by
/// any of them.
pub struct PlanProgram<'a> {
    backend: &'a Backend,
    planning: Arc<Planning>,
    prepared: Prepared<'a>,
}

/// What each backend keeps of it.
enum Prepared<'a> {
    Cpu(&'a cpu::Cpu, Box<cpu::PreparedPlanning>),
    Gpu(Box<gpu::PreparedPlanning<'a>>),
}

impl Backend {
    /// Prepares `planning`: formulas for this backend, networks packed.
    ///
    /// # Errors
    /// [`Error::Invalid`] where its parts do not fit each other, and those of the device.
    pub fn prepare_plans(&self, planning: &Planning) -> Result<PlanProgram<'_>> {
        planning.check()?;
        let planning = &planning.sampled();
        let prepared = match self {
            Self::Cpu(cpu) => Prepared::Cpu(cpu, Box::new(cpu.prepare_plans(planning))),
            Self::Gpu(gpu) => Prepared::Gpu(Box::new(gpu.prepare_plans(planning)?)),
        };
        Ok(PlanProgram { backend: self, planning: Arc::new(planning.clone()), prepared })
    }
}

impl PlanProgram<'_> {
    /// The backend that it runs on.
    pub fn backend(&self) -> &Backend {
        self.backend
    }

    /// What it plans for.
    pub fn planning(&self) -> &Planning {
        &self.planning
    }

    /// Improves the plan of each problem of `task` once, section 7 of `docs/method.md`; in the order
    /// of the problems.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a problem does not fit, and those of the device.
    pub fn improve(&self, task: &MppiTask<'_>) -> Result<Vec<MppiResult>> {
        let mut results = Vec::with_capacity(task.problems.len());
        let mut failed = Ok(());
        self.run(task, 0..self.planning.spec.settings().samples, &mut |tallies| {
            for tally in tallies {
                match tally.finish(&self.planning.spec, &task.problems[results.len()]) {
                    Ok(result) => results.push(result),
                    Err(error) => failed = Err(error),
                }
            }
        })?;
        failed.map(|()| results)
    }

    /// What the samples `samples` of each problem of `task` come to, in the order of the problems:
    /// a part of [`PlanProgram::improve`], which is merged with the others and finished. Ranges that
    /// are cut where the blocks of a whole call are, every 256 samples on the CPU, give its bits.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a problem does not fit or there are no such samples, and those of
    /// the device.
    pub fn tally(&self, task: &MppiTask<'_>, samples: Range<u32>) -> Result<Vec<PlanTally>> {
        let mut all = Vec::with_capacity(task.problems.len());
        self.run(task, samples, &mut |tallies| all.extend(tallies))?;
        let known = |(tally, problem): (PlanTally, &MppiProblem)| {
            tally.of(Origin::new(&self.planning, task, problem))
        };
        Ok(all.into_iter().zip(task.problems).map(known).collect())
    }

    /// The improved plan of `problem` from the tally of all its samples.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first sample that is missing, or what differs where the tally is
    /// of other plans or another problem.
    pub fn finish(&self, tally: PlanTally, problem: &MppiProblem) -> Result<MppiResult> {
        tally.check(&self.planning, problem)?;
        tally.finish(&self.planning.spec, problem)
    }

    fn run(
        &self,
        task: &MppiTask<'_>,
        samples: Range<u32>,
        sink: &mut dyn FnMut(Vec<PlanTally>),
    ) -> Result<()> {
        let most = self.planning.spec.settings().samples;
        if samples.start >= samples.end || samples.end > most {
            let problem = format!("{samples:?} is no part of the {most} samples");
            return Err(Error::invalid("samples", problem));
        }
        self.planning.check_problems(task.problems)?;
        match &self.prepared {
            Prepared::Cpu(cpu, prepared) => {
                prepared.tally(cpu, task, samples, sink);
                Ok(())
            }
            Prepared::Gpu(prepared) => prepared.tally(task, samples, sink),
        }
    }
}
