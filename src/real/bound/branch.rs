//! Operations that choose between pieces or jump: branches, minimum, absolute value, floor, angles.

use std::f64::consts::PI;
use std::rc::Rc;

use super::pieces::{Caveats, Enclosure, Piece};
use super::{direction, elementary};
use crate::real::interval::Interval;

/// The pieces of `a` that may have values in `window`, cut to it; `None` if there is none.
fn within(a: &Enclosure, window: Interval) -> Option<Rc<Enclosure>> {
    let cut = |piece: &Piece| {
        let value =
            Interval::new(piece.value.low.max(window.low), piece.value.high.min(window.high));
        (value.low <= value.high).then(|| Piece { value, gradient: piece.gradient.clone() })
    };
    let pieces: Vec<Piece> = a.pieces.iter().filter_map(cut).collect();
    let caveats = a.caveats;
    (!pieces.is_empty()).then(|| Rc::new(Enclosure { pieces, caveats }))
}

/// The pieces of either that survive; both whole where one may have no value at all.
fn choice([a, b]: [&Rc<Enclosure>; 2], window: impl Fn(&Enclosure) -> Interval) -> Rc<Enclosure> {
    if a.caveats.unbounded || b.caveats.unbounded {
        return Rc::new(Enclosure::union(a, b));
    }
    match (within(a, window(b)), within(b, window(a))) {
        (Some(a), Some(b)) => Rc::new(Enclosure::union(&a, &b)),
        (chosen, other) => chosen.or(other).unwrap_or_else(|| Rc::clone(a)),
    }
}

/// The smaller of two: each is chosen only where it is not above the other.
pub(super) fn min(a: &Rc<Enclosure>, b: &Rc<Enclosure>) -> Rc<Enclosure> {
    if same(a, b) || surely_below(a, b) {
        return Rc::clone(a);
    }
    if surely_below(b, a) {
        return Rc::clone(b);
    }
    let below = |other: &Enclosure| Interval::new(f64::NEG_INFINITY, other.value().high);
    choice([a, b], below)
}

/// The larger of two.
pub(super) fn max(a: &Rc<Enclosure>, b: &Rc<Enclosure>) -> Rc<Enclosure> {
    if same(a, b) || surely_below(b, a) {
        return Rc::clone(a);
    }
    if surely_below(a, b) {
        return Rc::clone(b);
    }
    let above = |other: &Enclosure| Interval::new(other.value().low, f64::INFINITY);
    choice([a, b], above)
}

/// Absolute value: where both signs occur, each piece is cut at zero.
pub(super) fn abs(a: &Rc<Enclosure>) -> Rc<Enclosure> {
    let value = a.value();
    if value.low >= 0.0 {
        return Rc::clone(a);
    }
    let negated = Rc::new(a.map(|value| (-value, -Interval::ONE)));
    if value.high <= 0.0 {
        return negated;
    }
    choice([a, &negated], |_| Interval::new(0.0, f64::INFINITY))
}

/// A function of slope `slope` but for its jumps: `jumps` says whether there may be one between the
/// values of a piece, `range` what its values are.
fn stepped(
    a: &Rc<Enclosure>,
    slope: Interval,
    jumps: impl Fn(Interval) -> bool,
    range: impl Fn(Interval) -> Interval,
) -> Enclosure {
    if a.pieces.iter().any(|piece| jumps(piece.value) && !piece.flat()) {
        let mut jumping = a.without_bound();
        for piece in &mut jumping.pieces {
            piece.value = range(a.value());
        }
        return jumping;
    }
    a.map(|value| (range(value), slope))
}

/// Floor: flat where no integer is crossed, else a jump.
pub(super) fn floor(a: &Rc<Enclosure>) -> Enclosure {
    let range = |value: Interval| Interval::new(value.low.floor(), value.high.floor());
    stepped(a, Interval::ZERO, |value| value.low.floor() != value.high.floor(), range)
}

