//! Activations from their definitions, in f64: an oracle that shares nothing with the program.

use reachcast::policy::Activation;
use statrs::function::erf::erfc;

/// Each kind, and those with parameters with others than the defaults besides.
pub(crate) fn activations() -> Vec<Activation> {
    let other = [
        Activation::LeakyRelu { slope: 0.2 },
        Activation::LeakyRelu { slope: 0.0 },
        Activation::LeakyRelu { slope: 1.5 },
        Activation::Elu { alpha: 0.5 },
        Activation::Elu { alpha: 2.0 },
        Activation::Celu { alpha: 0.3 },
        Activation::Celu { alpha: 2.5 },
        Activation::Softplus { beta: 3.0 },
        Activation::Softplus { beta: 0.4 },
        Activation::Hardtanh { low: -2.0, high: 0.5 },
    ];
    Activation::ALL.into_iter().chain(other).collect()
}

/// `activation` at a finite `x`.
pub(crate) fn exact(activation: Activation, x: f64) -> f64 {
    let number = |value: f32| f64::from(value);
    // The numbers of f32 that the program has, and the product that it makes of two.
    let [scale, below] = [number(1.050_701), number(1.050_701 * 1.673_263_2)];
    let [first, third] = [number(0.797_884_6), number(0.035_677_407)];
    match activation {
        Activation::Identity => x,
        Activation::Relu => x.max(0.0),
        Activation::LeakyRelu { slope } => {
            if x < 0.0 {
                number(slope) * x
            } else {
                x
            }
        }
        Activation::Elu { alpha } => {
            if x < 0.0 {
                number(alpha) * x.exp_m1()
            } else {
                x
            }
        }
        Activation::Selu => {
            if x < 0.0 {
                below * x.exp_m1()
            } else {
                scale * x
            }
        }
        Activation::Celu { alpha } => {
            let alpha = number(alpha);
            if x < 0.0 { alpha * (x / alpha).exp_m1() } else { x }
        }
        Activation::Gelu => 0.5 * x * erfc(-x / std::f64::consts::SQRT_2),
        Activation::GeluTanh => {
            let inner = x * (first + third * x * x);
            0.5 * x * (1.0 + inner.tanh())
        }
        Activation::Silu => x / (1.0 + (-x).exp()),
        Activation::Mish => x * (x.max(0.0) + (-x.abs()).exp().ln_1p()).tanh(),
        Activation::Tanh => x.tanh(),
        Activation::Sigmoid => 1.0 / (1.0 + (-x).exp()),
        Activation::Softplus { beta } => {
            let beta = number(beta);
            ((beta * x).max(0.0) + (-(beta * x).abs()).exp().ln_1p()) / beta
        }
        Activation::Softsign => x / (1.0 + x.abs()),
        Activation::Hardtanh { low, high } => x.clamp(number(low), number(high)),
        Activation::Relu6 => x.clamp(0.0, 6.0),
    }
}

/// What it goes to beyond all numbers, on the side of `sign`.
pub(crate) fn limit(activation: Activation, sign: f64) -> f64 {
    match activation {
        Activation::LeakyRelu { slope: 0.0 } if sign < 0.0 => 0.0,
        Activation::Identity | Activation::LeakyRelu { .. } => sign * f64::INFINITY,
        Activation::Gelu | Activation::GeluTanh | Activation::Silu | Activation::Mish
            if sign < 0.0 =>
        {
            0.0
        }
        Activation::Softsign => sign,
        other if sign < 0.0 => exact(other, -1e4),
        Activation::Tanh
        | Activation::Sigmoid
        | Activation::Hardtanh { .. }
        | Activation::Relu6 => exact(activation, 1e4),
        _ => f64::INFINITY,
    }
}

/// Where its slope jumps.
pub(crate) fn corners(activation: Activation) -> Vec<f64> {
    match activation {
        Activation::Hardtanh { low, high } => vec![f64::from(low), f64::from(high)],
        Activation::Relu6 => vec![0.0, 6.0],
        _ => vec![0.0],
    }
}
