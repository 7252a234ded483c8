//! Exponentials, logarithms and powers.

use super::{Real, polynomial};

/// `ln 2` in two parts, the first exact in products with integers up to 2^8.
const LN_2_PARTS: [f32; 2] = [0.693_145_75, 1.428_606_8e-6];

/// `2^64` and its inverse.
const LARGE: f32 = 18_446_744_073_709_551_616.0;
const SMALL: f32 = 1.0 / LARGE;

/// Binary digits that a whole number up to 191 is made of, with two to their power.
const DIGITS: [(f32, f32); 8] = [
    (64.0, LARGE),
    (64.0, LARGE),
    (32.0, 4_294_967_296.0),
    (16.0, 65_536.0),
    (8.0, 256.0),
    (4.0, 16.0),
    (2.0, 4.0),
    (1.0, 2.0),
];

/// Digits of a number up to 127, with a half to their power.
const HALVINGS: [(f32, f32); 7] = [
    (64.0, SMALL),
    (32.0, 1.0 / 4_294_967_296.0),
    (16.0, 1.0 / 65_536.0),
    (8.0, 1.0 / 256.0),
    (4.0, 1.0 / 16.0),
    (2.0, 0.25),
    (1.0, 0.5),
];

/// Hyperbolic tangent: an odd rational function fitted to relative error 9e-9, within 4e-7 of the
/// truth after rounding; saturates to 1 at 8.2, where the truth is 1.5e-7 below.
#[inline(always)]
pub(in crate::real) fn tanh<R: Real>(x: R) -> R {
    let x = x.clamp(R::lit(-SATURATED), R::lit(SATURATED));
    let [above, below] = tanh_parts(x);
    x * (above / below)
}

/// Where the hyperbolic tangent is 1.
const SATURATED: f32 = 8.2;

/// Numerator and denominator of `tanh(x) / x` for `|x|` up to 8.2.
#[inline(always)]
fn tanh_parts<R: Real>(x: R) -> [R; 2] {
    let square = x * x;
    let above = [1.0, 0.134_345_38, 0.003_559_528_6, 2.168_320_3e-5, 1.490_322_2e-8];
    let below = [1.0, 0.467_678_67, 0.026_119_178, 0.000_339_104_97, 8.396_420_4e-7];
    [polynomial(square, above), polynomial(square, below)]
}

/// `exp(x) - 1` of `x <= 0`: `2 t / (1 - t)` with `t = tanh(x / 2)`, a quotient of the same polynomials. No
/// difference of it cancels.
#[inline(always)]
pub(in crate::real) fn exp_m1_negative<R: Real>(x: R) -> R {
    let half = (R::lit(0.5) * x).clamp(R::lit(-SATURATED), R::lit(0.0));
    let [above, below] = tanh_parts(half);
    let share = half * above;
    (share + share) / (below - share)
}

/// `ln(1 + e)` of `e = exp(-|x|)`: `2 atanh(r)` with `r = e / (2 + e)` up to 1/3, as a series, relative error
/// 2e-8.
#[inline(always)]
pub(in crate::real) fn softplus_excess<R: Real>(x: R) -> R {
    let e = (-x.abs()).exp_negative();
    let ratio = e / (R::lit(2.0) + e);
    let square = ratio * ratio;
    let series =
        polynomial(square, [1.0 / 3.0, 1.0 / 5.0, 1.0 / 7.0, 1.0 / 9.0, 1.0 / 11.0, 1.0 / 13.0]);
    (ratio + ratio) * (R::lit(1.0) + square * series)
}

/// Of `erf(x / sqrt(2))` as the hyperbolic tangent of an odd polynomial: its coefficients, of x, x^3 and so on.
pub(crate) const NORMAL_SERIES: [f32; 7] = [
    0.79788463,
    0.036334355,
    -3.391_76e-5,
    -5.4779685e-05,
    3.8728052e-06,
    -1.2524703e-07,
    1.5673046e-09,
];
/// Where it ends: 1 from there on, where the truth is 1.6e-8 below.
pub(crate) const NORMAL_END: f32 = 5.65;

