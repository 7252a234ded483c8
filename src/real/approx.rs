//! Elementary functions as polynomials in + - * / and comparisons, the same bits everywhere.

use super::Real;

/// `2 pi` in three parts: products of the first two with integers below 2^13 are exact.
const TAU_PARTS: [f32; 3] = [6.28125, 0.001_934_051_5, 1.255_641_4e-6];

/// `c[0] + x (c[1] + x (...))`.
#[inline(always)]
fn polynomial<R: Real, const N: usize>(x: R, coefficients: [f32; N]) -> R {
    let mut sum = R::lit(coefficients[N - 1]);
    for i in (0..N - 1).rev() {
        sum = sum * x + R::lit(coefficients[i]);
    }
    sum
}

/// The sine of `angle` in `[-pi/4, pi/4]`, error below 4e-9 before rounding.
#[inline(always)]
fn sin_octant<R: Real>(angle: R) -> R {
    let square = angle * angle;
    let tail = polynomial(square, [-0.166_666_55, 0.008_332_178, -0.000_195_172_98]);
    angle + angle * (square * tail)
}

/// The cosine of `angle` in `[-pi/4, pi/4]`, error below 1e-10 before rounding.
#[inline(always)]
fn cos_octant<R: Real>(angle: R) -> R {
    let square = angle * angle;
    let tail = polynomial(square, [0.041_666_646, -0.001_388_736_8, 2.443_845_2e-5]);
    (R::lit(1.0) - R::lit(0.5) * square) + square * square * tail
}

/// `angle` less its nearest multiple of `2 pi`, in `[-pi, pi]` up to rounding.
#[inline(always)]
fn principal<R: Real>(angle: R) -> R {
    let turns = (angle * R::lit(std::f32::consts::FRAC_1_PI * 0.5) + R::lit(0.5)).floor();
    let [a, b, c] = TAU_PARTS;
    ((angle - turns * R::lit(a)) - turns * R::lit(b)) - turns * R::lit(c)
}

/// Sine and cosine of half an angle in `[-pi, pi]`, by folding at `pi/4`.
#[inline(always)]
fn half_angle<R: Real>(angle: R) -> (R, R) {
    // |half| <= pi/2: above pi/4 take the complement, where sine and cosine change places.
    let half = R::lit(0.5) * angle.abs();
    let quarter = R::lit(std::f32::consts::FRAC_PI_4);
    let complement = (R::lit(std::f32::consts::FRAC_PI_4) - half) + quarter;
    let folded = quarter.if_lt(half, complement, half);
    let (sin, cos) = (sin_octant(folded), cos_octant(folded));
    (quarter.if_lt(half, cos, sin), quarter.if_lt(half, sin, cos))
}

/// Sine and cosine, for |angle| up to pi.
#[inline(always)]
pub(super) fn principal_sin_cos<R: Real>(angle: R) -> [R; 2] {
    let (sin, cos) = half_angle(angle);
    let double = R::lit(2.0) * sin * cos;
    [angle.if_lt(R::lit(0.0), -double, double), R::lit(1.0) - R::lit(2.0) * sin * sin]
}

/// Sine, for angles up to 8192; absolute error below 3e-7 for |angle| up to pi.
#[inline(always)]
pub(super) fn sin<R: Real>(angle: R) -> R {
    let [sin, _] = principal_sin_cos(principal(angle));
    sin
}

/// Cosine, for angles up to 8192; absolute error below 5e-7 for |angle| up to pi.
#[inline(always)]
pub(super) fn cos<R: Real>(angle: R) -> R {
    let [_, cos] = principal_sin_cos(principal(angle));
    cos
}

/// Hyperbolic tangent: an odd rational function fitted to relative error 9e-9, within 4e-7 of the
/// truth after rounding; saturates to 1 at 8.2, where the truth is 1.5e-7 below.
#[inline(always)]
pub(super) fn tanh<R: Real>(x: R) -> R {
    let x = x.clamp(R::lit(-8.2), R::lit(8.2));
    let square = x * x;
    let above = [1.0, 0.134_345_38, 0.003_559_528_6, 2.168_320_3e-5, 1.490_322_2e-8];
    let below = [1.0, 0.467_678_67, 0.026_119_178, 0.000_339_104_97, 8.396_420_4e-7];
    x * (polynomial(square, above) / polynomial(square, below))
}

/// Exponential of `x <= 0`, relative error below 3e-7 down to -87; 0 below that, for NaN too.
///
/// `x = n ln 2 + r` with `|r| <= ln 2 / 2`: a polynomial in `r`, then the power of two as a product
/// of those that the binary digits of `-n` pick, which is exact.
#[inline(always)]
pub(super) fn exp_negative<R: Real>(x: R) -> R {
    let (zero, least) = (R::lit(0.0), R::lit(-87.0));
    let bounded = least.if_lt(x, x, least);
    let halvings = -(bounded * R::lit(std::f32::consts::LOG2_E) + R::lit(0.5)).floor();
    // ln 2 in two parts, the first exact in products with integers up to 2^8.
    let rest = (bounded + halvings * R::lit(0.693_145_75)) + halvings * R::lit(1.428_606_8e-6);
    let tail = polynomial(rest, [0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0]);
    let mut value = R::lit(1.0) + (rest + rest * rest * tail);
    let mut left = halvings;
    let (large, small) = (1.0 / 18_446_744_073_709_551_616.0, 1.0 / 4_294_967_296.0);
    for (digit, power) in [
        (64.0, large),
        (32.0, small),
        (16.0, 1.0 / 65_536.0),
        (8.0, 1.0 / 256.0),
        (4.0, 1.0 / 16.0),
        (2.0, 0.25),
        (1.0, 0.5),
    ] {
        let below = left - R::lit(digit);
        let halved = value * R::lit(power);
        value = below.if_lt(zero, value, halved);
        left = below.if_lt(zero, left, below);
    }
    least.if_lt(x, value, zero)
}

