//! Where the parameters of a fused network lie.

use crate::policy::{Activation, Layer, Mlp};

/// Inputs and neurons of a layer are padded to a multiple of it.
pub(super) const BLOCK: u32 = 8;

/// Where the parameters of a layer lie, and its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend::gpu) struct FusedLayer {
    /// Vectors before its biases, which its weights follow: `[depth, quads]`.
    pub(super) offset: u32,
    /// Inputs, padded to whole blocks.
    pub(super) depth: u32,
    /// Vectors of 4 neurons, padded to whole blocks.
    pub(super) quads: u32,
    /// Neurons, without those that pad them.
    pub(super) neurons: u32,
    /// Which of the activations of the hidden layers it has, if it is one.
    pub(super) activation: u32,
}

/// The activations of the hidden layers of `mlp`, each once, in order of the first layer that has it.
pub(super) fn hidden_activations(mlp: &Mlp) -> Vec<Activation> {
    let (_, hidden) = mlp.layers().split_last().expect("a network has a layer");
    let mut found = Vec::new();
    for layer in hidden {
        if !found.contains(&layer.activation) {
            found.push(layer.activation);
        }
    }
    found
}

impl FusedLayer {
    /// The layers of `mlp`, one after the other.
    pub(in crate::backend::gpu) fn of(mlp: &Mlp) -> Vec<Self> {
        let (mut offset, hidden) = (0, hidden_activations(mlp));
        let shape = |layer: &Layer| {
            let known = hidden.iter().position(|one| *one == layer.activation);
            let depth = (layer.inputs as u32).next_multiple_of(BLOCK);
            let quads = (layer.outputs as u32).next_multiple_of(BLOCK) / 4;
            let activation = known.unwrap_or(0) as u32;
            let shape = Self { offset, depth, quads, neurons: layer.outputs as u32, activation };
            offset = shape.end();
            shape
        };
        mlp.layers().iter().map(shape).collect()
    }

    /// Vectors up to the end of its weights.
    pub(super) fn end(self) -> u32 {
        self.offset + self.quads * (1 + self.depth)
    }
}

/// The parameters of all layers of `mlp`: of each the biases, then for each input the weights of all
/// neurons, padded with 0.
pub(in crate::backend::gpu) fn packed(mlp: &Mlp) -> Vec<[f32; 4]> {
    let mut packed = Vec::new();
    for (layer, shape) in mlp.layers().iter().zip(FusedLayer::of(mlp)) {
        let vector = |quad: u32, of: &dyn Fn(usize) -> f32| {
            let neuron = |i: usize| 4 * quad as usize + i;
            std::array::from_fn(|i| if neuron(i) < layer.outputs { of(neuron(i)) } else { 0.0 })
        };
        packed.extend((0..shape.quads).map(|quad| vector(quad, &|row| layer.bias[row])));
        for column in 0..shape.depth as usize {
            let weight = |row: usize| match column < layer.inputs {
                true => layer.weight[row * layer.inputs + column],
                false => 0.0,
            };
            packed.extend((0..shape.quads).map(|quad| vector(quad, &weight)));
        }
    }
    packed
}

/// `0 <= neuron < neurons`, or 0: weights of 0 do not keep a padded neuron at 0 where an input is
/// infinite.
pub(super) fn masked(value: &str, neuron: &str, neurons: &str, padded: bool) -> String {
    if padded { format!("select(0.0, {value}, {neuron} < {neurons})") } else { value.to_owned() }
}

/// Whether a hidden layer has neurons that pad it.
pub(super) fn pads(hidden: &[FusedLayer]) -> bool {
    hidden.iter().any(|layer| layer.neurons != 4 * layer.quads)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::Activation;

    #[test]
    fn packed_by_inputs() {
        let layer = Layer::dense((0..15).map(|i| i as f32).collect(), vec![10.0, 20.0, 30.0]);
        let mlp = Mlp::new(vec![layer], Activation::Relu, Activation::Tanh).expect("whole");
        let (packed, shapes) = (packed(&mlp), FusedLayer::of(&mlp));
        assert_eq!(
            shapes,
            [FusedLayer { offset: 0, depth: 8, quads: 2, neurons: 3, activation: 0 }]
        );
        assert_eq!(packed.len(), shapes[0].end() as usize);
        assert_eq!(packed[..2], [[10.0, 20.0, 30.0, 0.0], [0.0; 4]], "biases");
        assert_eq!(packed[2 + 2], [1.0, 6.0, 11.0, 0.0], "input 1");
        assert_eq!(packed[2 + 8], [4.0, 9.0, 14.0, 0.0], "input 4");
        assert_eq!(packed[2 + 10..], [[0.0; 4]; 6], "padded inputs");
    }
}
