//! Slopes of activations at a number, for the derivatives of training.

use super::Activation;
use crate::real::Real;

/// `1 / sqrt(2 pi)`.
const DENSITY: f32 = 0.398_942_3;

impl Activation {
    /// Its slope at `x`; at a corner that of the left side, as other libraries have it.
    pub(crate) fn slope_at(self, x: f32) -> f32 {
        let step = |inside: bool| f32::from(u8::from(inside));
        let exponential = |scale: f32| scale * (x.exp_m1_negative() + 1.0);
        match self {
            Self::Identity => 1.0,
            Self::Relu => step(x > 0.0),
            Self::LeakyRelu { slope } => {
                if x > 0.0 {
                    1.0
                } else {
                    slope
                }
            }
            Self::Elu { alpha } => {
                if x > 0.0 {
                    1.0
                } else {
                    exponential(alpha)
                }
            }
            Self::Selu => {
                let [scale, alpha] = Self::SELU;
                if x > 0.0 { scale } else { exponential(scale * alpha) }
            }
            Self::Celu { alpha } => {
                if x > 0.0 {
                    1.0
                } else {
                    (x / alpha).exp_m1_negative() + 1.0
                }
            }
            Self::Gelu => {
                0.5 + 0.5 * x.normal_share() + x * DENSITY * (-0.5 * x * x).exp_negative()
            }
            Self::GeluTanh => {
                let [first, third] = Self::GELU_TANH;
                let tanh = Real::tanh(x * (first + third * x * x));
                // Where the tangent is flat, its factor may be infinite.
                let inner = x.clamp(-5.0, 5.0)
                    * (first + 3.0 * third * x.clamp(-5.0, 5.0) * x.clamp(-5.0, 5.0));
                0.5 * (1.0 + tanh) + 0.5 * inner * (1.0 - tanh * tanh)
            }
            Self::Silu => {
                let logistic = 0.5 + 0.5 * Real::tanh(0.5 * x);
                logistic * (1.0 + x * (1.0 - logistic))
            }
            Self::Mish => {
                let e = Real::exp(x.clamp(-80.0, 20.0));
                let n = e * (e + 2.0);
                let tanh = n / (n + 2.0);
                tanh + x.clamp(-80.0, 20.0) * Real::sigmoid(x) * (1.0 - tanh * tanh)
            }
            Self::Tanh => {
                let value = Real::tanh(x);
                1.0 - value * value
            }
            Self::Sigmoid => {
                let value = Real::sigmoid(x);
                value * (1.0 - value)
            }
            Self::Softplus { beta } => Real::sigmoid(beta * x),
            Self::Softsign => {
                let below = 1.0 + Real::abs(x);
                1.0 / (below * below)
            }
            Self::Hardtanh { low, high } => step(low < x && x < high),
            Self::Relu6 => step(0.0 < x && x < 6.0),
        }
    }
}
