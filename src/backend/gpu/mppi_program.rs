//! Plans prepared on a device: their kernels, the tables that never change, the buffers of calls.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::buffer::{Buffer, Pool, Use};
use super::compose::{Kernel, layer_kernel};
use super::device::Device;
use super::flight::Flight;
use super::kernel::{Pipeline, Pipelines};
use super::mppi_source::PlanSource;
use super::mppi_workspace::{PlanShape, PlanWorkspace};
use super::network::upload;
use super::program::{KEPT, KEPT_BYTES};
use super::recent::Recent;
use super::traffic::Count;
use crate::error::Result;

/// A kernel of a planning: one of MPPI, or a layer of the network number `0` or `1`.
type Which = (Kernel, usize);

/// What is planned for, prepared on a device.
pub(super) struct PlanProgram {
    pub(super) source: Arc<PlanSource>,
    /// Parameters of value network and disturbance network.
    pub(super) weights: [Option<Buffer>; 2],
    /// The cells of a map.
    pub(super) cells: Option<Buffer>,
    /// The rows of a spline.
    pub(super) spline: Buffer,
    pipelines: Arc<Pipelines>,
    built: Mutex<HashMap<Which, Arc<Pipeline>>>,
    kept: Recent<PlanWorkspace>,
}

impl PlanProgram {
    /// What `source` plans for on `device`, its tables and its networks' parameters uploaded.
    pub(super) fn new(
        (device, pool): (&Device, &Pool),
        pipelines: &Arc<Pipelines>,
        source: &Arc<PlanSource>,
    ) -> Self {
        let table = |words: &[u32]| {
            let buffer = pool.take(device, Use::Storage, size_of_val(words) as u64);
            buffer.write(device, words);
            buffer
        };
        let cells: &[u32] = bytemuck::cast_slice(source.cells());
        Self {
            weights: source.networks().map(|mlp| mlp.map(|mlp| upload(device, pool, mlp))),
            cells: (!cells.is_empty()).then(|| table(cells)),
            spline: table(&source.spline()),
            source: Arc::clone(source),
            pipelines: Arc::clone(pipelines),
            built: Mutex::default(),
            kept: Recent::new(KEPT),
        }
    }

    /// Whether it is what `source` plans for.
    pub(super) fn is(&self, source: &Arc<PlanSource>) -> bool {
        Arc::ptr_eq(&self.source, source)
    }

    /// The pipeline of `kernel`, a layer of the network number `network` or one of MPPI.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses the text.
    pub(super) fn pipeline(
        &self,
        device: &Device,
        (kernel, network): Which,
    ) -> Result<Arc<Pipeline>> {
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = built.get(&(kernel, network)) {
            return Ok(Arc::clone(pipeline));
        }
        device.counters.add(Count::Text);
        let layer = matches!(kernel, Kernel::HiddenLayer | Kernel::OutputLayer);
        let (bindings, text) = match self.source.networks()[network].filter(|_| layer) {
            Some(mlp) => (kernel.bindings(false), layer_kernel(mlp, kernel)),
            None => (self.source.text.bindings(kernel), self.source.text.compose(kernel)),
        };
        let pipeline = self.pipelines.pipeline(device, kernel, bindings, text)?;
        built.insert((kernel, network), Arc::clone(&pipeline));
        Ok(pipeline)
    }

    /// A workspace of `shape`: a kept one, or a new one.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses a kernel.
    pub(super) fn take(&self, flight: &Flight<'_>, shape: PlanShape) -> Result<PlanWorkspace> {
        let kept = self.kept.take(|workspace| workspace.shape == shape);
        kept.map_or_else(|| PlanWorkspace::new(flight, self, shape), Ok)
    }

    /// Keeps `workspace` for a later call.
    pub(super) fn keep(&self, workspace: PlanWorkspace) {
        if workspace.bytes <= KEPT_BYTES {
            self.kept.keep(workspace);
        }
    }
}
