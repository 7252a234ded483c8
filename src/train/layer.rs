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
use burn_tensor::Tensor;
use burn_tensor::activation as library;

use super::device::{Host, on_host, parts, primitive, values};
use crate::policy::Activation;
use crate::real::{NORMAL_END, NORMAL_SERIES, Real};

/// `activation(x W + b)` `[rows, outputs]` for `x` `[rows, inputs]`, `W` `[inputs, outputs]` and `b`
/// `[1, outputs]`, with derivatives, on the device of `x`.
pub fn layer(
    x: Tensor<2>,
    weight: Tensor<2>,
    bias: Tensor<2>,
    activation: Activation,
) -> Tensor<2> {
    match on_host(&x) {
        true => fused(x, weight, bias, activation),
        false => curved(x.matmul(weight) + bias, activation),
    }
}

/// `erf(x / sqrt(2))` as the engine has it: the error function of an adapter is good to three digits alone.
fn normal_share(x: Tensor<2>) -> Tensor<2> {
    let x = x.clamp(-NORMAL_END, NORMAL_END);
    let square = x.clone() * x.clone();
    let [first, .., last] = NORMAL_SERIES;
    let middle = NORMAL_SERIES[1..6].iter().rev();
    let series = middle.fold(square.clone() * last, |sum, term| (sum + *term) * square.clone());
    (x * (series + first)).tanh()
}

/// The activation of `sums` as operations of the library: nothing leaves the device.
fn curved(sums: Tensor<2>, activation: Activation) -> Tensor<2> {
    // `scale (exp(x / width) - 1)` below 0.
    let below =
        |scale: f32, width: f32| ((sums.clone().clamp_max(0.0) / width).exp() - 1.0) * scale;
    let above = || library::relu(sums.clone());
    match activation {
        Activation::Identity => sums,
        Activation::Relu => library::relu(sums),
        Activation::LeakyRelu { slope } => library::leaky_relu(sums, f64::from(slope)),
        Activation::Elu { alpha } => above() + below(alpha, 1.0),
        Activation::Selu => {
            let [scale, alpha] = Activation::SELU;
            above() * scale + below(scale * alpha, 1.0)
        }
        Activation::Celu { alpha } => above() + below(alpha, alpha),
        Activation::Gelu => sums.clone() * 0.5 * (normal_share(sums) + 1.0),
        Activation::GeluTanh => {
            let [first, third] = Activation::GELU_TANH;
            let cube = sums.clone().powi_scalar(3) * third;
            let inside = sums.clone() * first + cube;
            sums * 0.5 * (inside.tanh() + 1.0)
        }
        Activation::Silu => library::silu(sums),
        Activation::Mish => library::mish(sums),
        Activation::Tanh => sums.tanh(),
        Activation::Sigmoid => library::sigmoid(sums),
        Activation::Softplus { beta } => {
            above() + (-(sums.clone() * beta).abs()).exp().log1p() / beta
        }
        Activation::Softsign => sums.clone() / (sums.abs() + 1.0),
        Activation::Hardtanh { low, high } => sums.clamp(low, high),
        Activation::Relu6 => sums.clamp(0.0, 6.0),
    }
}

/// A layer on the processor.
///
/// The products are the library's; bias and activation are one pass over them, and so are both
/// derivatives. As operations of their own they took a third of the time of a training.
fn fused(x: Tensor<2>, weight: Tensor<2>, bias: Tensor<2>, activation: Activation) -> Tensor<2> {
    let [(x, of_x), (weight, of_weight), (bias, of_bias)] = [x, weight, bias].map(parts::<Host>);
    let products = Host::float_matmul(x.clone(), weight.clone());
    let (device, shape) = (products.device(), products.shape().dims());
    let (mut outputs, bias) = (values::<Host>(products), values::<Host>(bias));
    for row in outputs.chunks_exact_mut(shape[1]) {
        row.iter_mut().zip(&bias).for_each(|(sum, bias)| *sum += bias);
    }
    let slopes = bend(&mut outputs, activation);
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
fn bend(sums: &mut [f32], activation: Activation) -> Vec<f32> {
    let each = |sums: &mut [f32], one: &dyn Fn(f32) -> [f32; 2]| {
        let bent = sums.iter_mut().map(|sum| {
            let [value, slope] = one(*sum);
            *sum = value;
            slope
        });
        bent.collect()
    };
    match activation {
        Activation::Identity => vec![1.0; sums.len()],
        Activation::Relu => {
            let slopes = sums.iter().map(|sum| f32::from(u8::from(*sum > 0.0))).collect();
            sums.iter_mut().for_each(|sum| *sum = Activation::Relu.apply(*sum));
            slopes
        }
        Activation::Tanh => each(sums, &|sum| {
            let value = Real::tanh(sum);
            [value, 1.0 - value * value]
        }),
        Activation::Silu => each(sums, &|sum| {
            let logistic = 0.5 + 0.5 * Real::tanh(0.5 * sum);
            [sum * logistic, logistic * (1.0 + sum * (1.0 - logistic))]
        }),
        other => each(sums, &|sum| [other.apply(sum), other.slope_at(sum)]),
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
