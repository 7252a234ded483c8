//! Plans as an adapter improves them.

use std::ops::Range;
use std::sync::Arc;

use super::adapter::Gpu;
use super::mppi_source::PlanSource;
use super::recover;
use super::traffic::Count;
use crate::backend::cpu::{self, Cpu};
use crate::backend::{Action, Event};
use crate::error::{Error, Fault, Result};
use crate::rollout::{MppiTask, PlanTally, Planning};

/// What is planned for, prepared on an adapter: printed once, tables and networks uploaded once, each
/// kernel compiled when it is first needed. Where the adapter is opened again, so is all of that.
pub(in crate::backend) struct PreparedPlanning<'a> {
    gpu: &'a Gpu,
    work: Work<'a>,
}

/// Who improves plans.
enum Work<'a> {
    /// The adapter.
    Adapter(Arc<PlanSource>),
    /// The CPU, which is allowed to do what the adapter does not.
    Cpu(&'a Cpu, Box<cpu::PreparedPlanning>),
}

/// What the kernels of plans do not do.
const CALLS: &str = "formulas of these plans call networks, and adapters do not plan through them; \
                     use the native CPU backend";

impl Gpu {
    /// See [`crate::backend::Backend::prepare_plans`].
    pub(in crate::backend) fn prepare_plans(
        &self,
        planning: &Planning,
    ) -> Result<PreparedPlanning<'_>> {
        if calls(planning) {
            return self.on_cpu(planning);
        }
        let opened = self.opened();
        opened.device.counters.add(Count::Text);
        let printed = Arc::new(PlanSource::new(planning));
        let source = self.plans.get(|known| known.same(&printed), || Ok(Arc::clone(&printed)))?;
        let flight = opened.flight();
        let program = opened.plan_program(&flight, &source);
        match program.map(drop).and_then(|()| flight.device.check()) {
            // A call will meet it again, and knows what to do.
            Err(Error::DeviceFailed { .. }) => opened.clear(),
            other => other?,
        }
        Ok(PreparedPlanning { gpu: self, work: Work::Adapter(source) })
    }

    /// Leaves `planning` to the CPU, if that is allowed.
    fn on_cpu(&self, planning: &Planning) -> Result<PreparedPlanning<'_>> {
        let Some(cpu) = &self.fallback else {
            return Err(Error::Device(CALLS.to_owned()));
        };
        let (fault, action) = (Fault::Unfit, Action::Cpu);
        let (problem, work) = (CALLS.to_owned(), "problems".to_owned());
        self.note(Event { fault, problem, work, index: 0, action });
        let work = Work::Cpu(cpu, Box::new(cpu.prepare_plans(planning)));
        Ok(PreparedPlanning { gpu: self, work })
    }
}

impl PreparedPlanning<'_> {
    /// See [`crate::backend::PlanProgram::tally`].
    pub(in crate::backend) fn tally(
        &self,
        task: &MppiTask<'_>,
        samples: Range<u32>,
        sink: &mut dyn FnMut(Vec<PlanTally>),
    ) -> Result<()> {
        match &self.work {
            Work::Adapter(source) => recover::tally(self.gpu, source, task, samples, sink),
            Work::Cpu(cpu, prepared) => {
                prepared.tally(cpu, task, samples, sink);
                Ok(())
            }
        }
    }
}

/// Whether a formula of `planning` calls a network.
fn calls(planning: &Planning) -> bool {
    let mut graphs = [&planning.model.step].into_iter().chain(planning.cost.graphs());
    graphs.any(|graph| !graph.calls.is_empty())
}
