//! Ranges of the elementary functions over an interval.

use std::f64::consts::{PI, TAU};

use crate::real::interval::Interval;
use crate::real::normal;
pub(crate) use crate::real::normal::{normal, normal_density};

/// Relative error allowed to the platform's functions: 8 units in the last place, where the
/// libraries of the supported platforms state less than 2.
const PLATFORM: f64 = 4.0 * f64::EPSILON;
/// Slack in turns for "does a crest lie in here", far above the rounding of angles below [`FAR`].
const SLACK: f64 = 1e-9;
/// Angles beyond this take the whole range of the waves.
const FAR: f64 = 1e6;

/// From `low` to `high`, values of the platform: widened by its error, an overflow unknown.
fn outward(low: f64, high: f64) -> Interval {
    let down = (low - low.abs() * PLATFORM).next_down();
    let up = (high + high.abs() * PLATFORM).next_up();
    Interval::new(
        if low.is_finite() { down } else { low.min(f64::MAX) },
        if high.is_finite() { up } else { high.max(f64::MIN) },
    )
}

/// The range of a rising function of the platform, from its values at the ends.
fn rising(x: Interval, function: impl Fn(f64) -> f64) -> Interval {
    outward(function(x.low), function(x.high))
}

/// Whether an angle of `x` may be `phase` turns and a whole number of turns.
fn passes(x: Interval, phase: f64) -> bool {
    (x.low / TAU - phase - SLACK).ceil() <= x.high / TAU - phase + SLACK
}

/// The range of a wave of unit height with a crest at `crest` turns.
fn wave(x: Interval, crest: f64, function: fn(f64) -> f64) -> Interval {
    if x.magnitude() > FAR {
        return Interval::new(-1.0, 1.0);
    }
    let ends =
        rising(Interval::point(x.low), function).hull(rising(Interval::point(x.high), function));
    let low = if passes(x, crest + 0.5) { -1.0 } else { ends.low.max(-1.0) };
    let high = if passes(x, crest) { 1.0 } else { ends.high.min(1.0) };
    Interval::new(low, high)
}

/// Sines of the angles in `x`, radians.
pub(crate) fn sin(x: Interval) -> Interval {
    wave(x, 0.25, f64::sin)
}

/// Cosines of the angles in `x`, radians.
pub(crate) fn cos(x: Interval) -> Interval {
    wave(x, 0.0, f64::cos)
}

/// Hyperbolic tangents of `x`.
pub(crate) fn tanh(x: Interval) -> Interval {
    let range = rising(x, f64::tanh);
    Interval::new(range.low.max(-1.0), range.high.min(1.0))
}

/// Natural logarithms of `x`, which must be above zero.
pub(crate) fn ln(x: Interval) -> Interval {
    rising(x, f64::ln)
}

/// Exponentials of `x`.
pub(crate) fn exp(x: Interval) -> Interval {
    let range = rising(x, f64::exp);
    Interval::new(range.low.max(0.0), range.high)
}

/// Values of the logistic function, and its slopes.
pub(crate) fn sigmoid(x: Interval) -> (Interval, Interval) {
    let value = |x: f64| match x < 0.0 {
        true => x.exp() / (1.0 + x.exp()),
        false => 1.0 / (1.0 + (-x).exp()),
    };
    let range = rising(x, value);
    let range = Interval::new(range.low.max(0.0), range.high.min(1.0));
    // s (1 - s) rises up to 1/2 and falls from there.
    let at = |s: f64| Interval::point(s) * (Interval::ONE - Interval::point(s));
    let ends = at(range.low).hull(at(range.high));
    let steepest = if range.contains(0.5) { 0.25 } else { ends.high.min(0.25) };
    (range, Interval::new(ends.low.max(0.0), steepest))
}

/// Shares of the standard normal distribution within the numbers of `x`, signed, and their slopes.
pub(crate) fn normal_share(x: Interval) -> (Interval, Interval) {
    // Its error is 20 times that of the functions of the platform.
    let slack = Interval::new(1.0 - 40.0 * PLATFORM, 1.0 + 40.0 * PLATFORM);
    let range = rising(x, normal::normal_share) * slack;
    let slope = |x: f64| Interval::point(2.0 * normal_density(x)) * slack;
    let most = if x.contains(0.0) { slope(0.0) } else { slope(x.smallest()) };
    let slopes = Interval::new(slope(x.magnitude()).low.max(0.0), most.high);
    (Interval::new(range.low.max(-1.0), range.high.min(1.0)), slopes)
}

/// Whether no angle of `x` is an odd quarter of a turn.
pub(crate) fn tan_defined(x: Interval) -> bool {
    x.magnitude() <= FAR && !passes(x, 0.25) && !passes(x, 0.75)
}

/// Tangents of the angles in `x`, which must be between two poles, and their slopes.
pub(crate) fn tan(x: Interval) -> (Interval, Interval) {
    let range = rising(x, f64::tan);
    (range, Interval::ONE + range.square())
}

/// Whether `x` lies in `[-1, 1]`.
pub(crate) fn within_one(x: Interval) -> bool {
    x.magnitude() <= 1.0
}

/// Slopes of the arc sine over `x` in `[-1, 1]`.
fn asin_slope(x: Interval) -> Interval {
    let rest = Interval::ONE - x.square();
    Interval::new(rest.low.max(0.0), rest.high.max(0.0)).sqrt().reciprocal()
}

/// Arc sines of `x` in `[-1, 1]`, and their slopes.
pub(crate) fn asin(x: Interval) -> (Interval, Interval) {
    (rising(x, f64::asin), asin_slope(x))
}

