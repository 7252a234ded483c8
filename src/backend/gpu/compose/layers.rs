//! How a network lies on the device, and the text of the kernels that run it.

use super::glue::{component, padded};
use super::kernels::{TILE_PITCH, TILE_QUADS, WORKGROUP};
use crate::formula::wgsl::function;
use crate::formula::{Expr, record};
use crate::policy::{Activation, Mlp, OutputActivation};

const TILE: &str = include_str!("../../../../shaders/tile.wgsl");
const MLP: &str = include_str!("../../../../shaders/mlp.wgsl");
const MLP_FUSED: &str = include_str!("../../../../shaders/mlp_fused.wgsl");

/// Bytes of a vector of 4 activations.
const VECTOR_BYTES: u64 = 16;

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

/// The layers of a network that the rollouts run themselves, all steps in one dispatch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fused {
    layers: Vec<LayerShape>,
}

impl Fused {
    /// All layers of `mlp`.
    pub fn new(mlp: &Mlp) -> Self {
        Self { layers: LayerShape::of(mlp) }
    }

    /// Threads of a workgroup: one for each tile of the widest layer, and for each trajectory.
    pub fn lanes(&self) -> u32 {
        let neurons = self.layers.iter().map(|layer| layer.outputs / TILE_QUADS).max();
        (neurons.unwrap_or(1) * TILE_PITCH).next_multiple_of(WORKGROUP)
    }

    /// Workgroup memory that the activations take, bytes.
    pub fn workgroup_bytes(&self) -> u64 {
        u64::from(self.quads()) * u64::from(WORKGROUP) * VECTOR_BYTES
    }

    /// Loop iterations of a thread for one evaluation of the network.
    pub(in super::super) fn trips(&self) -> u64 {
        self.layers.iter().map(|layer| 1 + u64::from(layer.inputs)).sum()
    }

    /// Vectors of the widest activations.
    fn quads(&self) -> u32 {
        self.layers.iter().map(|layer| layer.inputs.max(layer.outputs)).max().unwrap_or(1)
    }
}

/// The text of a layer's kernel: of the last one, or of another.
pub(super) fn layer_text(activations: Option<Activations>, last: bool) -> String {
    let last = format!("const LAST_LAYER: bool = {last};\n");
    [recorded_activations(activations), last, TILE.to_owned(), MLP.to_owned()].join("\n")
}

/// `drive` by a network that the rollout runs itself, whose activations `glue` puts and takes.
pub(super) fn fused_text(activations: Activations, fused: &Fused, glue: &str) -> String {
    let sizes = format!(
        "const FUSED_QUADS: u32 = {}u;\nconst LAYER_COUNT: u32 = {}u;\n",
        fused.quads(),
        fused.layers.len()
    );
    [
        recorded_activations(Some(activations)),
        sizes,
        TILE.to_owned(),
        layer_table(&fused.layers),
        glue.to_owned(),
        MLP_FUSED.to_owned(),
    ]
    .join("\n")
}

/// `layer_at`: the layers by number.
fn layer_table(layers: &[LayerShape]) -> String {
    let mut text = String::from("fn layer_at(number: u32) -> Layer {\n    switch number {\n");
    for (number, &LayerShape { offset, inputs, outputs, neurons }) in layers.iter().enumerate() {
        let last = number + 1 == layers.len();
        let case = if last { "default".to_owned() } else { format!("case {number}u") };
        let layer = format!("Layer({offset}u, {inputs}u, {outputs}u, {neurons}u, {last})");
        text += &format!("        {case}: {{ return {layer}; }}\n");
    }
    text + "    }\n}\n"
}

/// `put_inputs` and `outputs_at`, free of loops.
pub(super) fn activation_glue(inputs: usize, outputs: usize) -> String {
    let mut text = String::from("fn put_inputs(column: u32, seen: array<f32, SEEN>) {\n");
    for quad in 0..inputs.div_ceil(4) {
        text += &format!("    put({quad}u, column, {});\n", padded("seen", quad, inputs));
    }
    text += "}\nfn outputs_at(column: u32) -> array<f32, SAID> {\n";
    for quad in 0..outputs.div_ceil(4) {
        text += &format!("    let v{quad} = input_at({quad}u, column);\n");
    }
    let all: Vec<String> = (0..outputs).map(component).collect();
    text + &format!("    return array<f32, SAID>({});\n}}\n", all.join(", "))
}

/// `hidden_activation` and `output_activation`; the identity where there is no network.
fn recorded_activations(activations: Option<Activations>) -> String {
    let hidden = |x: Expr| activations.map_or(x, |network| network.hidden.apply(x));
    let output = |x: Expr| activations.map_or(x, |network| network.output.apply(x));
    [
        function("hidden_activation", &[("x", 1)], &record(1, |x| vec![hidden(x[0])])),
        function("output_activation", &[("x", 1)], &record(1, |x| vec![output(x[0])])),
    ]
    .join("\n")
}
