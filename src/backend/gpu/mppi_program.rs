//! Plans prepared on a device: what never changes of them, and the buffers of their calls.

use std::sync::Arc;

use super::buffer::Pool;
use super::device::Device;
use super::flight::Flight;
use super::kernel::Pipelines;
use super::mppi_compiled::PlanCompiled;
use super::mppi_source::PlanSource;
use super::mppi_workspace::{PlanShape, PlanWorkspace};
use super::program::{KEPT, KEPT_BYTES};
use super::recent::Recent;
use super::traffic::Count;
use crate::error::Result;

/// What is planned for, prepared on a device.
pub(super) struct PlanProgram {
    compiled: PlanCompiled,
    kept: Recent<PlanWorkspace>,
}

impl PlanProgram {
    /// What `source` plans for on `device`, its tables and its networks' parameters uploaded.
    pub(super) fn new(
        device: &Device,
        pool: &Pool,
        pipelines: &Arc<Pipelines>,
        source: &Arc<PlanSource>,
    ) -> Self {
        device.counters.add(Count::Program);
        let compiled = PlanCompiled::new(device, pool, pipelines, source);
        Self { compiled, kept: Recent::new(KEPT) }
    }

    /// Whether it is what `source` plans for.
    pub(super) fn is(&self, source: &Arc<PlanSource>) -> bool {
        Arc::ptr_eq(&self.compiled.source, source)
    }

    /// A workspace of `shape`: a kept one, or a new one.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses a kernel.
    pub(super) fn take(&self, flight: &Flight<'_>, shape: PlanShape) -> Result<PlanWorkspace> {
        let kept = self.kept.take(|workspace| workspace.shape == shape);
        kept.map_or_else(|| PlanWorkspace::new(flight, &self.compiled, shape), Ok)
    }

    /// Keeps `workspace` for a later call.
    pub(super) fn keep(&self, workspace: PlanWorkspace) {
        if workspace.bytes <= KEPT_BYTES {
            self.kept.keep(workspace);
        }
    }
}