/// Sign: flat where zero is not met, else a jump.
pub(super) fn sign(a: &Rc<Enclosure>) -> Enclosure {
    let sign = |x: f64| if x == 0.0 { 0.0 } else { x.signum() };
    let range = |value: Interval| Interval::new(sign(value.low), sign(value.high));
    stepped(a, Interval::ZERO, |value| sign(value.low) != sign(value.high), range)
}

/// Wrapped angle: a shift where no odd half turn is met, else a jump.
pub(super) fn wrap(a: &Rc<Enclosure>) -> Enclosure {
    stepped(a, Interval::ONE, |value| elementary::turns(value).is_none(), elementary::wrap)
}

/// The angle of the point `(x, y)`, whose gradient is the direction of the point, turned by a quarter,
/// over the distance from the origin; nothing is known at the origin and across the cut.
pub(super) fn atan2(y: &Rc<Enclosure>, x: &Rc<Enclosure>) -> Enclosure {
    let (up, across) = (y.value(), x.value());
    let origin = up.contains(0.0) && across.contains(0.0);
    let cut = across.low < 0.0 && up.low < 0.0 && up.high >= 0.0;
    if origin || cut {
        let anything = |_, _| (Interval::ENTIRE, [Interval::ENTIRE; 2]);
        let mut lost = Enclosure::combine(y, x, anything).without_bound();
        let half_turn = PI.next_up();
        lost.pieces.iter_mut().for_each(|piece| {
            piece.value = Interval::new(-half_turn, half_turn);
        });
        return lost;
    }
    Enclosure::paired(y, x, direction::ARCS, |y, x, pieces| {
        let value = elementary::atan2(y.value, x.value);
        if y.flat() && x.flat() {
            pieces.push(Piece::sum(value, [Interval::ZERO; 2], y, x));
            return;
        }
        let inverse = (y.value.square() + x.value.square()).sqrt().reciprocal();
        for [across, up] in direction::directions([x.value, y.value]) {
            pieces.push(Piece::sum(value, [across * inverse, -(up * inverse)], y, x));
        }
    })
}

/// `yes` where `a < b`, else `no`.
///
/// Where the intervals leave the choice open, the two sides must agree on the switching surface.
/// They do by construction when they are `a` and `b` themselves, and the choice is none for the
/// varying coordinates when `a` and `b` do not depend on them. Sides whose values are apart jump;
/// any others are assumed to agree, and the result says so.
pub(super) fn if_lt(
    a: &Rc<Enclosure>,
    b: &Rc<Enclosure>,
    yes: &Rc<Enclosure>,
    no: &Rc<Enclosure>,
) -> Rc<Enclosure> {
    let defined = !a.caveats.unbounded && !b.caveats.unbounded;
    let (left, right) = (a.value(), b.value());
    if defined && left.high < right.low {
        return Rc::clone(yes);
    }
    if (defined && left.low >= right.high) || same(yes, no) {
        return Rc::clone(no);
    }
    if same(yes, a) && same(no, b) {
        return min(a, b);
    }
    if same(yes, b) && same(no, a) {
        return max(a, b);
    }
    let mut either = Enclosure::union(yes, no);
    if !(a.fixed() && b.fixed()) {
        let (yes, no) = (yes.value(), no.value());
        let jump = yes.high < no.low || no.high < yes.low;
        let caveats = Caveats { hulled: false, assumed_continuous: !jump, unbounded: jump };
        either.caveats = either.caveats.or(caveats).or(a.caveats).or(b.caveats);
    }
    Rc::new(either)
}

/// Whether both are the same expression or the same number.
fn same(a: &Rc<Enclosure>, b: &Rc<Enclosure>) -> bool {
    let number = a.number();
    Rc::ptr_eq(a, b) || (number.is_some() && number == b.number())
}

/// Whether `a` is nowhere above `b`.
fn surely_below(a: &Enclosure, b: &Enclosure) -> bool {
    !a.caveats.unbounded && !b.caveats.unbounded && a.value().high <= b.value().low
}
