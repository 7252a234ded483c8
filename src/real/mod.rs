//! The scalar trait that physics is written over, and its instances.

mod approx;
pub mod bound;
mod lanes;
mod scalar;
pub(crate) mod simd;
mod vector;

use std::ops::{Add, Div, Mul, Neg, Sub};

pub use lanes::Lanes;
pub(crate) use lanes::per_lane;
pub(crate) use vector::{Vector, load_rows, store_rows};

/// A real number as far as a system, cost or policy formula may know it.
///
/// One formula over `Real` is evaluated as f32, as f64 (the oracle), as SIMD [`Lanes`], as a
/// sound bound ([`bound::Bound`]) and recorded as a graph ([`crate::formula::Expr`]) that is printed as
/// WGSL. There is no `if` on values: both branches of [`Real::if_lt`] are evaluated. The
/// elementary functions are polynomials in the primitives, so that f32, lanes and recorded
/// expressions give equal bits wherever the device rounds correctly and does not contract.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number `value`; an f64 instance gets exactly the f32.
    fn lit(value: f32) -> Self;
    /// The parameter `name` of a system, whose value is `value`: an input where the system declares
    /// it ([`crate::system::System::parameters`]) and is recorded, elsewhere the number itself.
    #[inline(always)]
    fn parameter(_name: &str, value: f32) -> Self {
        Self::lit(value)
    }
    /// Absolute value.
    fn abs(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Largest integer not above `self`.
    fn floor(self) -> Self;
    /// `yes` where `self < rhs`, else `no` (also where either is NaN).
    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self;

    /// The smaller of two; `rhs` where they cannot be compared.
    #[inline(always)]
    fn min(self, rhs: Self) -> Self {
        self.if_lt(rhs, self, rhs)
    }

    /// The larger of two; `rhs` where they cannot be compared.
    #[inline(always)]
    fn max(self, rhs: Self) -> Self {
        rhs.if_lt(self, self, rhs)
    }

    /// `self` within `[low, high]`; NaN stays NaN.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        let floored = self.if_lt(low, low, self);
        high.if_lt(floored, high, floored)
    }

    /// Euclidean length of `(self, rhs)`.
    ///
    /// A primitive of its own because the bound type knows that its gradient has unit length,
    /// which interval arithmetic on the square root cannot see.
    #[inline(always)]
    fn hypot(self, rhs: Self) -> Self {
        (self * self + rhs * rhs).sqrt()
    }

    /// Sine of an angle in radians, for `|self|` up to 8192.
    #[inline(always)]
    fn sin(self) -> Self {
        approx::sin(self)
    }

    /// Cosine of an angle in radians, for `|self|` up to 8192.
    #[inline(always)]
    fn cos(self) -> Self {
        approx::cos(self)
    }

    /// Sine and cosine of an angle within `[-pi, pi]`, with the bits of [`Real::sin`] and
    /// [`Real::cos`].
    #[inline(always)]
    fn principal_sin_cos(self) -> [Self; 2] {
        approx::principal_sin_cos(self)
    }

    /// Hyperbolic tangent.
    #[inline(always)]
    fn tanh(self) -> Self {
        approx::tanh(self)
    }

    /// Exponential of a number that is not positive; 0 below -87, where f32 has no normal numbers.
    #[inline(always)]
    fn exp_negative(self) -> Self {
        approx::exp_negative(self)
    }

    /// Natural logarithm of a number in `[2^-24, 1]`, the range of a uniform draw.
    #[inline(always)]
    fn ln_unit(self) -> Self {
        approx::ln_unit(self)
    }

    /// Of a number in `[2^-24, 1]` that is `m 2^e`, the mantissa `m`, from the root of 1/2 to twice
    /// that, and the whole number `e`.
    #[inline(always)]
    fn unit_parts(self) -> [Self; 2] {
        approx::unit_parts(self)
    }
}
