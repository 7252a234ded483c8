//! The kernels of plans on a device, and the tables that never change.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::buffer::{Buffer, Pool, Use};
use super::compose::{Kernel, layer_kernel};
use super::device::Device;
use super::kernel::{Composed, Pipeline, Pipelines};
use super::mppi_source::PlanSource;
use super::network::upload;
use super::traffic::Count;
use crate::error::Result;

/// A kernel of a planning: one of MPPI, or a layer of the network number `0` or `1`.
type Which = (Kernel, usize);

/// The kernels of what is planned for, each compiled when it is first needed, and their tables.
pub(super) struct PlanCompiled {
    pub(super) source: Arc<PlanSource>,
    /// Parameters of value network and disturbance network.
    pub(super) weights: [Option<Buffer>; 2],
    /// The cells of all maps.
    pub(super) cells: Option<Buffer>,
    /// The rows of a spline.
    pub(super) spline: Buffer,
    pipelines: Arc<Pipelines>,
    built: Mutex<HashMap<Which, Arc<Pipeline>>>,
}

impl PlanCompiled {
    /// What `source` plans for on `device`, its tables and its networks' parameters uploaded.
    pub(super) fn new(
        device: &Device,
        pool: &Pool,
        pipelines: &Arc<Pipelines>,
        source: &Arc<PlanSource>,
    ) -> Self {
        let table = |words: &[u32]| {
            let buffer = pool.take(device, Use::Storage, size_of_val(words) as u64);
            buffer.write(device, words);
            buffer
        };
        let cells: &[u32] = bytemuck::cast_slice(&source.cells);
        Self {
            weights: source.networks().map(|mlp| mlp.map(|mlp| upload(device, pool, mlp))),
            cells: (!cells.is_empty()).then(|| table(cells)),
            spline: table(&source.spline()),
            source: Arc::clone(source),
            pipelines: Arc::clone(pipelines),
            built: Mutex::default(),
        }
    }

    /// The pipeline of `kernel`, a layer of the network number `network` or one of MPPI.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses the text.
    pub(super) fn pipeline(
        &self,
        device: &Device,
        kernel: Kernel,
        network: usize,
    ) -> Result<Arc<Pipeline>> {
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = built.get(&(kernel, network)) {
            return Ok(Arc::clone(pipeline));
        }
        device.counters.add(Count::Text);
        let layer = matches!(kernel, Kernel::Layer(_) | Kernel::Sums | Kernel::Norm(_));
        let (bindings, text) = match self.source.networks()[network].filter(|_| layer) {
            Some(mlp) => (kernel.bindings(false), layer_kernel(mlp, kernel)),
            None => (self.source.text.bindings(kernel), self.source.text.compose(kernel)),
        };
        let columns = kernel.workgroup();
        let composed = Composed { kernel, bindings, columns, text };
        let pipeline = self.pipelines.pipeline(device, composed)?;
        built.insert((kernel, network), Arc::clone(&pipeline));
        Ok(pipeline)
    }
}