/// `erf(x / sqrt(2))`, fitted to relative error 1e-7.
#[inline(always)]
pub(in crate::real) fn normal_share<R: Real>(x: R) -> R {
    let x = x.clamp(R::lit(-NORMAL_END), R::lit(NORMAL_END));
    tanh(x * polynomial(x * x, NORMAL_SERIES))
}

/// Logistic function.
#[inline(always)]
pub(in crate::real) fn sigmoid<R: Real>(x: R) -> R {
    let one = R::lit(1.0);
    one / (one + exp(-x))
}

/// `exp(rest)` for `|rest|` up to `ln 2 / 2`, from the coefficients of its series from `rest^2` on.
#[inline(always)]
fn exp_near_zero<R: Real, const N: usize>(rest: R, series: [f32; N]) -> R {
    R::lit(1.0) + (rest + rest * rest * polynomial(rest, series))
}

/// Exponential of `x <= 0`, relative error below 3e-7 down to -87; 0 below that, for NaN too.
///
/// `x = n ln 2 + r` with `|r| <= ln 2 / 2`: a polynomial in `r`, then the power of two as a product
/// of those that the binary digits of `-n` pick, which is exact.
#[inline(always)]
pub(in crate::real) fn exp_negative<R: Real>(x: R) -> R {
    let (zero, least) = (R::lit(0.0), R::lit(-87.0));
    let bounded = least.select_lt(x, x, least);
    let halvings = -(bounded * R::lit(std::f32::consts::LOG2_E) + R::lit(0.5)).floor();
    let [high, low] = LN_2_PARTS;
    let rest = (bounded + halvings * R::lit(high)) + halvings * R::lit(low);
    let mut value = exp_near_zero(rest, [0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0]);
    let mut left = halvings;
    for (digit, power) in HALVINGS {
        let below = left - R::lit(digit);
        let halved = value * R::lit(power);
        value = below.select_lt(zero, value, halved);
        left = below.select_lt(zero, left, below);
    }
    least.select_lt(x, value, zero)
}

/// Exponential, as [`exp_negative`]; the power of two is the product of two near its root, so that
/// neither leaves the range of f32 and a subnormal result is rounded once.
#[inline(always)]
pub(in crate::real) fn exp<R: Real>(x: R) -> R {
    let half = R::lit(0.5);
    // Beyond these the result is 0 or infinite.
    let bounded = x.clamp(R::lit(-104.0), R::lit(89.0));
    let doublings = (bounded * R::lit(std::f32::consts::LOG2_E) + half).floor();
    let [high, low] = LN_2_PARTS;
    let rest = (bounded - doublings * R::lit(high)) - doublings * R::lit(low);
    let root = (doublings * half).floor();
    let odd = doublings - (root + root);
    let power = root.power_of_two();
    let series = [0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5040.0];
    let once = exp_near_zero(rest, series) * power;
    half.select_lt(odd, once + once, once) * power
}

/// Two to a whole number in `[-75, 75]`.
#[inline(always)]
pub(in crate::real) fn power_of_two<R: Real>(number: R) -> R {
    let zero = R::lit(0.0);
    // The digits are those of a number that is not negative.
    let mut left = number + R::lit(75.0);
    let mut value = R::lit(SMALL / 2048.0);
    for (digit, power) in DIGITS {
        let below = left - R::lit(digit);
        let doubled = value * R::lit(power);
        value = below.select_lt(zero, value, doubled);
        left = below.select_lt(zero, left, below);
    }
    value
}

/// Mantissa, about 1, and exponent of `u` in `[2^-24, 1]`, by comparisons and exact products with
/// powers of two.
#[inline(always)]
pub(in crate::real) fn unit_parts<R: Real>(u: R) -> [R; 2] {
    // Powers of two as literals: calls of `exp2` are not folded.
    let digits = [(12.0, 4096.0), (6.0, 64.0), (3.0, 8.0), (2.0, 4.0), (1.0, 2.0)];
    parts_by(digits, [u, R::lit(0.0)])
}

