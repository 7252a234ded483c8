//! f64 lanes: many numbers of the oracle side by side, each with the bits that it has by itself.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::simd::{Body, Instructions};
use super::{Real, per_lane};

/// `N` f64 numbers that go through the same formula side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wide<const N: usize>(pub(crate) [f64; N]);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<const N: usize> $trait for Wide<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, rhs: Self) -> Self {
                Self(per_lane!(N, i => self.0[i] $op rhs.0[i]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl<const N: usize> Neg for Wide<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(per_lane!(N, i => -self.0[i]))
    }
}

/// Functions of one number, as f64 has them.
macro_rules! of_one {
    ($($name:ident),*) => {
        $(fn $name(self) -> Self {
            Self(per_lane!(N, i => Real::$name(self.0[i])))
        })*
    };
}

/// Functions of two numbers, as f64 has them.
macro_rules! of_two {
    ($($name:ident),*) => {
        $(fn $name(self, rhs: Self) -> Self {
            Self(per_lane!(N, i => Real::$name(self.0[i], rhs.0[i])))
        })*
    };
}

impl<const N: usize> Real for Wide<N> {
    fn lit(value: f32) -> Self {
        Self([f64::from(value); N])
    }

    of_one!(abs, sqrt, floor, sign, wrap, sin, cos, tan, asin, acos, atan, exp, ln, tanh, sigmoid);
    of_one!(exp_negative, ln_unit, power_of_two);
    of_two!(min, max, hypot, atan2);

    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        Self(per_lane!(N, i => Real::if_lt(self.0[i], rhs.0[i], yes.0[i], no.0[i])))
    }

    fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        Self(per_lane!(N, i => Real::select_lt(self.0[i], rhs.0[i], yes.0[i], no.0[i])))
    }

    fn clamp(self, low: Self, high: Self) -> Self {
        Self(per_lane!(N, i => Real::clamp(self.0[i], low.0[i], high.0[i])))
    }

    fn powi(self, exponent: i32) -> Self {
        Self(per_lane!(N, i => Real::powi(self.0[i], exponent)))
    }

    fn powf(self, exponent: f32) -> Self {
        Self(per_lane!(N, i => Real::powf(self.0[i], exponent)))
    }

    fn principal_sin_cos(self) -> [Self; 2] {
        let both: [[f64; 2]; N] = std::array::from_fn(|i| self.0[i].principal_sin_cos());
        [0, 1].map(|side| Self(per_lane!(N, i => both[i][side])))
    }

    fn dense(weight: &[f32], bias: &[f32], inputs: &[Self]) -> Vec<Self> {
        Instructions::fastest().run(Dense { weight, bias, inputs })
    }
}

/// A dense layer, compiled for the instructions that the processor has.
struct Dense<'a, const N: usize> {
    weight: &'a [f32],
    bias: &'a [f32],
    inputs: &'a [Wide<N>],
}

impl<const N: usize> Body for Dense<'_, N> {
    type Output = Vec<Wide<N>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { weight, bias, inputs } = self;
        let mut sums = vec![Wide([0.0; N]); bias.len()];
        for (output, sum) in sums.iter_mut().enumerate() {
            let row = &weight[output * inputs.len()..(output + 1) * inputs.len()];
            let mut total = [f64::from(bias[output]); N];
            for (weight, input) in row.iter().zip(inputs) {
                let weight = f64::from(*weight);
                // Never contracted: the bits are those of one number at a time.
                for (total, x) in total.iter_mut().zip(&input.0) {
                    *total += weight * x;
                }
            }
            sum.0 = total;
        }
        sums
    }
}
