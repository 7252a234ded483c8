//! A network for a tile of trajectories in lockstep: weights packed in panels, activations in
//! blocks.

use std::marker::PhantomData;
use std::ops::Range;

use super::dispatch::Unit;
use super::kernel::{GRANULE, Kernel, Panel};
use crate::error::{Error, Result};
use crate::policy::{Activation, Layer, Mlp, Norm, normaliser};
use crate::real::Vector;
use crate::real::simd::Body;
use crate::tile::Frame;

/// A network whose weights are in the order in which a kernel reads them.
#[derive(Debug)]
pub(super) struct Packed {
    layers: Vec<PackedLayer>,
    /// Widest layer or input.
    widest: usize,
}

/// A layer cut into panels of the kernel's rows, each `[inputs, rows]`; the last may have fewer.
#[derive(Debug)]
struct PackedLayer {
    weights: Vec<f32>,
    bias: Vec<f32>,
    inputs: usize,
    norm: Option<Norm>,
    activation: Activation,
}

impl Packed {
    /// Refuses a `network` that does not map `inputs` to `outputs` numbers.
    ///
    /// # Errors
    /// [`Error::Invalid`] with both shapes.
    pub(super) fn check(network: &Mlp, inputs: usize, outputs: usize) -> Result<()> {
        let widths = network.widths();
        let (has_inputs, has_outputs) = (widths[0], widths[widths.len() - 1]);
        if (has_inputs, has_outputs) == (inputs, outputs) {
            return Ok(());
        }
        let problem = format!(
            "the network maps {has_inputs} inputs to {has_outputs} outputs, \
             the system has {inputs} states and {outputs} controls"
        );
        Err(Error::invalid("policy", problem))
    }

    /// Packs `network` for panels of `rows` neurons.
    ///
    /// # Panics
    /// If it has a map at an end.
    pub(super) fn new(network: &Mlp, rows: usize) -> Self {
        assert!(!network.is_mapped(), "maps are formulas around a network");
        Self {
            layers: network.layers().iter().map(|layer| PackedLayer::new(layer, rows)).collect(),
            widest: network.widths().into_iter().max().unwrap_or(0),
        }
    }

    /// Widest layer or input: it decides how many trajectories fit the caches.
    pub(super) fn widest(&self) -> usize {
        self.widest
    }
}

impl PackedLayer {
    fn new(layer: &Layer, rows: usize) -> Self {
        let mut weights = Vec::with_capacity(layer.weight.len());
        for panel in layer.weight.chunks(rows * layer.inputs) {
            for column in 0..layer.inputs {
                weights.extend(panel[column..].iter().step_by(layer.inputs));
            }
        }
        let Layer { bias, inputs, norm, activation, .. } = layer;
        let (bias, norm) = (bias.clone(), norm.clone());
        Self { weights, bias, inputs: *inputs, norm, activation: *activation }
    }

    /// The layer for `lanes` trajectories; `inputs` and `outputs` are `[blocks, features, BLOCK]`.
    fn forward<K: Kernel>(&self, kernel: K, lanes: usize, inputs: &[f32], outputs: &mut [f32]) {
        let floor = match (self.activation, &self.norm) {
            (Activation::Relu, None) => 0.0,
            _ => f32::NEG_INFINITY,
        };
        let squashes = self.squashes();
        let (block_in, block_out) = (self.inputs * K::BLOCK, self.bias.len() * K::BLOCK);
        let panels = self.weights.chunks(K::ROWS * self.inputs);
        for (p, (weights, bias)) in panels.zip(self.bias.chunks(K::ROWS)).enumerate() {
            let panel = Panel { weights, bias, floor };
            for block in 0..lanes.div_ceil(K::BLOCK) {
                let x = &inputs[block * block_in..][..block_in];
                let first = block * block_out + p * K::ROWS * K::BLOCK;
                let y = &mut outputs[first..][..bias.len() * K::BLOCK];
                kernel.panel(panel, lanes - block * K::BLOCK, x, y);
                if squashes {
                    let (activation, vector) = (self.activation, PhantomData::<K::Vector>);
                    kernel.call(Squashing { activation, values: y, vector });
                }
            }
        }
        if let Some(norm) = &self.norm {
            for values in outputs.chunks_mut(block_out).take(lanes.div_ceil(K::BLOCK)) {
                let (activation, columns) = (self.activation, K::BLOCK);
                let vector = PhantomData::<K::Vector>;
                kernel.call(Normalising { norm, activation, values, columns, vector });
            }
        }
    }

    /// Whether the activation is left to do of each panel: the kernel bounds sums itself, and a norm has to see all
    /// of a layer first.
    fn squashes(&self) -> bool {
        let bounded = matches!(self.activation, Activation::Relu | Activation::Identity);
        self.norm.is_none() && !bounded
    }
}

/// Activation of a panel's sums, a multiple of a granule, in the vectors of the instructions.
struct Squashing<'a, V> {
    activation: Activation,
    values: &'a mut [f32],
    vector: PhantomData<V>,
}

impl<V: Vector> Body for Squashing<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { activation, values, .. } = self;
        // A loop of its own for each of the usual ones: what is constant is made ready before it.
        match activation {
            Activation::Tanh => squash::<V>(Activation::Tanh, values),
            Activation::Silu => squash::<V>(Activation::Silu, values),
            Activation::Elu { alpha: 1.0 } => squash::<V>(Activation::Elu { alpha: 1.0 }, values),
            other => squash::<V>(other, values),
        }
    }
}

