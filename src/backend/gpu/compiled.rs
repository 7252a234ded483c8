//! The kernels of a plant on a device, and the parameters of its network there.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::buffer::{Buffer, Pool};
use super::compose::{Access, Kernel, PlantText, Slot};
use super::device::Device;
use super::fusing::{NetworkKernels, fused};
use super::kernel::{Pipeline, Pipelines};
use super::network::upload;
use super::source::Source;
use super::traffic::Count;
use crate::error::Result;

/// The kernels of a plant, each compiled when it is first needed, and its networks' parameters.
pub(super) struct Compiled {
    pub(super) text: PlantText,
    weights: Option<Buffer>,
    /// Of the networks that formulas call.
    called: Vec<Buffer>,
    pipelines: Arc<Pipelines>,
    built: Mutex<HashMap<Kernel, Arc<Pipeline>>>,
}

impl Compiled {
    /// The plant of `source`, whose network runs as `networks` says; nothing compiled yet.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if a network is to be fused and does not fit.
    pub(super) fn new(
        device: &Device,
        pool: &Pool,
        pipelines: &Arc<Pipelines>,
        source: &Source,
        networks: NetworkKernels,
    ) -> Result<Self> {
        let network = source.network.as_deref();
        let fused = fused(&device.adapter, network, networks)?;
        let called = source.text.chain().map(|chain| chain.networks()).unwrap_or_default();
        Ok(Self {
            called: called.iter().map(|mlp| upload(device, pool, mlp)).collect(),
            text: source.text.clone().fusing(fused),
            weights: network.map(|mlp| upload(device, pool, mlp)),
            pipelines: Arc::clone(pipelines),
            built: Mutex::default(),
        })
    }

    /// The network's parameters, if there is one.
    pub(super) fn weights(&self) -> Option<&Buffer> {
        self.weights.as_ref()
    }

    /// The parameters of the network of that number that formulas call.
    pub(super) fn called(&self, number: usize) -> &Buffer {
        &self.called[number]
    }

    /// The pipeline of `kernel`, whose text and bindings are `given`: a layer of a network that formulas
    /// call.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses the text.
    pub(super) fn given(
        &self,
        device: &Device,
        kernel: Kernel,
        bindings: Vec<(Slot, Access)>,
        text: String,
    ) -> Result<Arc<Pipeline>> {
        device.counters.add(Count::Text);
        self.pipelines.pipeline(device, kernel, bindings, text)
    }

    /// The pipeline of `kernel`.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses the text.
    pub(super) fn pipeline(&self, device: &Device, kernel: Kernel) -> Result<Arc<Pipeline>> {
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = built.get(&kernel) {
            return Ok(Arc::clone(pipeline));
        }
        device.counters.add(Count::Text);
        let (bindings, text) = (self.text.bindings(kernel), self.text.compose(kernel));
        let pipeline = self.pipelines.pipeline(device, kernel, bindings, text)?;
        built.insert(kernel, Arc::clone(&pipeline));
        Ok(pipeline)
    }
}
