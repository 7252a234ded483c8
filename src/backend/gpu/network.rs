//! The network's parameters as the layer kernel wants them, and its layers' dispatches.

use super::buffer::{Buffer, Params, Use};
use super::compose::{Kernel, LayerShape, Shape, Slot, TILE_PITCH, TILE_QUADS, WORKGROUP, compose};
use super::kernel::Bound;
use super::run::{Batch, Call};
use crate::error::Result;
use crate::policy::{Layer, Mlp};

pub(super) use super::compose::{input_quads, output_quads};

/// Vectors that the parameters of all layers take.
pub(super) fn parameter_quads(mlp: &Mlp) -> usize {
    LayerShape::of(mlp).last().map_or(0, |layer| layer.end() as usize)
}

/// Appends biases `[outputs / 4]`, then weights `[inputs / 4, outputs / 4]` in blocks of 4 columns
/// of 4 neurons, padded with 0: a padded neuron stays 0 under every activation.
fn pack(layer: &Layer, out: &mut Vec<[f32; 4]>) {
    let neuron = |quad: usize, i: usize| Some(4 * quad + i).filter(|&row| row < layer.outputs);
    let quads = output_quads(layer.outputs);
    let bias = |quad, i| neuron(quad, i).map_or(0.0, |row| layer.bias[row]);
    out.extend((0..quads).map(|quad| std::array::from_fn(|i| bias(quad, i))));
    for k in 0..input_quads(layer.inputs) {
        for quad in 0..quads {
            for column in 4 * k..4 * k + 4 {
                let weight = |row: usize| {
                    if column < layer.inputs {
                        layer.weight[row * layer.inputs + column]
                    } else {
                        0.0
                    }
                };
                out.push(std::array::from_fn(|i| neuron(quad, i).map_or(0.0, weight)));
            }
        }
    }
}

/// The parameters of all layers of `mlp`, on the device.
pub(super) fn upload(call: &Call<'_>, mlp: &Mlp) -> Buffer {
    let mut packed = Vec::with_capacity(parameter_quads(mlp));
    for layer in mlp.layers() {
        pack(layer, &mut packed);
    }
    call.uploaded(&packed)
}

/// A network on the device, a dispatch per layer.
pub(super) struct Network {
    weights: Buffer,
    activations: [Buffer; 2],
    layers: Vec<LayerShape>,
    shape: Shape,
}

impl Network {
    /// Uploads `mlp`; its activations have `row` columns.
    pub(super) fn new(call: &Call<'_>, mlp: &Mlp, row: u32) -> Self {
        let layers = LayerShape::of(mlp);
        let widest = layers.iter().map(|layer| layer.outputs).max().unwrap_or(0);
        let bytes = 16 * u64::from(widest) * u64::from(row);
        Self {
            weights: upload(call, mlp),
            activations: [(); 2].map(|()| call.pool.take(&call.device, Use::Storage, bytes)),
            layers,
            shape: Shape::new(mlp.widths()[0], mlp.widths()[mlp.layers().len()], Some(mlp)),
        }
    }

    /// Where the last layer leaves its outputs.
    pub(super) fn output(&self) -> &Buffer {
        &self.activations[(self.layers.len() + 1) % 2]
    }

    /// The layers bound to `state` as their input.
    pub(super) fn bind(&self, call: &Call<'_>, state: &Buffer) -> Result<Vec<Bound>> {
        let bind = |i: usize| {
            let last = i + 1 == self.layers.len();
            let kernel = if last { Kernel::OutputLayer } else { Kernel::HiddenLayer };
            let source = if i == 0 { state } else { &self.activations[(i + 1) % 2] };
            let text = compose(kernel, &self.shape, "");
            call.bind(kernel, kernel.bindings(false), text, |slot| match slot {
                Slot::Weights => &self.weights,
                Slot::Source => source,
                _ => &self.activations[i % 2],
            })
        };
        (0..self.layers.len()).map(bind).collect()
    }

    /// Adds the dispatches of all layers over the first `columns` columns, in rows of `row`.
    pub(super) fn forward<'a>(
        &self,
        batch: &mut Batch<'a>,
        bound: &'a [Bound],
        columns: u32,
        row: u32,
    ) {
        for (bound, layer) in bound.iter().zip(&self.layers) {
            let params = Params {
                columns,
                stride: row,
                layer_offset: layer.offset,
                layer_inputs: layer.inputs,
                layer_outputs: layer.outputs,
                layer_neurons: layer.neurons,
                ..Params::default()
            };
            let across = columns.div_ceil(WORKGROUP);
            let neurons = (layer.outputs / TILE_QUADS).div_ceil(TILE_PITCH);
            batch.push(bound, &params, [across, neurons]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{Activation, OutputActivation};

    #[test]
    fn packed_by_columns_of_four_neurons() {
        let layer = Layer {
            weight: (0..15).map(|i| i as f32).collect(),
            bias: vec![10.0, 20.0, 30.0],
            inputs: 5,
            outputs: 3,
        };
        let mut packed = Vec::new();
        pack(&layer, &mut packed);
        let mlp = Mlp::new(vec![layer], Activation::Relu, OutputActivation::Tanh).expect("whole");
        assert_eq!(packed.len(), parameter_quads(&mlp));
        assert_eq!(packed[0], [10.0, 20.0, 30.0, 0.0]);
        assert_eq!(packed[1], [0.0; 4], "bias of the padded tile");
        assert_eq!(packed[2 + 1], [1.0, 6.0, 11.0, 0.0], "column 1 of the weights");
        assert_eq!(packed[2 + 8], [4.0, 9.0, 14.0, 0.0], "column 4 of the weights");
        assert_eq!(packed[2 + 9], [0.0; 4], "padded input");
    }
}
