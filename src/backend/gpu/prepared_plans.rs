//! Plans as an adapter improves them.

use std::ops::Range;
use std::sync::Arc;

use super::adapter::Gpu;
use super::mppi_source::PlanSource;
use super::recover;
use super::traffic::Count;
use crate::error::{Error, Result};
use crate::rollout::{MppiTask, PlanTally, Planning};

/// What is planned for, prepared on an adapter: printed once, tables and networks uploaded once, each
/// kernel compiled when it is first needed. Where the adapter is opened again, so is all of that.
pub(in crate::backend) struct PreparedPlanning<'a> {
    gpu: &'a Gpu,
    source: Arc<PlanSource>,
}

impl Gpu {
    /// See [`crate::backend::Backend::prepare_plans`].
    pub(in crate::backend) fn prepare_plans(
        &self,
        planning: &Planning,
    ) -> Result<PreparedPlanning<'_>> {
        let opened = self.opened();
        opened.device.counters.add(Count::Text);
        let source = Arc::new(PlanSource::new(planning));
        let flight = opened.flight();
        let program = opened.plan_program(&flight, &source);
        match program.map(drop).and_then(|()| flight.device.check()) {
            // A call will meet it again, and knows what to do.
            Err(Error::DeviceFailed { .. }) => opened.clear(),
            other => other?,
        }
        Ok(PreparedPlanning { gpu: self, source })
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
        recover::tally(self.gpu, &self.source, (task, samples), sink)
    }
}
