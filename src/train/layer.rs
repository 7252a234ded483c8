//! A dense layer with its activation as one operation on tensors.

use std::sync::Arc;

use burn_autodiff::checkpoint::base::Checkpointer;
use burn_autodiff::checkpoint::strategy::NoCheckpointing;
use burn_autodiff::grads::Gradients;
use burn_autodiff::ops::{Backward, Ops, OpsKind};
use burn_tensor::{Tensor, TensorPrimitive};

use super::network::{Differentiable, Plain};
use super::physics::{floats, tensor};
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
/// `[1, outputs]`, with derivatives.
///
/// The products are the library's; bias and activation are one pass over them, and so are both
/// derivatives. As operations of their own they took a third of the time of a training.
pub fn layer(
    x: Tensor<Differentiable, 2>,
    weight: Tensor<Differentiable, 2>,
    bias: Tensor<Differentiable, 2>,
    curve: Curve,
) -> Tensor<Differentiable, 2> {
    let parents = [&x, &weight, &bias].map(|t| t.clone().into_primitive().tensor().node);
    let (x, weight) = (x.inner(), weight.inner());
    let products = x.clone().matmul(weight.clone());
    let [rows, columns] = products.dims();
    let (mut outputs, bias) = (floats(products), floats(bias.inner()));
    for row in outputs.chunks_exact_mut(columns) {
        row.iter_mut().zip(&bias).for_each(|(sum, bias)| *sum += bias);
    }
    let slopes = bend(&mut outputs, curve);
    let outputs = tensor::<Plain>(outputs, [rows, columns]).into_primitive().tensor();
    let outputs = match Dense.prepare::<NoCheckpointing>(parents).compute_bound().stateful() {
        OpsKind::Tracked(prep) => {
            prep.finish(Layered { x, weight, slopes: slopes.into() }, outputs)
        }
        OpsKind::UnTracked(prep) => prep.finish(outputs),
    };
    Tensor::from_primitive(TensorPrimitive::Float(outputs))
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
    x: Tensor<Plain, 2>,
    weight: Tensor<Plain, 2>,
    /// Derivatives of the activation.
    slopes: Arc<[f32]>,
}

impl Backward<Plain, 3> for Dense {
    type State = Layered;

    fn backward(self, ops: Ops<Layered, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let Layered { x, weight, slopes } = ops.state;
        let seeds = grads.consume::<Plain>(&ops.node);
        let seeds = Tensor::<Plain, 2>::from_primitive(TensorPrimitive::Float(seeds));
        let shape = seeds.dims();
        let mut seeds = floats(seeds);
        seeds.iter_mut().zip(&*slopes).for_each(|(seed, slope)| *seed *= slope);
        let mut sums = vec![0.0; shape[1]];
        for row in seeds.chunks_exact(shape[1]) {
            sums.iter_mut().zip(row).for_each(|(sum, seed)| *sum += seed);
        }
        let seeds = tensor::<Plain>(seeds, shape);
        let mut register = |parent: usize, slopes: &dyn Fn() -> Tensor<Plain, 2>| {
            if let Some(parent) = &ops.parents[parent] {
                grads.register::<Plain>(parent.id, slopes().into_primitive().tensor());
            }
        };
        register(0, &|| seeds.clone().matmul(weight.clone().transpose()));
        register(1, &|| x.clone().transpose().matmul(seeds.clone()));
        register(2, &|| tensor(sums.clone(), [1, shape[1]]));
    }
}
