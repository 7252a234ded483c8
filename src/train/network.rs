//! Networks under training: flat parameters, their forward pass on tensors, and export as [`Mlp`].

use burn_tensor::{Gradients, Tensor};

use super::device::{Device, floats};
use super::layer::layer;
use crate::error::Result;
use crate::policy::{Activation, Layer, Mlp};
use crate::rollout::Stream;

/// What a network looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct Architecture {
    /// Interval of each input, which the first layer sees as -1 to 1.
    pub inputs: Vec<[f32; 2]>,
    /// Neurons of each hidden layer.
    pub hidden: Vec<usize>,
    /// Number of outputs.
    pub outputs: usize,
    /// Activation of the hidden layers.
    pub activation: Activation,
    /// Activation of the last layer.
    pub output: Activation,
}

impl Architecture {
    /// Inputs and outputs of each layer.
    fn layers(&self) -> Vec<[usize; 2]> {
        let first = std::iter::once(self.inputs.len());
        let widths: Vec<usize> =
            first.chain(self.hidden.iter().copied()).chain([self.outputs]).collect();
        widths.windows(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    /// What an input is multiplied with; one that is frozen is only shifted.
    fn scale(&self, input: usize) -> f32 {
        let [low, high] = self.inputs[input];
        if low < high { 2.0 / (high - low) } else { 1.0 }
    }

    /// Middle of the interval of an input.
    fn middle(&self, input: usize) -> f32 {
        let [low, high] = self.inputs[input];
        0.5 * (low + high)
    }
}

/// A network: its shape, and for each layer the weights `[inputs, outputs]` and then the biases.
///
/// The parameters are plain numbers, so that optimisers, averages and files need no tensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    shape: Architecture,
    /// All parameters.
    pub parameters: Vec<f32>,
}

impl Network {
    /// A random network: uniform within one over the root of a layer's inputs, in the last layer
    /// `last` times that and without biases, so that its outputs do not saturate at first.
    pub fn random(shape: Architecture, stream: Stream, last: f32) -> Self {
        let layers = shape.layers();
        let mut bounds = Vec::new();
        for (i, &[inputs, outputs]) in layers.iter().enumerate() {
            let bound = 1.0 / (inputs as f32).sqrt();
            let is_last = i + 1 == layers.len();
            let [weight, bias] = if is_last { [last * bound, 0.0] } else { [bound; 2] };
            bounds.extend(std::iter::repeat_n(weight, inputs * outputs));
            bounds.extend(std::iter::repeat_n(bias, outputs));
        }
        let low: Vec<f32> = bounds.iter().map(|bound| -bound).collect();
        let drawn = stream.in_box::<1>(&low, &bounds, 0);
        Self { shape, parameters: drawn.into_iter().map(|lane| lane.0[0]).collect() }
    }

    /// The network as tensors on `device` whose derivatives are wanted.
    pub fn bind(&self, device: &Device) -> Bound {
        self.bound(device, Tensor::require_grad)
    }

    /// The network as tensors on `device` that nothing is derived by; its inputs may be.
    pub fn fixed(&self, device: &Device) -> Bound {
        self.bound(device, |leaf| leaf)
    }

    /// The network as tensors, each leaf as `mark` makes it.
    fn bound(&self, device: &Device, mark: impl Fn(Tensor<2>) -> Tensor<2>) -> Bound {
        let mut rest = self.parameters.as_slice();
        let mut leaves = Vec::new();
        for [inputs, outputs] in self.shape.layers() {
            for rows in [inputs, 1] {
                let (values, after) = rest.split_at(rows * outputs);
                leaves.push(mark(device.tensor(values.to_vec(), [rows, outputs])));
                rest = after;
            }
        }
        let mut layers: Vec<[Tensor<2>; 2]> =
            leaves.chunks(2).map(|pair| [pair[0].clone(), pair[1].clone()]).collect();
        layers[0] = self.normalised(device, &layers[0]);
        Bound { leaves, layers, activation: self.shape.activation, output: self.shape.output }
    }

    /// The first layer for inputs as they are: `W (x - middle) scale + b`.
    fn normalised(&self, device: &Device, [weight, bias]: &[Tensor<2>; 2]) -> [Tensor<2>; 2] {
        let count = self.shape.inputs.len();
        let scale = (0..count).map(|i| self.shape.scale(i)).collect();
        let shift = (0..count).map(|i| -self.shape.middle(i)).collect();
        let weight = weight.clone() * device.tensor(scale, [count, 1]);
        let bias = bias.clone() + device.tensor(shift, [1, count]).matmul(weight.clone());
        [weight, bias]
    }

    /// The network for the engine, whose inputs have the names `order`, where they have names.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if a parameter is not finite.
    pub fn export(&self, order: impl Into<Option<Vec<String>>>) -> Result<Mlp> {
        let bound = self.fixed(&Device::cpu());
        let layers = bound.layers.into_iter().map(|[weight, bias]| {
            let weight = floats(weight.inner().transpose());
            Layer::dense(weight, floats(bias.inner()))
        });
        let mlp = Mlp::new(layers.collect(), self.shape.activation, self.shape.output)?;
        match order.into() {
            Some(order) => mlp.with_state_order(order),
            None => Ok(mlp),
        }
    }
}

/// A network as tensors.
#[derive(Clone, Debug)]
pub struct Bound {
    leaves: Vec<Tensor<2>>,
    layers: Vec<[Tensor<2>; 2]>,
    activation: Activation,
    output: Activation,
}

impl Bound {
    /// The outputs `[rows, outputs]` for `inputs` `[rows, inputs]`.
    pub fn forward(&self, inputs: Tensor<2>) -> Tensor<2> {
        let mut x = inputs;
        for (i, [weight, bias]) in self.layers.iter().enumerate() {
            let last = i + 1 == self.layers.len();
            let activation = if last { self.output } else { self.activation };
            x = layer(x, weight.clone(), bias.clone(), activation);
        }
        x
    }

    /// The derivatives by the parameters, in the order of [`Network::parameters`]; 0 for those
    /// that the loss does not depend on.
    pub fn gradient(&self, grads: &Gradients) -> Vec<f32> {
        let one = |leaf: &Tensor<2>| match leaf.grad(grads) {
            Some(slopes) => floats(slopes),
            None => vec![0.0; leaf.dims().iter().product()],
        };
        self.leaves.iter().flat_map(one).collect()
    }
}
