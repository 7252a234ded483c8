//! A dense layer with its activation: one operation on the processor, several on an adapter.

use std::sync::Arc;

use burn_autodiff::Autodiff;
use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::NoCheckpointing;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_backend::TensorMetadata;
use burn_backend::ops::FloatTensorOps;
use burn_backend::tensor::FloatTensor;
use burn_tensor::{Tensor, activation};

use super::device::{Host, on_host, parts, primitive, values};
use crate::policy::{Activation, OutputActivation};
use crate::real::Real;

/// What follows the affine part of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curve {
    /// Of a hidden layer.
    Hidden(Activation),
    /// Of the last one.
    Last(OutputActivation),
}

/// `curve(x W + b)` `[rows, outputs]` for `x` `[rows, inputs]`, `W` `[inputs, outputs]` and `b`
/// `[1, outputs]`, with derivatives, on the device of `x`.
pub fn layer(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<2>, curve: Curve) -> Tensor<2> {
    match on_host(&x) {
        true => fused(x, weight, bias, curve),
        false => curved(x.matmul(weight) + bias, curve),
    }
}

/// The activation of `sums` as operations of the library: nothing leaves the device.
fn curved(sums: Tensor<2>, curve: Curve) -> Tensor<2> {
    match curve {
        Curve::Last(OutputActivation::Identity) => sums,
        Curve::Hidden(Activation::Relu) => activation::relu(sums),
        Curve::Hidden(Activation::Tanh) | Curve::Last(OutputActivation::Tanh) => sums.tanh(),
        Curve::Hidden(Activation::Silu) => activation::silu(sums),
    }
}

/// A layer on the processor.
///
/// The products are the library's; bias and activation are one pass over them, and so are both
/// derivatives. As operations of their own they took a third of the time of a training.
fn fused(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<2>, curve: Curve) -> Tensor<2> {
    let [(x, of_x), (weight, of_weight), (bias, of_bias)] = [x, weight, bias].map(parts::<Host>);
    let products = Host::float_matmul(x.clone(), weight.clone());
    let (device, shape) = (products.device(), products.shape().dims());
    let (mut outputs, bias) = (values::<Host>(products), values::<Host>(bias));
    for row in outputs.chunks_exact_mut(shape[1]) {
        row.iter_mut().zip(&bias).for_each(|(sum, bias)| *sum += bias);
    }
    let slopes = bend(&mut outputs, curve);
    let outputs = primitive::<Host>(outputs, shape, &device);
    let nodes = [of_x, of_weight, of_bias];
    let outputs = match Dense.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prep) => {
            prep.finish(Layered { x, weight, slopes: slopes.into() }, outputs)
        }
        OpsKind::UnTracked(prep) => prep.finish(outputs),
    };
    Tensor::from_primitive::<Autodiff<Host>>(outputs)
}

/// Puts the activation of each sum in its place; the derivatives there.
fn bend(sums: &mut [f32], curve: Curve) -> Vec<f32> {
    let each = |sums: &mut [f32], one: &dyn Fn(f32) -> [f32; 2]| {
        let bent = sums.iter_mut().map(|sum| {
            let [value, slope] = one(*sum);
            *sum = value;
            slope
        });
        bent.collect()
    };
    match curve {
        Curve::Last(OutputActivation::Identity) => vec![1.0; sums.len()],
        Curve::Hidden(Activation::Relu) => {
            let slopes = sums.iter().map(|sum| f32::from(u8::from(*sum > 0.0))).collect();
            sums.iter_mut().for_each(|sum| *sum = Activation::Relu.apply(*sum));
            slopes
        }
        Curve::Hidden(Activation::Tanh) | Curve::Last(OutputActivation::Tanh) => {
            each(sums, &|sum| {
                let value = Real::tanh(sum);
                [value, 1.0 - value * value]
            })
        }
        Curve::Hidden(Activation::Silu) => each(sums, &|sum| {
            let logistic = 0.5 + 0.5 * Real::tanh(0.5 * sum);
            [sum * logistic, logistic * (1.0 + sum * (1.0 - logistic))]
        }),
    }
}

/// The derivatives of a layer.
#[derive(Debug)]
struct Dense;

/// What they need.
#[derive(Clone, Debug)]
struct Layered {
    x: FloatTensor<Host>,
    weight: FloatTensor<Host>,
    /// Derivatives of the activation.
    slopes: Arc<[f32]>,
}

impl Backward<Host, 3> for Dense {
    type State = Layered;

    fn backward(self, ops: Ops<Layered, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let Layered { x, weight, slopes } = ops.state;
        let seeds = grads.consume::<Host>(&ops.node);
        let (device, shape) = (seeds.device(), seeds.shape().dims());
        let mut seeds = values::<Host>(seeds);
        seeds.iter_mut().zip(&*slopes).for_each(|(seed, slope)| *seed *= slope);
        let mut sums = vec![0.0; shape[1]];
        for row in seeds.chunks_exact(shape[1]) {
            sums.iter_mut().zip(row).for_each(|(sum, seed)| *sum += seed);
        }
        let seeds = primitive::<Host>(seeds, shape, &device);
        let [to_x, to_weight, to_bias] = ops.parents;
        if let Some(node) = to_x {
            let slopes = Host::float_matmul(seeds.clone(), Host::float_transpose(weight));
            grads.register::<Host>(node.id, slopes);
        }
        if let Some(node) = to_weight {
            grads.register::<Host>(node.id, Host::float_matmul(Host::float_transpose(x), seeds));
        }
        if let Some(node) = to_bias {
            let sums = primitive::<Host>(sums, [1, shape[1]], &device);
            grads.register::<Host>(node.id, sums);
        }
    }
}
