//! Operations on affine forms that choose or jump: minimum, maximum, absolute value, branches, floor, angles.

use std::f64::consts::{PI, TAU};

use super::affine::{Affine, Symbols};
use crate::real::bound::{Interval, elementary};

/// The larger of `x` and 0.
///
/// On `[low, high]` around 0 it lies above the line of slope `high / (high - low)` through 0 by at most what it
/// does at one of the ends.
pub(super) fn positive_part(x: &Affine, symbols: &mut Symbols) -> Affine {
    let Interval { low, high } = x.range;
    if !x.known() || low >= 0.0 {
        return x.clone();
    }
    if high <= 0.0 {
        return Affine::constant(0.0);
    }
    let slope = (high / (high - low)).clamp(0.0, 1.0);
    let below = (Interval::point(-slope) * Interval::point(low)).high;
    let above = ((Interval::ONE - Interval::point(slope)) * Interval::point(high)).high;
    let line = x.scaled(slope, Interval::new(0.0, below.max(above)), symbols);
    line.ranged(Interval::new(0.0, high))
}

/// The larger of two.
pub(super) fn max(a: &Affine, b: &Affine, symbols: &mut Symbols) -> Affine {
    for (one, other) in [(a, b), (b, a)] {
        if one.center == f64::INFINITY && other.known() {
            return one.clone();
        }
        if one.center == f64::NEG_INFINITY {
            return other.clone();
        }
    }
    let difference = a.minus(b);
    if !difference.known() {
        return Affine::unknown();
    }
    if difference.range.low >= 0.0 {
        return a.clone();
    }
    if difference.range.high <= 0.0 {
        return b.clone();
    }
    let range = Interval::new(a.range.low.max(b.range.low), a.range.high.max(b.range.high));
    b.plus(&positive_part(&difference, symbols)).ranged(range)
}

/// The smaller of two.
pub(super) fn min(a: &Affine, b: &Affine, symbols: &mut Symbols) -> Affine {
    max(&a.negated(), &b.negated(), symbols).negated()
}

/// Absolute value: above the line that meets it at both ends of the range, by at most what it is at 0.
pub(super) fn abs(x: &Affine, symbols: &mut Symbols) -> Affine {
    let Interval { low, high } = x.range;
    if !x.known() || low >= 0.0 {
        return x.clone();
    }
    if high <= 0.0 {
        return x.negated();
    }
    let slope = ((high + low) / (high - low)).clamp(-1.0, 1.0);
    let right = ((Interval::ONE - Interval::point(slope)) * Interval::point(high)).high;
    let left = ((-Interval::ONE - Interval::point(slope)) * Interval::point(low)).high;
    let line = x.scaled(slope, Interval::new(0.0, right.max(left)), symbols);
    line.ranged(Interval::new(0.0, high.max(-low)))
}

/// `x` within a lower and an upper bound.
pub(super) fn clamp(x: &Affine, [low, high]: [&Affine; 2], symbols: &mut Symbols) -> Affine {
    let floored = max(x, low, symbols);
    min(&floored, high, symbols)
}

/// One of two forms, whichever.
fn either(yes: &Affine, no: &Affine, symbols: &mut Symbols) -> Affine {
    let half = Affine::combination(&[(0.5, yes), (-0.5, no)], 0.0).range.magnitude();
    let middle = Affine::combination(&[(0.5, yes), (0.5, no)], 0.0);
    if !(middle.known() && half.is_finite()) {
        return Affine::unknown();
    }
    middle.shifted(Interval::new(-half, half), symbols).ranged(yes.range.hull(no.range))
}

