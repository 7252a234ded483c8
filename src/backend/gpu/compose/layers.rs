//! How a network lies on the device, and the text of the kernels that run it.

use super::kernels::{Kernel, TILE_QUADS};
use crate::formula::record;
use crate::formula::wgsl::function;
use crate::policy::{Activation, Layer, Mlp, normaliser};

const TILE: &str = include_str!("../../../../shaders/tile.wgsl");
const MLP: &str = include_str!("../../../../shaders/mlp.wgsl");
const NORM: &str = include_str!("../../../../shaders/norm.wgsl");

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
    /// Which of the [`Kinds`] of its network comes behind its sums.
    pub(in super::super) kind: u32,
    /// Whether that takes a kernel of its own: a norm, whose parameters follow the weights.
    pub(in super::super) normed: bool,
}

impl LayerShape {
    /// The layers of `mlp`, one after the other.
    ///
    /// # Panics
    /// If it has a map at an end.
    pub(in super::super) fn of(mlp: &Mlp) -> Vec<Self> {
        assert!(!mlp.is_mapped(), "maps are formulas around a network");
        let kinds = Kinds::of(mlp);
        let mut offset = 0;
        let shape = |layer: &Layer| {
            let inputs = input_quads(layer.inputs) as u32;
            let outputs = output_quads(layer.outputs) as u32;
            let (neurons, normed) = (layer.outputs as u32, layer.norm.is_some());
            let kind = kinds.number(Kind::of(layer));
            let shape = Self { offset, inputs, outputs, neurons, kind, normed };
            offset = shape.end();
            shape
        };
        mlp.layers().iter().map(shape).collect()
    }

    /// Vectors up to the end of its weights, where those of a norm begin: one that holds `epsilon`, then factors
    /// and summands.
    pub(in super::super) fn norm(self) -> u32 {
        self.offset + self.outputs * (1 + 4 * self.inputs)
    }

    /// Vectors up to the end of its parameters.
    pub(in super::super) fn end(self) -> u32 {
        self.norm() + if self.normed { 1 + 2 * self.outputs } else { 0 }
    }

    /// The kernels that run it, in order.
    pub(in super::super) fn kernels(self) -> Vec<Kernel> {
        match self.normed {
            true => vec![Kernel::Sums, Kernel::Norm(self.kind)],
            false => vec![Kernel::Layer(self.kind)],
        }
    }
}

/// Dispatches of all layers of `mlp`, a norm being one by itself.
pub(in super::super) fn layer_dispatches(mlp: &Mlp) -> usize {
    LayerShape::of(mlp).into_iter().map(|shape| shape.kernels().len()).sum()
}

/// Loop iterations of the longest kernel of the layers of `mlp`: a thread goes over all inputs, or three times over
/// all that a norm is of.
pub(in super::super) fn layer_trips(mlp: &Mlp) -> u64 {
    let trips = |shape: LayerShape| {
        let norm = if shape.normed { 3 * shape.outputs } else { 0 };
        u64::from(shape.inputs.max(norm))
    };
    LayerShape::of(mlp).into_iter().map(trips).max().unwrap_or(0)
}

/// What comes behind the sums of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kind {
    activation: Activation,
    normed: bool,
}

impl Kind {
    fn of(layer: &Layer) -> Self {
        Self { activation: layer.activation, normed: layer.norm.is_some() }
    }
}

/// What comes behind the sums of the layers of a network, each once, in order of the first layer that has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Kinds(Vec<Kind>);

impl Kinds {
    /// Those of `mlp`.
    pub(super) fn of(mlp: &Mlp) -> Self {
        let mut kinds = Vec::new();
        for kind in mlp.layers().iter().map(Kind::of) {
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        Self(kinds)
    }

    /// The number of `kind`, which is one of them.
    fn number(&self, kind: Kind) -> u32 {
        self.0.iter().position(|one| *one == kind).map_or(0, |at| at as u32)
    }

    /// The activation of kind `number`; none beyond the last.
    fn activation(&self, number: u32) -> Activation {
        self.0.get(number as usize).map_or(Activation::Identity, |kind| kind.activation)
    }
}

/// The text of the kernel of a layer of kind `number`, of one whose norm comes behind it, or of a norm.
pub(super) fn layer_text(kinds: &Kinds, kernel: Kernel) -> String {
    let activation = match kernel {
        Kernel::Layer(number) | Kernel::Norm(number) => kinds.activation(number),
        _ => Activation::Identity,
    };
    let activation = recorded_activation("activation", activation);
    match kernel {
        Kernel::Norm(_) => [activation, recorded_normaliser(), NORM.to_owned()].join("\n"),
        _ => [activation, TILE.to_owned(), MLP.to_owned()].join("\n"),
    }
}

/// The function `name` of a number: `activation`.
pub(super) fn recorded_activation(name: &str, activation: Activation) -> String {
    function(name, &[("x", 1)], &record(1, |x| vec![activation.apply(x[0])]))
}

/// `normaliser`, of a variance.
fn recorded_normaliser() -> String {
    let graph = record(2, |x| vec![normaliser(x[0], x[1])]);
    function("normaliser", &[("variance", 1), ("epsilon", 1)], &graph)
}
