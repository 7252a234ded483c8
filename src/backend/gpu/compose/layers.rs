//! How a network lies on the device, and the text of the kernels that run it.

use super::kernels::TILE_QUADS;
use crate::formula::wgsl::function;
use crate::formula::{Expr, record};
use crate::policy::{Activation, Mlp, OutputActivation};

const TILE: &str = include_str!("../../../../shaders/tile.wgsl");
const MLP: &str = include_str!("../../../../shaders/mlp.wgsl");

/// Vectors of 4 inputs.
pub(in super::super) fn input_quads(width: usize) -> usize {
    width.div_ceil(4)
}

/// Vectors of 4 neurons, up to a whole tile.
pub(in super::super) fn output_quads(width: usize) -> usize {
    width.div_ceil(4).next_multiple_of(TILE_QUADS as usize)
}

/// Vectors that the parameters of all layers take.
pub(in super::super) fn parameter_quads(mlp: &Mlp) -> usize {
    LayerShape::of(mlp).last().map_or(0, |layer| layer.end() as usize)
}

/// Where the parameters of a layer lie, and its size in vectors of 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct LayerShape {
    /// Vectors before its biases.
    pub(in super::super) offset: u32,
    /// Vectors of 4 inputs.
    pub(in super::super) inputs: u32,
    /// Vectors of 4 neurons.
    pub(in super::super) outputs: u32,
    /// Neurons, without those that pad the vectors.
    pub(in super::super) neurons: u32,
}

impl LayerShape {
    /// The layers of `mlp`, one after the other.
    pub(in super::super) fn of(mlp: &Mlp) -> Vec<Self> {
        let mut offset = 0;
        let shape = |layer: &crate::policy::Layer| {
            let inputs = input_quads(layer.inputs) as u32;
            let outputs = output_quads(layer.outputs) as u32;
            let neurons = layer.outputs as u32;
            let shape = Self { offset, inputs, outputs, neurons };
            offset = shape.end();
            shape
        };
        mlp.layers().iter().map(shape).collect()
    }

    /// Vectors up to the end of its weights.
    pub(in super::super) fn end(self) -> u32 {
        self.offset + self.outputs * (1 + 4 * self.inputs)
    }
}

/// The functions at the ends of the layers of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Activations {
    /// Of the hidden layers.
    hidden: Activation,
    /// Of the last layer.
    output: OutputActivation,
}

impl Activations {
    /// Those of `mlp`.
    pub(super) fn of(mlp: &Mlp) -> Self {
        Self { hidden: mlp.activation(), output: mlp.output() }
    }
}

/// The text of a layer's kernel: of the last one, or of another.
pub(super) fn layer_text(activations: Option<Activations>, last: bool) -> String {
    let last = format!("const LAST_LAYER: bool = {last};\n");
    [recorded_activations(activations), last, TILE.to_owned(), MLP.to_owned()].join("\n")
}

/// `hidden_activation` and `output_activation`; the identity where there is no network.
pub(super) fn recorded_activations(activations: Option<Activations>) -> String {
    let hidden = |x: Expr| activations.map_or(x, |network| network.hidden.apply(x));
    let output = |x: Expr| activations.map_or(x, |network| network.output.apply(x));
    [
        function("hidden_activation", &[("x", 1)], &record(1, |x| vec![hidden(x[0])])),
        function("output_activation", &[("x", 1)], &record(1, |x| vec![output(x[0])])),
    ]
    .join("\n")
}