/// `yes` where `a < b`, else `no`; where that is open, either of them.
pub(super) fn if_lt(
    [a, b]: [&Affine; 2],
    [yes, no]: [&Affine; 2],
    symbols: &mut Symbols,
) -> Affine {
    let (below, above) = (f64::NEG_INFINITY, f64::INFINITY);
    // An infinite literal is beyond every number.
    let beyond = (a.center == below && b.known()) || (b.center == above && a.known());
    let short = (a.center == above && b.known()) || (b.center == below && a.known());
    let difference = a.minus(b);
    if !(beyond || short || difference.known()) {
        return Affine::unknown();
    }
    if short || (difference.known() && difference.range.low >= 0.0) {
        return no.clone();
    }
    if beyond || difference.range.high < 0.0 {
        return yes.clone();
    }
    either(yes, no, symbols)
}

/// A function that is flat but for its jumps.
fn stepped(x: &Affine, step: impl Fn(f64) -> f64, symbols: &mut Symbols) -> Affine {
    if !x.known() {
        return Affine::unknown();
    }
    let range = Interval::new(step(x.range.low), step(x.range.high));
    match range.low == range.high {
        true => Affine::constant(range.low),
        false => Affine::within(range, symbols),
    }
}

/// Largest integer not above `x`.
pub(super) fn floor(x: &Affine, symbols: &mut Symbols) -> Affine {
    stepped(x, f64::floor, symbols)
}

/// 1 above 0, -1 below, 0 at it.
pub(super) fn sign(x: &Affine, symbols: &mut Symbols) -> Affine {
    stepped(x, |x| if x == 0.0 { 0.0 } else { x.signum() }, symbols)
}

/// All angles of half a turn to either side.
fn all_angles() -> Interval {
    Interval::new(-PI.next_up(), PI.next_up())
}

/// `x` less the whole turns that bring it into `[-pi, pi)`.
pub(super) fn wrap(x: &Affine, symbols: &mut Symbols) -> Affine {
    if !x.known() {
        return Affine::unknown();
    }
    match elementary::turns(x.range) {
        Some(turns) => {
            // The float is below the true number.
            let turn = Interval::new(TAU, TAU.next_up());
            x.shifted(-(turn * Interval::point(turns)), symbols).ranged(all_angles())
        }
        None => Affine::within(all_angles(), symbols),
    }
}

/// Euclidean length of `(a, b)`: never below the plane that touches it at the centers, which goes through the
/// origin, and above it by at most the square of the way from there over twice the least distance.
pub(super) fn hypot(a: &Affine, b: &Affine, symbols: &mut Symbols) -> Affine {
    if !(a.known() && b.known()) || a.center.is_infinite() || b.center.is_infinite() {
        return Affine::unknown();
    }
    let range = (a.range.square() + b.range.square()).sqrt();
    let middle = |form: &Affine| form.center.clamp(form.range.low, form.range.high);
    let (x, y) = (middle(a), middle(b));
    let distance = x.hypot(y);
    // Of a smaller one, the direction is lost in rounding: any slopes do, and these are right at the origin.
    if distance < 1e-150 {
        return Affine::within(range, symbols);
    }
    let slopes = [x / distance, y / distance];
    let away = |form: &Affine, middle: f64| (form.range - Interval::point(middle)).magnitude();
    let way = (Interval::point(away(a, x)).square() + Interval::point(away(b, y)).square()).sqrt();
    // Slopes, distance and their products are rounded: a few units in the last place of the length.
    let slack = 16.0 * f64::EPSILON * range.high;
    let nearest = distance - way.high - slack;
    let curved = (way.square() * Interval::point(2.0 * nearest).reciprocal()).high;
    let most = (2.0 * way.high).min(2.0 * range.high);
    let above = if nearest > 0.0 { most.min(curved) } else { most };
    let plane = Affine::combination(&[(slopes[0], a), (slopes[1], b)], 0.0);
    plane.shifted(Interval::new(-slack, above + slack), symbols).ranged(range)
}

