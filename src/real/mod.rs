//! The scalar trait that physics is written over, and its instances.

mod approx;
pub mod bound;
mod interval;
mod lanes;
mod normal;
mod scalar;
pub(crate) mod simd;
mod vector;
mod wide;

use std::ops::{Add, Div, Mul, Neg, Sub};

#[cfg(feature = "train")]
pub(crate) use approx::{NORMAL_END, NORMAL_SERIES};
pub use lanes::Lanes;
pub(crate) use lanes::per_lane;
pub(crate) use vector::{Vector, load_rows, store_rows};
pub(crate) use wide::Wide;

/// A real number as far as a system, cost or policy formula may know it.
///
/// One formula over `Real` is evaluated as f32, as f64 (the oracle), as SIMD [`Lanes`], as a
/// sound bound ([`bound::Bound`]) and recorded as a graph ([`crate::formula::Expr`]) that is printed as
/// WGSL. There is no `if` on values: both branches of [`Real::if_lt`] are evaluated. The
/// elementary functions are polynomials in the primitives, so that f32, lanes and recorded
/// expressions give equal bits wherever the device rounds correctly and does not contract; f64
/// has the platform's functions.
///
/// **A NaN never disappears.** Every operation whose result depends on a NaN is NaN, choices
/// included; [`Real::select_lt`] and [`Real::exp_negative`] alone drop one, as they say.
///
/// **Errors** are those of f32 against the exact function, the largest over at least a million numbers
/// of the range: in units in the last place (ulp) where the value stays away from 0, absolute
/// where it passes 0. Subnormal results are a device's own affair: it may take them for 0.
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
    /// Square root; NaN below 0.
    fn sqrt(self) -> Self;
    /// Largest integer not above `self`.
    fn floor(self) -> Self;
    /// `yes` where `self < rhs`, `no` where not, NaN where either is NaN.
    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self;
    /// The same, but `no` where either is NaN: the bare choice of a processor, for formulas in which a
    /// NaN flows on whatever is chosen.
    fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self;

    /// A dense layer, `weight x + bias`: `weight` is `[outputs, inputs]` row by row, the result
    /// `[outputs]`. Each sum begins with the bias and takes the inputs in order.
    ///
    /// An operation of its own because the bound type takes whole layers: neuron by neuron, its pieces
    /// would multiply.
    fn dense(weight: &[f32], bias: &[f32], inputs: &[Self]) -> Vec<Self> {
        let sum = |(row, bias): (&[f32], &f32)| {
            let terms = row.iter().zip(inputs);
            terms.fold(Self::lit(*bias), |sum, (&w, &x)| sum + Self::lit(w) * x)
        };
        weight.chunks(inputs.len().max(1)).zip(bias).map(sum).collect()
    }

    /// `yes` where `self <= rhs`, `no` where not, NaN where either is NaN.
    #[inline(always)]
    fn if_le(self, rhs: Self, yes: Self, no: Self) -> Self {
        rhs.if_lt(self, no, yes)
    }

    /// `yes` where `self == rhs`, `no` where not, NaN where either is NaN.
    #[inline(always)]
    fn if_eq(self, rhs: Self, yes: Self, no: Self) -> Self {
        self.if_lt(rhs, no, rhs.select_lt(self, no, yes))
    }

    /// The smaller of two; of two zeros `rhs`.
    #[inline(always)]
    fn min(self, rhs: Self) -> Self {
        self.if_lt(rhs, self, rhs)
    }

    /// The larger of two; of two zeros `rhs`.
    #[inline(always)]
    fn max(self, rhs: Self) -> Self {
        rhs.if_lt(self, self, rhs)
    }

    /// `self`, and `low`, a number, where it is below.
    #[inline(always)]
    fn at_least(self, low: Self) -> Self {
        self.if_lt(low, low, self)
    }

    /// `self` within `[low, high]`.
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        let floored = self.if_lt(low, low, self);
        high.if_lt(floored, high, floored)
    }

    /// 1 above 0, -1 below, a zero as it is.
    #[inline(always)]
    fn sign(self) -> Self {
        let zero = Self::lit(0.0);
        let rest = self.select_lt(zero, Self::lit(-1.0), self);
        zero.select_lt(self, Self::lit(1.0), rest)
    }

    /// Euclidean length of `(self, rhs)`.
    ///
    /// A primitive of its own because the bound type knows that its gradient has unit length,
    /// which interval arithmetic on the square root cannot see.
    #[inline(always)]
    fn hypot(self, rhs: Self) -> Self {
        (self * self + rhs * rhs).sqrt()
    }

    /// `self` to a whole power, by repeated products: one rounding each, about 2 log2 of the exponent.
    #[inline(always)]
    fn powi(self, exponent: i32) -> Self {
        approx::whole_power(self, exponent)
    }

    /// `self` to a constant power: [`Real::powi`] where that is whole, [`Real::sqrt`] where it is 1/2.
    ///
    /// Any other is the exponential of `exponent ln(self)`: NaN below 0; at 0 it is 0, infinite under a
    /// negative exponent. Relative error below `3e-7 (1 + |exponent ln(self)|)`.
    #[inline(always)]
    fn powf(self, exponent: f32) -> Self {
        match approx::Exponent::of(exponent) {
            approx::Exponent::Whole(exponent) => self.powi(exponent),
            approx::Exponent::Root => self.sqrt(),
            approx::Exponent::Other => approx::power(self, exponent),
        }
    }

    /// Sine of an angle in radians: error below 3e-7 for `|self|` up to 8192. Beyond, it grows with the
    /// angle, and from 1e5 on the result means nothing.
    #[inline(always)]
    fn sin(self) -> Self {
        approx::sin(self)
    }

    /// Cosine of an angle in radians: error below 5e-7, as that of [`Real::sin`].
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

    /// Tangent of an angle in radians: error below 3.5 ulp for `|self|` up to 1.5; up to 8192 below 5 ulp
    /// and what an error of the angle of 5e-8 makes of it. Beyond as [`Real::sin`].
    #[inline(always)]
    fn tan(self) -> Self {
        approx::tan(self)
    }

    /// Arc sine, in `[-pi/2, pi/2]`: error below 2.5 ulp; NaN beyond `[-1, 1]`.
    #[inline(always)]
    fn asin(self) -> Self {
        approx::asin(self)
    }

    /// Arc cosine, in `[0, pi]`: error below 1.5 ulp; NaN beyond `[-1, 1]`.
    #[inline(always)]
    fn acos(self) -> Self {
        approx::acos(self)
    }

    /// Arc tangent, in `[-pi/2, pi/2]`: error below 3 ulp.
    #[inline(always)]
    fn atan(self) -> Self {
        approx::atan(self)
    }

    /// The angle of the point `(x, self)`, in `[-pi, pi]`: error below 3e-7, where neither coordinate is
    /// subnormal. 0 at the origin; pi on the negative half of the axis, for a negative zero too.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        approx::atan2(self, x)
    }

    /// `self`, an angle in radians, less a multiple of `2 pi`: in `[-pi, pi)`, with the f32 pi in f32.
    /// Error below 4e-7 for `|self|` up to 8192, modulo a turn; 0.04 up to 1e6, where neighbouring
    /// numbers are 0.06 apart; NaN from 4.2e6 on.
    #[inline(always)]
    fn wrap(self) -> Self {
        approx::wrap(self)
    }

    /// Exponential: error below 1.1 ulp from -87.3 on, 1.5e-45 below; infinite above 88.722839.
    #[inline(always)]
    fn exp(self) -> Self {
        approx::exp(self)
    }

    /// Natural logarithm: error below 1.3 ulp, 6e-8 in `[0.5, 2]`; NaN of 0 and below.
    #[inline(always)]
    fn ln(self) -> Self {
        approx::ln(self)
    }

    /// Hyperbolic tangent: error below 4e-7 everywhere.
    #[inline(always)]
    fn tanh(self) -> Self {
        approx::tanh(self)
    }

    /// Logistic function, `1 / (1 + exp(-self))`: error below 2.6 ulp from -87 on, 1.2e-38 below.
    #[inline(always)]
    fn sigmoid(self) -> Self {
        approx::sigmoid(self)
    }

    /// Exponential of a number that is not positive; 0 below -87, where f32 has no normal numbers,
    /// and of NaN: the weight of a sample whose cost is no number.
    #[inline(always)]
    fn exp_negative(self) -> Self {
        approx::exp_negative(self)
    }

    /// `exp(self) - 1` of a number that is not positive, of any other 0: error below 5 ulp.
    #[inline(always)]
    fn exp_m1_negative(self) -> Self {
        approx::exp_m1_negative(self)
    }

    /// By what `ln(1 + exp(self))` lies above the larger of 0 and `self`: `ln(1 + exp(-|self|))`. Error below
    /// 4 ulp down to 1e-37. Of no meaning for NaN.
    #[inline(always)]
    fn softplus_excess(self) -> Self {
        approx::softplus_excess(self)
    }

    /// The probability of a standard normal number within `|self|`, with the sign of `self`:
    /// `erf(self / sqrt(2))`. Error below 4e-7 everywhere.
    #[inline(always)]
    fn normal_share(self) -> Self {
        approx::normal_share(self)
    }

    /// The function of it whose values and slopes over an interval are `range`, where that is all that is asked: of
    /// the bound type. Any other number has to take its formula.
    #[inline(always)]
    fn known_by(
        self,
        _range: impl Fn(interval::Interval) -> (interval::Interval, interval::Interval),
    ) -> Option<Self> {
        None
    }

    /// Natural logarithm of a number in `[2^-24, 1]`, the range of a uniform draw; the bits of
    /// [`Real::ln`]. Of no meaning for others, a NaN included, nor the same in every instance: see
    /// [`Real::unit_parts`]. A model's text has [`Real::ln`] alone.
    #[inline(always)]
    fn ln_unit(self) -> Self {
        approx::ln_unit(self)
    }

    /// Of a number in `[2^-24, 1]` that is `m 2^e`, the mantissa `m`, from the root of 1/2 to twice
    /// that, and the whole number `e`.
    ///
    /// Every draw of noise comes through here, so vectors take both from the bits in five operations,
    /// where the formula compares ten times. Beyond the range the two differ.
    #[inline(always)]
    fn unit_parts(self) -> [Self; 2] {
        approx::unit_parts(self)
    }

    /// The same of any positive finite number; of no meaning for others.
    #[inline(always)]
    fn parts(self) -> [Self; 2] {
        approx::parts(self)
    }

    /// Two to a whole number in `[-75, 75]`; of no meaning for others.
    #[inline(always)]
    fn power_of_two(self) -> Self {
        approx::power_of_two(self)
    }
}