/// Mantissa, about 1, and exponent of `u` in `[2^-24, 1]`, by comparisons and exact products with
/// powers of two.
#[inline(always)]
pub(super) fn unit_parts<R: Real>(u: R) -> [R; 2] {
    let (mut mantissa, mut exponent) = (u, R::lit(0.0));
    // Powers of two as literals: calls of `exp2` are not folded.
    for (shift, power) in [(12.0, 4096.0), (6.0, 64.0), (3.0, 8.0), (2.0, 4.0), (1.0, 2.0)] {
        let small = R::lit(std::f32::consts::SQRT_2 / power);
        let scaled = mantissa * R::lit(power);
        exponent = mantissa.if_lt(small, exponent - R::lit(shift), exponent);
        mantissa = mantissa.if_lt(small, scaled, mantissa);
    }
    [mantissa, exponent]
}

/// Natural logarithm of `u` in `[2^-24, 1]`.
///
/// That of the mantissa is `2 atanh((m - 1) / (m + 1))` as a series, exact to 2e-9 for `m` in
/// `[0.707, 1.414]`.
#[inline(always)]
pub(super) fn ln_unit<R: Real>(u: R) -> R {
    let [mantissa, exponent] = u.unit_parts();
    let ratio = (mantissa - R::lit(1.0)) / (mantissa + R::lit(1.0));
    let square = ratio * ratio;
    let series = polynomial(square, [1.0 / 3.0, 1.0 / 5.0, 1.0 / 7.0, 1.0 / 9.0]);
    let fine = R::lit(2.0) * (ratio + ratio * (square * series));
    // ln 2 in two parts, the first exact in products with integers up to 24.
    (exponent * R::lit(0.693_145_75) + exponent * R::lit(1.428_606_8e-6)) + fine
}

#[cfg(test)]
mod tests {
    use crate::real::Real;

    /// Largest error of `ours` against `truth` over an even grid.
    fn worst(low: f32, high: f32, ours: fn(f32) -> f32, truth: fn(f64) -> f64) -> f64 {
        let count = 200_001;
        (0..count)
            .map(|i| low + (high - low) * i as f32 / (count - 1) as f32)
            .map(|x| (f64::from(ours(x)) - truth(f64::from(x))).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn close_to_the_platform_in_f64() {
        assert!(worst(-4.0, 4.0, <f32 as Real>::sin, f64::sin) < 3e-7);
        assert!(worst(-4.0, 4.0, <f32 as Real>::cos, f64::cos) < 5e-7);
        assert!(worst(-1000.0, 1000.0, <f32 as Real>::sin, f64::sin) < 4e-7);
        assert!(worst(-1000.0, 1000.0, <f32 as Real>::cos, f64::cos) < 6e-7);
        assert!(worst(-12.0, 12.0, <f32 as Real>::tanh, f64::tanh) < 4e-7);
        assert!(worst(6e-8, 1.0, <f32 as Real>::ln_unit, f64::ln) < 1.2e-6);
        let relative = |x: f32| (f64::from(x.exp_negative()) / f64::from(x).exp() - 1.0).abs();
        let largest = (0..86_000).map(|i| relative(i as f32 * -1e-3)).fold(0.0, f64::max);
        assert!(largest < 3e-7, "{largest}");
    }

    /// Every turn that a uniform number can be.
    #[test]
    fn angles_within_a_turn_need_no_reduction() {
        for word in 0..1 << 23_u32 {
            let turn = f32::from_bits(word | 0x3f80_0000) - 1.0;
            let angle = std::f32::consts::TAU * (turn - 0.5);
            assert_eq!(super::principal(angle).to_bits(), angle.to_bits(), "{turn}");
        }
        for angle in [-1.0_f32, 0.0, 2.5] {
            let [sin, cos] = angle.principal_sin_cos();
            assert_eq!([sin, cos], [Real::sin(angle), Real::cos(angle)]);
        }
    }

    #[test]
    fn parts_of_a_unit_make_it_again() {
        for u in (1..=1 << 23).step_by(7).map(|k| k as f32 / 8_388_608.0) {
            let [mantissa, exponent] = u.unit_parts();
            let root = std::f32::consts::FRAC_1_SQRT_2;
            assert!((root..2.0 * root).contains(&mantissa), "{u}: {mantissa}");
            assert_eq!(mantissa * exponent.exp2(), u);
        }
    }

    #[test]
    fn ends_of_the_ranges() {
        assert_eq!(<f32 as Real>::ln_unit(1.0), 0.0);
        let smallest = (-24.0_f32).exp2();
        assert!((Real::ln_unit(smallest) - f64::from(smallest).ln() as f32).abs() < 2e-6);
        assert_eq!(<f32 as Real>::tanh(0.0), 0.0);
        assert!(<f32 as Real>::tanh(1e30) <= 1.0);
        assert!(<f32 as Real>::tanh(f32::NAN).is_nan());
        assert_eq!(<f32 as Real>::exp_negative(0.0), 1.0);
        for far in [-87.5, -1e30, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(far.exp_negative(), 0.0, "{far}");
        }
    }
}
