//! Elementary functions as polynomials in + - * / and comparisons, the same bits everywhere.
//!
//! A NaN flows through each: where a choice is made by [`Real::select_lt`], both sides are NaN, and
//! where only one would be, a function that hands it on is used. `exp_negative` alone drops it.

mod angle;
mod exponential;
#[cfg(test)]
mod tests;

use super::Real;
pub(super) use angle::{acos, asin, atan, atan2, cos, principal_sin_cos, sin, tan, wrap};
#[cfg(feature = "train")]
pub(crate) use exponential::{NORMAL_END, NORMAL_SERIES};
pub(super) use exponential::{
    exp, exp_m1_negative, exp_negative, ln, ln_unit, normal_share, parts, power, power_of_two,
    sigmoid, softplus_excess, tanh, unit_parts, whole_power,
};

/// A constant exponent, as the power is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Exponent {
    /// Repeated products.
    Whole(i32),
    /// The square root.
    Root,
    /// Exponential and logarithm.
    Other,
}

impl Exponent {
    /// The kind of `exponent`.
    pub(super) fn of(exponent: f32) -> Self {
        // Whole f32 below 2^31 are whole i32.
        if exponent.trunc() == exponent && exponent.abs() < 2_147_483_648.0 {
            return Self::Whole(exponent as i32);
        }
        if exponent == 0.5 { Self::Root } else { Self::Other }
    }
}

/// `c[0] + x (c[1] + x (...))`.
#[inline(always)]
fn polynomial<R: Real, const N: usize>(x: R, coefficients: [f32; N]) -> R {
    let mut sum = R::lit(coefficients[N - 1]);
    for i in (0..N - 1).rev() {
        sum = sum * x + R::lit(coefficients[i]);
    }
    sum
}
