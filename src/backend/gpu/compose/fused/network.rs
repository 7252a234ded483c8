//! A network that the rollouts run themselves: its layers, and how the threads share them.

use super::form::Form;
use super::shape::{FusedLayer, hidden_activations};
use crate::policy::{Activation, Mlp};

/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: u64 = 16;

/// The layers of a network that the rollouts run themselves, all steps in one dispatch.
#[derive(Clone, Debug, PartialEq)]
pub struct Fused {
    pub(super) layers: Vec<FusedLayer>,
    /// Of the hidden layers, each once.
    hidden: Vec<Activation>,
    /// Of the last layer.
    output: Activation,
    /// Numbers that the network sees.
    inputs: u32,
    form: Form,
}

impl Fused {
    /// All layers of `mlp`, shared as `form` says; none where the network has no such form, or norms, which need all
    /// sums of a layer at once.
    pub fn new(mlp: &Mlp, form: Form) -> Option<Self> {
        let layers = FusedLayer::of(mlp);
        let inputs = mlp.widths()[0] as u32;
        let fits = !mlp.has_norm() && form.fits(&layers);
        let (hidden, output) = (hidden_activations(mlp), mlp.output());
        fits.then_some(Self { layers, hidden, output, inputs, form })
    }

    /// Activations of the hidden layers, each once.
    pub(super) fn hidden_activations(&self) -> &[Activation] {
        &self.hidden
    }

    /// The activation of the last layer.
    pub(super) fn output(&self) -> Activation {
        self.output
    }

    /// How the threads share them.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Trajectories of a workgroup.
    pub fn trajectories(&self) -> u32 {
        self.form.trajectories()
    }

    /// Threads of a workgroup.
    pub fn lanes(&self) -> u32 {
        self.form.lanes(self.hidden())
    }

    /// Workgroup memory that activations and weights take, bytes.
    pub fn workgroup_bytes(&self) -> u64 {
        VECTOR_BYTES * u64::from(self.form.vectors(&self.layers))
    }

    /// Loop iterations of a thread for one evaluation of the network.
    pub(in crate::backend::gpu) fn trips(&self) -> u64 {
        self.layers.iter().map(|layer| 1 + u64::from(layer.depth)).sum()
    }

    /// All layers but the last.
    pub(super) fn hidden(&self) -> &[FusedLayer] {
        &self.layers[..self.layers.len() - 1]
    }

    /// Numbers that the network sees.
    pub(super) fn inputs(&self) -> u32 {
        self.inputs
    }

    /// The last layer.
    pub(super) fn last(&self) -> FusedLayer {
        self.layers[self.layers.len() - 1]
    }
}
