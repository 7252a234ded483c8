//! Ranges of the elementary functions over an interval.

use std::f64::consts::TAU;

use super::interval::Interval;

/// Relative error allowed to the platform's functions: 8 units in the last place, where the
/// libraries of the supported platforms state less than 2.
const PLATFORM: f64 = 4.0 * f64::EPSILON;
/// Slack in turns for "does a crest lie in here", far above the rounding of angles below [`FAR`].
const SLACK: f64 = 1e-9;
/// Angles beyond this take the whole range of the waves.
const FAR: f64 = 1e6;

/// The range of a rising function of the platform, from its values at the ends.
fn rising(x: Interval, function: fn(f64) -> f64) -> Interval {
    let (low, high) = (function(x.low), function(x.high));
    Interval::new(
        (low - low.abs() * PLATFORM).next_down(),
        (high + high.abs() * PLATFORM).next_up(),
    )
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
pub(super) fn sin(x: Interval) -> Interval {
    wave(x, 0.25, f64::sin)
}

/// Cosines of the angles in `x`, radians.
pub(super) fn cos(x: Interval) -> Interval {
    wave(x, 0.0, f64::cos)
}

/// Hyperbolic tangents of `x`.
pub(crate) fn tanh(x: Interval) -> Interval {
    let range = rising(x, f64::tanh);
    Interval::new(range.low.max(-1.0), range.high.min(1.0))
}

/// Natural logarithms of `x`, which must be above zero.
pub(super) fn ln(x: Interval) -> Interval {
    rising(x, f64::ln)
}

#[cfg(test)]
mod tests {
    use super::super::interval::Interval;
    use super::{cos, ln, sin, tanh};

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
