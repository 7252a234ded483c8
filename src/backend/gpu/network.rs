//! The network's parameters as the layer kernel wants them, and its layers' dispatches.

use super::batch::Batch;
use super::buffer::{Buffer, Pool, Use};
use super::compose::{
    Kernel, LayerShape, TILE_PITCH, TILE_QUADS, WORKGROUP, input_quads, output_quads,
    packed_by_inputs, parameter_quads,
};
use super::device::Device;
use super::kernel::Bound;
use super::params::Params;
use super::traffic::Count;
use crate::error::Result;
use crate::policy::{Layer, Mlp};

/// Appends biases `[outputs / 4]`, then weights `[inputs / 4, outputs / 4]` in blocks of 4 columns
/// of 4 neurons, padded with 0; then epsilon, factors and summands of its norm, if it has one.
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
    if let Some(norm) = &layer.norm {
        out.push([norm.epsilon, 0.0, 0.0, 0.0]);
        for values in [&norm.scale, &norm.shift] {
            let of = |quad, i| neuron(quad, i).map_or(0.0, |row| values[row]);
            out.extend((0..quads).map(|quad| std::array::from_fn(|i| of(quad, i))));
        }
    }
}

/// Operations of a network for one input.
pub(super) fn network_flops(mlp: &Mlp) -> u64 {
    mlp.layers().iter().map(|layer| 2 * layer.weight.len() as u64).sum()
}

/// The parameters of all layers of `mlp`, one after the other.
fn packed(mlp: &Mlp) -> Vec<[f32; 4]> {
    let mut packed = Vec::with_capacity(parameter_quads(mlp));
    for layer in mlp.layers() {
        pack(layer, &mut packed);
    }
    packed
}

/// The parameters of all layers of `mlp`, on the device.
pub(super) fn upload(device: &Device, pool: &Pool, mlp: &Mlp) -> Buffer {
    store(device, pool, &packed(mlp))
}

/// The same as rollouts that run the network themselves read them.
pub(super) fn upload_fused(device: &Device, pool: &Pool, mlp: &Mlp) -> Buffer {
    store(device, pool, &packed_by_inputs(mlp))
}

fn store(device: &Device, pool: &Pool, packed: &[[f32; 4]]) -> Buffer {
    device.counters.add(Count::Pack);
    let buffer = pool.take(device, Use::Storage, size_of_val(packed) as u64);
    buffer.write(device, packed);
    buffer
}

/// The layers of a network that has a dispatch for each.
pub(super) struct Layers {
    activations: [Buffer; 2],
    shapes: Vec<LayerShape>,
}

impl Layers {
    /// The layers of `mlp`; its activations have `row` columns.
    pub(super) fn new(device: &Device, pool: &Pool, mlp: &Mlp, row: u32) -> Self {
        let shapes = LayerShape::of(mlp);
        let widest = shapes.iter().map(|layer| layer.outputs).max().unwrap_or(0);
        let bytes = 16 * u64::from(widest) * u64::from(row);
        Self { activations: [(); 2].map(|()| pool.take(device, Use::Storage, bytes)), shapes }
    }

    /// Bytes of its activations.
    pub(super) fn size(&self) -> u64 {
        self.activations.iter().map(Buffer::size).sum()
    }

    /// Where the last layer leaves its outputs.
    pub(super) fn output(&self) -> &Buffer {
        &self.activations[(self.shapes.len() + 1) % 2]
    }

    /// Each layer, bound by `bind` to its source and its sink; the first reads `input`.
    pub(super) fn bind(
        &self,
        input: &Buffer,
        bind: impl Fn(Kernel, [&Buffer; 2]) -> Result<Bound>,
    ) -> Result<Vec<Bound>> {
        let layers = self.shapes.iter().enumerate().flat_map(|(i, shape)| {
            let source = if i == 0 { input } else { &self.activations[(i + 1) % 2] };
            let ends = [source, &self.activations[i % 2]];
            shape.kernels().into_iter().map(move |kernel| (kernel, ends))
        });
        layers.map(|(kernel, ends)| bind(kernel, ends)).collect()
    }

    /// Adds the dispatches of all layers over the first `columns` columns, in rows of `row`.
    pub(super) fn forward<'a>(
        &self,
        batch: &mut Batch<'a>,
        bound: &'a [Bound],
        columns: u32,
        row: u32,
    ) {
        push_layers(batch, bound, &self.shapes, columns, row);
    }
}

/// Adds the dispatches of layers of these shapes over the first `columns` columns, in rows of `row`.
pub(super) fn push_layers<'a>(
    batch: &mut Batch<'a>,
    bound: &'a [Bound],
    shapes: &[LayerShape],
    columns: u32,
    row: u32,
) {
    let mut bound = bound.iter();
    for layer in shapes {
        let sums = Params {
            columns,
            stride: row,
            layer_offset: layer.offset,
            layer_inputs: layer.inputs,
            layer_outputs: layer.outputs,
            layer_neurons: layer.neurons,
            ..Params::default()
        };
        let norm = Params { layer_offset: layer.norm(), ..sums };
        let across = columns.div_ceil(WORKGROUP);
        let neurons = (layer.outputs / TILE_QUADS).div_ceil(TILE_PITCH);
        let dispatches = [(sums, [across, neurons]), (norm, [across, 1])];
        let count = layer.kernels().len();
        for ((params, groups), bound) in dispatches[..count].iter().zip(bound.by_ref()) {
            batch.push(bound, params, *groups);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::compose::parameter_quads;
    use crate::policy::Activation;

    #[test]
    fn packed_by_columns_of_four_neurons() {
        let layer = Layer::dense((0..15).map(|i| i as f32).collect(), vec![10.0, 20.0, 30.0]);
        let mlp = Mlp::new(vec![layer], Activation::Relu, Activation::Tanh).expect("whole");
        let packed = packed(&mlp);
        assert_eq!(packed.len(), parameter_quads(&mlp));
        assert_eq!(packed[0], [10.0, 20.0, 30.0, 0.0]);
        assert_eq!(packed[1], [0.0; 4], "bias of the padded tile");
        assert_eq!(packed[2 + 1], [1.0, 6.0, 11.0, 0.0], "column 1 of the weights");
        assert_eq!(packed[2 + 8], [4.0, 9.0, 14.0, 0.0], "column 4 of the weights");
        assert_eq!(packed[2 + 9], [0.0; 4], "padded input");
    }
}