/// The angle of the point `(x, y)`; any angle where the origin or the cut may be met.
pub(super) fn atan2(y: &Affine, x: &Affine, symbols: &mut Symbols) -> Affine {
    if !(x.known() && y.known()) || x.center.is_infinite() || y.center.is_infinite() {
        return Affine::unknown();
    }
    let square = x.range.square() + y.range.square();
    let cut = x.range.low <= 0.0 && y.range.contains(0.0);
    if cut || square.low <= 0.0 {
        return Affine::within(all_angles(), symbols);
    }
    let inverse = square.reciprocal();
    let slopes = [-(y.range * inverse), x.range * inverse];
    let middle = |form: &Affine| form.center.clamp(form.range.low, form.range.high);
    let places = [middle(x), middle(y)];
    let mut offset = elementary::atan2(Interval::point(places[1]), Interval::point(places[0]));
    let lines = slopes.map(|slope| 0.5 * slope.low + 0.5 * slope.high);
    for (i, form) in [x, y].into_iter().enumerate() {
        let away = form.range - Interval::point(places[i]);
        offset = offset + (slopes[i] - Interval::point(lines[i])) * away
            - Interval::point(lines[i]) * Interval::point(places[i]);
    }
    let plane = Affine::combination(&[(lines[0], x), (lines[1], y)], 0.0);
    plane.shifted(offset, symbols).ranged(elementary::atan2(y.range, x.range))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the shared place leaves open of the value of a form.
    fn holds(form: &Affine, d: [f64; 2], truth: f64) {
        let dot = |a: &[f64]| a.iter().zip(d).map(|(a, d)| a * d).sum::<f64>();
        let open: f64 = form.spread.iter().map(|s| s.abs()).sum::<f64>() + form.rest;
        let off = (form.center + dot(&form.ball) - truth).abs();
        assert!(off <= open + 1e-14, "{truth}: {off} is more than {open}");
        assert!(form.range.low - 1e-14 <= truth && truth <= form.range.high + 1e-14);
    }

    #[test]
    fn choices_and_lengths_hold_their_values() {
        let mut random = 0.37_f64;
        let mut next = |size: f64| {
            random = (random * 997.0 + 0.123).fract();
            size * (2.0 * random - 1.0)
        };
        for _ in 0..2000 {
            let width = next(0.5).abs().max(1e-6);
            let mut form =
                || Affine::new(next(1.0), vec![next(width), next(width)], Vec::new(), 0.0);
            let (a, b) = (form(), form());
            for k in 0..12 {
                let (sin, cos) = (0.55 * f64::from(k)).sin_cos();
                let length = f64::from(k % 4) / 3.0;
                let d = [length * cos, length * sin];
                let value = |f: &Affine| f.center + f.ball[0] * d[0] + f.ball[1] * d[1];
                let (x, y) = (value(&a), value(&b));
                let all = &mut Symbols::default();
                holds(&max(&a, &b, all), d, x.max(y));
                holds(&min(&a, &b, &mut Symbols::default()), d, x.min(y));
                holds(&abs(&a, &mut Symbols::default()), d, x.abs());
                holds(&hypot(&a, &b, &mut Symbols::default()), d, x.hypot(y));
                holds(&atan2(&a, &b, &mut Symbols::default()), d, x.atan2(y));
                let chosen = if x < y { 3.0 * x } else { y - 2.0 };
                let yes = Affine::combination(&[(3.0, &a)], 0.0);
                let no = b.plus(&Affine::constant(-2.0));
                holds(&if_lt([&a, &b], [&yes, &no], &mut Symbols::default()), d, chosen);
                holds(&floor(&a, &mut Symbols::default()), d, x.floor());
            }
        }
    }

    #[test]
    fn infinite_literals_are_beyond_every_number() {
        let symbols = &mut Symbols::default();
        let x = Affine::new(0.3, vec![0.1], Vec::new(), 0.0);
        let infinite = Affine::constant(f64::INFINITY);
        assert_eq!(clamp(&x, [&Affine::constant(0.0), &infinite], symbols).center, 0.3);
        assert!(!x.plus(&infinite).known());
        assert!(!max(&Affine::unknown(), &infinite, symbols).known());
    }
}
