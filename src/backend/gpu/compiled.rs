//! The kernels of a plant on a device, and the parameters of its network there.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::buffer::{Buffer, Pool};
use super::compose::{Access, Form, Fused, Kernel, PlantText, Slot};
use super::device::Device;
use super::fusing::{Forms, NetworkKernels};
use super::kernel::{Composed, Pipeline, Pipelines};
use super::network::{upload, upload_fused};
use super::source::Source;
use super::traffic::Count;
use crate::error::Result;

/// A kernel, and the form in which it runs the network of its plant, if it does.
type Formed = (Kernel, Option<Form>);

/// The kernels of a plant, each compiled when it is first needed, and its networks' parameters.
pub(super) struct Compiled {
    /// With the network in the form of large batches, if rollouts run it themselves.
    pub(super) text: PlantText,
    forms: Forms,
    weights: Option<Buffer>,
    /// Of the networks that formulas call.
    called: Vec<Buffer>,
    pipelines: Arc<Pipelines>,
    built: Mutex<HashMap<Formed, Arc<Pipeline>>>,
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
        let forms = Forms::new(&device.adapter, network, networks)?;
        let fused = forms.largest();
        let upload_own = if fused.is_some() { upload_fused } else { upload };
        let called = source.text.chain().map(|chain| chain.networks()).unwrap_or_default();
        Ok(Self {
            called: called.iter().map(|mlp| upload(device, pool, mlp)).collect(),
            text: source.text.clone().fusing(fused),
            forms,
            weights: network.map(|mlp| upload_own(device, pool, mlp)),
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
        let columns = kernel.workgroup();
        self.pipelines.pipeline(device, Composed { kernel, bindings, columns, text })
    }

    /// The pipeline of `kernel` for batches of `columns` columns.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFailed`] if the driver refuses the text.
    pub(super) fn pipeline(
        &self,
        device: &Device,
        kernel: Kernel,
        columns: u32,
    ) -> Result<Arc<Pipeline>> {
        let rolls = matches!(kernel, Kernel::ReachAvoid | Kernel::Deviation);
        let fused = self.forms.of(columns).filter(|_| rolls);
        let key = (kernel, fused.map(Fused::form));
        let mut built = self.built.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = built.get(&key) {
            return Ok(Arc::clone(pipeline));
        }
        device.counters.add(Count::Text);
        let text = match fused {
            Some(fused) => self.text.clone().fusing(Some(fused.clone())),
            None => self.text.clone(),
        };
        let composed = Composed {
            kernel,
            bindings: text.bindings(kernel),
            columns: text.columns(kernel),
            text: text.compose(kernel),
        };
        let pipeline = self.pipelines.pipeline(device, composed)?;
        built.insert(key, Arc::clone(&pipeline));
        Ok(pipeline)
    }
}