#[inline(always)]
fn squash<V: Vector>(activation: Activation, values: &mut [f32]) {
    let mut places = values.chunks_exact_mut(2 * V::WIDTH);
    for place in &mut places {
        let (first, second) = place.split_at_mut(V::WIDTH);
        let pair = [V::load(first), V::load(second)];
        let [one, other] = [activation.apply(pair[0]), activation.apply(pair[1])];
        one.store(first);
        other.store(second);
    }
    for place in places.into_remainder().chunks_exact_mut(V::WIDTH) {
        activation.apply(V::load(place)).store(place);
    }
}

/// Norm and activation of a layer's sums in a block, `[neurons, columns]`. Twin: shaders/norm.wgsl.
struct Normalising<'a, V> {
    norm: &'a Norm,
    activation: Activation,
    values: &'a mut [f32],
    columns: usize,
    vector: PhantomData<V>,
}

impl<V: Vector> Body for Normalising<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { norm, activation, values, columns, .. } = self;
        let rows = values.len() / columns;
        let count = V::lit(rows as f32);
        for first in (0..columns).step_by(V::WIDTH) {
            let mut total = V::lit(0.0);
            for row in 0..rows {
                total = total + V::load(&values[row * columns + first..]);
            }
            let mean = total / count;
            let mut total = V::lit(0.0);
            for row in 0..rows {
                let gap = V::load(&values[row * columns + first..]) - mean;
                total = total + gap * gap;
            }
            let factor = normaliser(total / count, V::lit(norm.epsilon));
            for row in 0..rows {
                let place = &mut values[row * columns + first..];
                let normed = (V::load(place) - mean) * factor * V::lit(norm.scale[row]);
                activation.apply(normed + V::lit(norm.shift[row])).store(place);
            }
        }
    }
}

/// A packed network with the activations of a tile, `[blocks, features, BLOCK]` twice.
#[derive(Debug)]
pub(super) struct Evaluator<'a, K> {
    network: &'a Packed,
    kernel: K,
    inputs: Vec<f32>,
    outputs: Vec<f32>,
}

impl<'a, K: Kernel> Evaluator<'a, K> {
    /// Room for tiles of up to `lanes` trajectories.
    pub(super) fn new(network: &'a Packed, kernel: K, lanes: usize) -> Self {
        Self::within(network, kernel, lanes, Default::default())
    }

    /// The same in `room`, which grows where it has to.
    fn within(network: &'a Packed, kernel: K, lanes: usize, room: [Vec<f32>; 2]) -> Self {
        let size = lanes.next_multiple_of(K::BLOCK) * network.widest();
        let [inputs, outputs] = room.map(|mut numbers| {
            numbers.resize(numbers.len().max(size), 0.0);
            numbers
        });
        Self { network, kernel, inputs, outputs }
    }

    /// From the rows `rows[0]` of a tile to its rows `rows[1]`, for the first `lanes` trajectories.
    pub(super) fn forward(&mut self, frame: &mut Frame, rows: [Range<usize>; 2], lanes: usize) {
        let [from, to] = rows;
        for granule in 0..lanes.div_ceil(GRANULE) {
            let (first, at) = (granule * GRANULE, place::<K>(granule, from.len()));
            for (feature, row) in from.clone().enumerate() {
                self.inputs[at + feature * K::BLOCK..][..GRANULE]
                    .copy_from_slice(&frame.row(row)[first..][..GRANULE]);
            }
        }
        self.layers(lanes);
        for granule in 0..lanes.div_ceil(GRANULE) {
            let (first, at) = (granule * GRANULE, place::<K>(granule, to.len()));
            for (feature, row) in to.clone().enumerate() {
                frame.row_mut(row)[first..][..GRANULE]
                    .copy_from_slice(&self.inputs[at + feature * K::BLOCK..][..GRANULE]);
            }
        }
    }

    /// All layers, from `inputs` back to `inputs`.
    fn layers(&mut self, lanes: usize) {
        for layer in &self.network.layers {
            layer.forward(self.kernel, lanes, &self.inputs, &mut self.outputs);
            std::mem::swap(&mut self.inputs, &mut self.outputs);
        }
    }
}

/// A network between formulas: from rows of a tile to rows of it, its activations in the room of the
/// frame.
pub(super) struct Between<'a> {
    /// The network.
    pub(super) network: &'a Packed,
    /// The tile.
    pub(super) frame: &'a mut Frame,
    /// The rows of its inputs and of its outputs.
    pub(super) rows: [Range<usize>; 2],
    /// How many trajectories.
    pub(super) lanes: usize,
}

impl Unit for Between<'_> {
    type Output = ();

    fn run<K: Kernel, const N: usize>(self, kernel: K) {
        let Self { network, frame, rows, lanes } = self;
        let mut evaluator = Evaluator::within(network, kernel, lanes, frame.take_room());
        evaluator.forward(frame, rows, lanes);
        frame.put_room([evaluator.inputs, evaluator.outputs]);
    }
}

/// Where a granule lies in `[blocks, features, BLOCK]`.
#[inline(always)]
fn place<K: Kernel>(granule: usize, features: usize) -> usize {
    let first = granule * GRANULE;
    first / K::BLOCK * features * K::BLOCK + first % K::BLOCK
}