/// Arc cosines of `x` in `[-1, 1]`, and their slopes.
pub(crate) fn acos(x: Interval) -> (Interval, Interval) {
    (outward(x.high.acos(), x.low.acos()), -asin_slope(x))
}

/// Arc tangents of `x`, and their slopes.
pub(crate) fn atan(x: Interval) -> (Interval, Interval) {
    (rising(x, f64::atan), (Interval::ONE + x.square()).reciprocal())
}

/// Angles of the points `(x, y)`, none of them the origin or on the two sides of the cut: the largest
/// and the smallest are those of corners.
pub(crate) fn atan2(y: Interval, x: Interval) -> Interval {
    let corners = [(y.low, x.low), (y.low, x.high), (y.high, x.low), (y.high, x.high)];
    // A negative zero plus zero is zero.
    let angles = corners.map(|(y, x)| f64::atan2(y + 0.0, x + 0.0));
    let low = angles.into_iter().fold(f64::INFINITY, f64::min);
    let high = angles.into_iter().fold(f64::NEG_INFINITY, f64::max);
    outward(low, high)
}

/// Turns to take off all angles of `x` that bring them into `[-pi, pi)`, if one number does.
pub(crate) fn turns(x: Interval) -> Option<f64> {
    let low = (x.low / TAU + 0.5 - SLACK).floor();
    let high = (x.high / TAU + 0.5 + SLACK).floor();
    (x.magnitude() <= FAR && low == high).then_some(low)
}

/// The angles of `x` in `[-pi, pi)`.
pub(crate) fn wrap(x: Interval) -> Interval {
    let half_turn = PI.next_up();
    // The float is below the true number.
    let turn = Interval::new(TAU, TAU.next_up());
    let moved = turns(x).map_or(Interval::ENTIRE, |turns| x - turn * Interval::point(turns));
    Interval::new(moved.low.max(-half_turn), moved.high.min(half_turn))
}

/// `x` to a power above 0.
fn positive_power(x: Interval, exponent: u32) -> Interval {
    let at = |x: f64| {
        let (mut left, mut square, mut product) = (exponent, Interval::point(x), Interval::ONE);
        while left > 0 {
            product = if left % 2 == 1 { product * square } else { product };
            square = square.square();
            left /= 2;
        }
        product
    };
    if exponent % 2 == 1 {
        return Interval::new(at(x.low).low, at(x.high).high);
    }
    Interval::new(at(x.smallest()).low.max(0.0), at(x.magnitude()).high)
}

/// `x` to a whole power, which must have no 0 in it where that is negative.
fn power(x: Interval, exponent: i64) -> Interval {
    let size = u32::try_from(exponent.unsigned_abs()).unwrap_or(u32::MAX);
    match exponent {
        0 => Interval::ONE,
        1.. => positive_power(x, size),
        _ => positive_power(x, size).reciprocal(),
    }
}

/// The powers of `x` with a whole exponent, and their slopes; no 0 in `x` where that is negative.
pub(crate) fn powi(x: Interval, exponent: i32) -> (Interval, Interval) {
    let exponent = i64::from(exponent);
    let slope = Interval::point(exponent as f64) * power(x, exponent - 1);
    (power(x, exponent), slope)
}

/// The powers of `x >= 0`, above 0 where `exponent` is negative, and their slopes; both are monotone.
pub(crate) fn powf(x: Interval, exponent: f64) -> (Interval, Interval) {
    let value = |x: f64| outward(x.powf(exponent), x.powf(exponent));
    let beyond = Interval::point(exponent) * Interval::new(f64::MAX, f64::INFINITY);
    let slope = |x: f64| match (x == 0.0, x == f64::INFINITY) {
        (false, false) => Interval::point(exponent) * value(x) * Interval::point(x).reciprocal(),
        (true, _) if exponent > 1.0 => Interval::ZERO,
        (_, true) if exponent < 1.0 => Interval::ZERO,
        _ => beyond,
    };
    let range = value(x.low).hull(value(x.high));
    (Interval::new(range.low.max(0.0), range.high), slope(x.low).hull(slope(x.high)))
}

#[cfg(test)]
mod tests {
    use super::{cos, ln, sin, tanh};
    use crate::real::interval::Interval;

    #[test]
    fn crests_and_troughs_are_in_the_range() {
        let steps = 400;
        for i in 0..steps {
            let low = -9.0 + 18.0 * f64::from(i) / f64::from(steps);
            for width in [0.0, 0.01, 0.7, 2.0, 3.5, 6.0, 7.0] {
                let x = Interval::new(low, low + width);
                let (sines, cosines) = (sin(x), cos(x));
                let mut seen = [Interval::point(low.sin()), Interval::point(low.cos())];
                for j in 0..=200 {
                    let angle = low + width * f64::from(j) / 200.0;
                    assert!(sines.contains(angle.sin()) && cosines.contains(angle.cos()));
                    seen[0] = seen[0].hull(Interval::point(angle.sin()));
                    seen[1] = seen[1].hull(Interval::point(angle.cos()));
                }
                // The grid of 201 angles misses a crest by at most (7 / 400)^2 / 2.
                for (range, seen) in [sines, cosines].iter().zip(seen) {
                    assert!(range.low > seen.low - 2e-4 && range.high < seen.high + 2e-4);
                }
            }
        }
    }

    #[test]
    fn unbounded_angles_and_ends() {
        assert_eq!(sin(Interval::ENTIRE), Interval::new(-1.0, 1.0));
        assert_eq!(tanh(Interval::ENTIRE), Interval::new(-1.0, 1.0));
        assert!(ln(Interval::new(0.5, 1.0)).contains(0.5_f64.ln()));
        assert!(ln(Interval::new(0.5, 1.0)).contains(0.0));
    }
}