/// Mantissa and exponent of a positive finite number, as [`unit_parts`] has them.
#[inline(always)]
pub(in crate::real) fn parts<R: Real>(x: R) -> [R; 2] {
    let (one, small, half_way) = (R::lit(1.0), R::lit(SMALL), R::lit(64.0));
    let mut at = [x, R::lit(0.0)];
    // Twice, so that what is 1 or more comes to lie in [2^-64, 1).
    for _ in 0..2 {
        let [mantissa, exponent] = at;
        at = [
            mantissa.select_lt(one, mantissa, mantissa * small),
            mantissa.select_lt(one, exponent, exponent + half_way),
        ];
    }
    parts_by(DIGITS, at)
}

/// Mantissa and exponent, given one that is small enough for the digits and the other so far.
#[inline(always)]
fn parts_by<R: Real, const N: usize>(
    digits: [(f32, f32); N],
    [mut mantissa, mut exponent]: [R; 2],
) -> [R; 2] {
    for (shift, power) in digits {
        let small = R::lit(std::f32::consts::SQRT_2 / power);
        let scaled = mantissa * R::lit(power);
        exponent = mantissa.select_lt(small, exponent - R::lit(shift), exponent);
        mantissa = mantissa.select_lt(small, scaled, mantissa);
    }
    [mantissa, exponent]
}

/// Natural logarithm of `m 2^e`.
///
/// That of the mantissa is `2 atanh((m - 1) / (m + 1))` as a series, exact to 2e-9 for `m` in
/// `[0.707, 1.414]`.
#[inline(always)]
fn ln_of<R: Real>([mantissa, exponent]: [R; 2]) -> R {
    let ratio = (mantissa - R::lit(1.0)) / (mantissa + R::lit(1.0));
    let square = ratio * ratio;
    let series = polynomial(square, [1.0 / 3.0, 1.0 / 5.0, 1.0 / 7.0, 1.0 / 9.0]);
    let fine = R::lit(2.0) * (ratio + ratio * (square * series));
    let [high, low] = LN_2_PARTS;
    (exponent * R::lit(high) + exponent * R::lit(low)) + fine
}

/// Natural logarithm of `u` in `[2^-24, 1]`.
#[inline(always)]
pub(in crate::real) fn ln_unit<R: Real>(u: R) -> R {
    ln_of(u.unit_parts())
}

/// Natural logarithm of a positive number, NaN of any other.
#[inline(always)]
pub(in crate::real) fn ln<R: Real>(x: R) -> R {
    let finite = ln_of(x.parts());
    let value = R::lit(f32::MAX).select_lt(x, x, finite);
    R::lit(0.0).select_lt(x, value, R::lit(f32::NAN))
}

/// `x` to a whole power, by repeated squares.
#[inline(always)]
pub(in crate::real) fn whole_power<R: Real>(x: R, exponent: i32) -> R {
    let one = R::lit(1.0);
    let mut left = exponent.unsigned_abs();
    let (mut square, mut product) = (x, None);
    while left > 0 {
        if left % 2 == 1 {
            product = Some(product.map_or(square, |product: R| product * square));
        }
        left /= 2;
        if left > 0 {
            square = square * square;
        }
    }
    match product {
        // One, but NaN where `x` is.
        None => x.if_lt(x, one, one),
        Some(product) if exponent < 0 => one / product,
        Some(product) => product,
    }
}

/// `x` to a power that is not whole; NaN below 0.
#[inline(always)]
pub(in crate::real) fn power<R: Real>(x: R, exponent: f32) -> R {
    let zero = R::lit(0.0);
    let positive = exp(R::lit(exponent) * ln(x));
    let at_zero = R::lit(if exponent > 0.0 { 0.0 } else { f32::INFINITY });
    let elsewhere = x.if_lt(zero, R::lit(f32::NAN), at_zero);
    zero.select_lt(x, positive, elsewhere)
}
