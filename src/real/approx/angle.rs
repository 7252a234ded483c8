//! Functions of angles, and angles of points.

use std::f32::consts::{FRAC_1_PI, FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

use super::{Real, polynomial};

/// `2 pi` in three parts: products of the first two with integers below 2^13 are exact.
const TAU_PARTS: [f32; 3] = [6.28125, 0.001_934_051_5, 1.255_641_4e-6];

/// Angles from which on neighbouring numbers are half a radian apart.
const WRAPPED_UP_TO: f32 = 4_194_304.0;

/// Tangents of `pi/8` and `3 pi/8`.
const TAN_FRAC_PI_8: f32 = 0.414_213_57;
const TAN_3_FRAC_PI_8: f32 = 2.414_213_7;

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
pub(super) fn principal<R: Real>(angle: R) -> R {
    let turns = (angle * R::lit(FRAC_1_PI * 0.5) + R::lit(0.5)).floor();
    let [a, b, c] = TAU_PARTS;
    ((angle - turns * R::lit(a)) - turns * R::lit(b)) - turns * R::lit(c)
}

/// Sine and cosine of half an angle in `[-pi, pi]`, by folding at `pi/4`.
#[inline(always)]
fn half_angle<R: Real>(angle: R) -> (R, R) {
    // |half| <= pi/2: above pi/4 take the complement, where sine and cosine change places.
    let half = R::lit(0.5) * angle.abs();
    let quarter = R::lit(FRAC_PI_4);
    let complement = (R::lit(FRAC_PI_4) - half) + quarter;
    let folded = quarter.select_lt(half, complement, half);
    let (sin, cos) = (sin_octant(folded), cos_octant(folded));
    (quarter.select_lt(half, cos, sin), quarter.select_lt(half, sin, cos))
}

/// Sine and cosine, for |angle| up to pi.
#[inline(always)]
pub(in crate::real) fn principal_sin_cos<R: Real>(angle: R) -> [R; 2] {
    let (sin, cos) = half_angle(angle);
    let double = R::lit(2.0) * sin * cos;
    [angle.select_lt(R::lit(0.0), -double, double), R::lit(1.0) - R::lit(2.0) * sin * sin]
}

/// Sine.
#[inline(always)]
pub(in crate::real) fn sin<R: Real>(angle: R) -> R {
    let [sin, _] = principal_sin_cos(principal(angle));
    sin
}

/// Cosine.
#[inline(always)]
pub(in crate::real) fn cos<R: Real>(angle: R) -> R {
    let [_, cos] = principal_sin_cos(principal(angle));
    cos
}

/// Tangent: of the angle to the nearest quarter of a turn, whose number says which quotient.
#[inline(always)]
pub(in crate::real) fn tan<R: Real>(angle: R) -> R {
    let half = R::lit(0.5);
    let quarters = (angle * R::lit(FRAC_2_PI) + half).floor();
    let [a, b, c] = TAU_PARTS.map(|part| R::lit(0.25 * part));
    let rest = ((angle - quarters * a) - quarters * b) - quarters * c;
    let odd = quarters - R::lit(2.0) * (quarters * half).floor();
    let (sin, cos) = (sin_octant(rest), cos_octant(rest));
    half.select_lt(odd, -cos, sin) / half.select_lt(odd, sin, cos)
}

/// `angle` less a multiple of `2 pi`, in `[-pi, pi)` with pi as an f32 has it.
#[inline(always)]
pub(in crate::real) fn wrap<R: Real>(angle: R) -> R {
    let (half_turn, turn) = (R::lit(PI), R::lit(TAU));
    let near = principal(angle);
    let above = near.select_lt(-half_turn, near + turn, near);
    let below = above.select_lt(half_turn, above, above - turn);
    R::lit(WRAPPED_UP_TO).select_lt(angle.abs(), R::lit(f32::NAN), below)
}

/// Arc tangent of `x >= 0`: of a number up to `tan(pi/8)`, added to 0, `pi/4` or `pi/2`.
#[inline(always)]
fn atan_positive<R: Real>(x: R) -> R {
    let one = R::lit(1.0);
    let (near, far) = (R::lit(TAN_FRAC_PI_8), R::lit(TAN_3_FRAC_PI_8));
    let step = |close: R, middle: R, distant: R| {
        far.select_lt(x, distant, near.select_lt(x, middle, close))
    };
    let ratio = step(x, x - one, -one) / step(one, x + one, x);
    let base = step(R::lit(0.0), R::lit(FRAC_PI_4), R::lit(FRAC_PI_2));
    let square = ratio * ratio;
    let tail = [-0.333_329_5, 0.199_777_11, -0.138_776_86, 0.080_537_444];
    base + (ratio + ratio * (square * polynomial(square, tail)))
}

/// Arc tangent.
#[inline(always)]
pub(in crate::real) fn atan<R: Real>(x: R) -> R {
    let angle = atan_positive(x.abs());
    x.select_lt(R::lit(0.0), -angle, angle)
}

/// The angle of the point `(x, y)`: that of the smaller coordinate over the larger, unfolded.
#[inline(always)]
pub(in crate::real) fn atan2<R: Real>(y: R, x: R) -> R {
    let (zero, one) = (R::lit(0.0), R::lit(1.0));
    let (across, up) = (x.abs(), y.abs());
    let (small, large) = (across.min(up), across.max(up));
    // Of two zeros the quotient is 0, of two infinities 1.
    let ratio = small / large.max(R::lit(f32::MIN_POSITIVE));
    let ratio = R::lit(f32::MAX).select_lt(small, one, ratio);
    let angle = atan_positive(ratio);
    let steep = across.select_lt(up, R::lit(FRAC_PI_2) - angle, angle);
    let turned = x.select_lt(zero, R::lit(PI) - steep, steep);
    y.select_lt(zero, -turned, turned)
}

/// Arc sine of `|x|` up to 1/2, of `sqrt((1 - |x|) / 2)` above: half the angle to the end.
#[inline(always)]
fn asin_folded<R: Real>(size: R) -> R {
    let half = R::lit(0.5);
    let rest = half * (R::lit(1.0) - size);
    let square = half.select_lt(size, rest, size * size);
    let root = half.select_lt(size, square.sqrt(), size);
    let tail = [0.166_667_52, 0.074_953_005, 0.045_470_025, 0.024_181_312, 0.042_163_2];
    root + root * (square * polynomial(square, tail))
}

/// `inside` where `size` is at most 1, else NaN.
#[inline(always)]
fn within_one<R: Real>(size: R, inside: R) -> R {
    R::lit(1.0).select_lt(size, R::lit(f32::NAN), inside)
}

/// Arc sine.
#[inline(always)]
pub(in crate::real) fn asin<R: Real>(x: R) -> R {
    let size = x.abs();
    let folded = asin_folded(size);
    let far = R::lit(FRAC_PI_2) - R::lit(2.0) * folded;
    let angle = R::lit(0.5).select_lt(size, far, folded);
    within_one(size, x.select_lt(R::lit(0.0), -angle, angle))
}

/// Arc cosine.
#[inline(always)]
pub(in crate::real) fn acos<R: Real>(x: R) -> R {
    let (zero, size) = (R::lit(0.0), x.abs());
    let folded = asin_folded(size);
    let double = R::lit(2.0) * folded;
    let far = x.select_lt(zero, R::lit(PI) - double, double);
    let near = R::lit(FRAC_PI_2) - x.select_lt(zero, -folded, folded);
    within_one(size, R::lit(0.5).select_lt(size, far, near))
}
