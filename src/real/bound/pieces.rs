//! Lists of smooth pieces, each an interval value with an interval gradient.

use std::rc::Rc;

use crate::real::interval::{Interval, norm};

/// Pieces beyond which operands are replaced by their hulls.
pub(super) const LIMIT: usize = 1024;

/// Values and gradients that an expression may have together.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// The values.
    pub value: Interval,
    /// The partial derivative by each varying coordinate, in their order.
    pub gradient: Vec<Interval>,
}

/// What the constant of an expression rests on besides its pieces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Caveats {
    /// The number of pieces passed the limit and hulls were taken: sound, but looser.
    pub hulled: bool,
    /// A branch is assumed to be continuous: its two sides could not be shown to be equal where
    /// it switches, nor to differ. `min`, `max`, `clamp` and `abs` never need this.
    pub assumed_continuous: bool,
    /// No finite constant can be given: a jump, or a value outside the domain of a function.
    pub unbounded: bool,
}

impl Caveats {
    /// Those of either.
    pub(super) fn or(self, other: Self) -> Self {
        Self {
            hulled: self.hulled || other.hulled,
            assumed_continuous: self.assumed_continuous || other.assumed_continuous,
            unbounded: self.unbounded || other.unbounded,
        }
    }
}

/// An expression over a box.
///
/// Wherever the expression has the value `v`, its gradient lies in the convex hull of the
/// gradients of those pieces whose values include `v`. Every operation is linear in the gradients
/// of its operands for given values (for `hypot` also in the direction), so applying it to
/// pieces, or to pairs of pieces, keeps this true; and a norm is largest at a corner of a hull.
#[derive(Clone, Debug, PartialEq)]
pub struct Enclosure {
    /// The pieces, at least one.
    pub pieces: Vec<Piece>,
    /// What they rest on.
    pub caveats: Caveats,
}

impl Enclosure {
    /// An expression of one piece.
    pub(super) fn smooth(value: Interval, gradient: Vec<Interval>) -> Self {
        Self { pieces: vec![Piece { value, gradient }], caveats: Caveats::default() }
    }

    /// All values.
    pub fn value(&self) -> Interval {
        let values = self.pieces.iter().map(|piece| piece.value);
        values.reduce(Interval::hull).unwrap_or(Interval::ENTIRE)
    }

    /// Lipschitz constant in the Euclidean norm over the varying coordinates, never too small.
    pub fn constant(&self) -> f64 {
        if self.caveats.unbounded {
            return f64::INFINITY;
        }
        let norms = self.pieces.iter().map(|piece| norm(&piece.gradient));
        norms.fold(0.0, f64::max)
    }

    /// Whether no varying coordinate changes the expression.
    pub(super) fn fixed(&self) -> bool {
        let mut sides = self.pieces.iter().flat_map(|piece| &piece.gradient);
        !self.caveats.unbounded && sides.all(|side| side.is_zero())
    }

    /// The number that the expression is, if it is one.
    pub(super) fn number(&self) -> Option<f64> {
        let Interval { low, high } = self.value();
        (low == high && self.fixed()).then_some(low)
    }

    /// One piece with everything in it.
    pub(super) fn hull(&self) -> Self {
        let mut pieces = self.pieces.iter();
        let mut all = match pieces.next() {
            Some(first) => first.clone(),
            None => return self.clone(),
        };
        for piece in pieces {
            all.value = all.value.hull(piece.value);
            for (side, other) in all.gradient.iter_mut().zip(&piece.gradient) {
                *side = side.hull(*other);
            }
        }
        Self {
            pieces: vec![all],
            caveats: Caveats {
                hulled: self.caveats.hulled || self.pieces.len() > 1,
                ..self.caveats
            },
        }
    }

    /// A smooth function: `range` gives the values and the derivatives over a piece's values.
    pub(super) fn map(&self, range: impl Fn(Interval) -> (Interval, Interval)) -> Self {
        let apply = |piece: &Piece| {
            let (value, slope) = range(piece.value);
            let gradient = piece.gradient.iter().map(|&side| slope * side).collect();
            Piece { value, gradient }
        };
        Self { pieces: self.pieces.iter().map(apply).collect(), caveats: self.caveats }
    }

