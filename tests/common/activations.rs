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
    let [scale, slope] = [1.050_700_987_355_480_5, 1.673_263_242_354_377_2];
    let number = |value: f32| f64::from(value);
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
        Activation::Selu => scale * if x < 0.0 { slope * x.exp_m1() } else { x },
        Activation::Celu { alpha } => {
            let alpha = number(alpha);
            if x < 0.0 { alpha * (x / alpha).exp_m1() } else { x }
        }
        Activation::Gelu => 0.5 * x * erfc(-x / std::f64::consts::SQRT_2),
        Activation::GeluTanh => {
            let inner = (2.0 / std::f64::consts::PI).sqrt() * (x + 0.044_715 * x.powi(3));
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