    /// A smooth function of two: `range` gives the values and both partial derivatives.
    pub(super) fn combine(
        a: &Rc<Self>,
        b: &Rc<Self>,
        range: impl Fn(Interval, Interval) -> (Interval, [Interval; 2]),
    ) -> Self {
        Self::paired(a, b, 1, |one, other, pieces| {
            let (value, slopes) = range(one.value, other.value);
            pieces.push(Piece::sum(value, slopes, one, other));
        })
    }

    /// `weights x + bias` of `inputs`, each a single piece: one piece.
    ///
    /// # Panics
    /// If an input has more.
    pub(super) fn weighted(weights: &[f32], bias: f32, inputs: &[Self], dimensions: usize) -> Self {
        let mut value = Interval::point(f64::from(bias));
        let mut gradient = vec![Interval::ZERO; dimensions];
        let mut caveats = Caveats::default();
        for (&weight, input) in weights.iter().zip(inputs) {
            let [piece] = &input.pieces[..] else { panic!("a hull has one piece") };
            let weight = Interval::point(f64::from(weight));
            value = value + weight * piece.value;
            for (side, other) in gradient.iter_mut().zip(&piece.gradient) {
                *side = *side + weight * *other;
            }
            caveats = caveats.or(input.caveats);
        }
        Self { pieces: vec![Piece { value, gradient }], caveats }
    }

    /// Applies `push` to each pair of pieces; it adds at most `fan` pieces.
    ///
    /// An expression paired with itself needs the pairs of equals only: both operands have one
    /// value and one gradient.
    pub(super) fn paired(
        a: &Rc<Self>,
        b: &Rc<Self>,
        fan: usize,
        push: impl Fn(&Piece, &Piece, &mut Vec<Piece>),
    ) -> Self {
        let mut pieces = Vec::new();
        if Rc::ptr_eq(a, b) {
            let only = a.within(fan * a.pieces.len());
            for piece in &only.pieces {
                push(piece, piece, &mut pieces);
            }
            let caveats = only.caveats;
            return Self { pieces, caveats };
        }
        let (a, b) = Self::fitted(a, b, |a, b| fan * a * b);
        for one in &a.pieces {
            for other in &b.pieces {
                push(one, other, &mut pieces);
            }
        }
        let caveats = a.caveats.or(b.caveats);
        Self { pieces, caveats }
    }

    /// The pieces of both, as values between which a branch chooses.
    pub(super) fn union(a: &Rc<Self>, b: &Rc<Self>) -> Self {
        let (a, b) = Self::fitted(a, b, |a, b| a + b);
        Self {
            pieces: a.pieces.iter().chain(&b.pieces).cloned().collect(),
            caveats: a.caveats.or(b.caveats),
        }
    }

    /// The operand, or its hull if `count` pieces would come of it and pass the limit.
    fn within(self: &Rc<Self>, count: usize) -> Rc<Self> {
        if count <= LIMIT { Rc::clone(self) } else { Rc::new(self.hull()) }
    }

    /// The operands, with hulls in place of the shorter, then of both, where `count` of their
    /// numbers of pieces passes the limit.
    fn fitted(
        a: &Rc<Self>,
        b: &Rc<Self>,
        count: impl Fn(usize, usize) -> usize,
    ) -> (Rc<Self>, Rc<Self>) {
        let (m, n) = (a.pieces.len(), b.pieces.len());
        if m < n {
            let a = a.within(count(m, n));
            let b = b.within(count(a.pieces.len(), n));
            (a, b)
        } else {
            let b = b.within(count(m, n));
            let a = a.within(count(m, b.pieces.len()));
            (a, b)
        }
    }

    /// All values and gradients, for an operand outside the domain of a function.
    ///
    /// A coordinate that the operand does not depend on stays without influence.
    pub(super) fn without_bound(&self) -> Self {
        let everything = self.hull().map(|_| (Interval::ENTIRE, Interval::ENTIRE));
        Self { caveats: Caveats { unbounded: true, ..self.caveats }, ..everything }
    }
}

impl Piece {
    /// The piece with gradient `slopes[0] grad a + slopes[1] grad b`.
    pub(super) fn sum(value: Interval, slopes: [Interval; 2], a: &Self, b: &Self) -> Self {
        let sides = a.gradient.iter().zip(&b.gradient);
        Self { value, gradient: sides.map(|(&a, &b)| slopes[0] * a + slopes[1] * b).collect() }
    }

    /// Whether the gradient is zero.
    pub(super) fn flat(&self) -> bool {
        self.gradient.iter().all(|side| side.is_zero())
    }
}
