//! Planes below convex pieces: curvature by the rules of disciplined convex programming, and subgradients.

use super::affine::Affine;
use super::piece::{Nodes, Piece};
use crate::formula::{Function, Node};
use crate::real::bound::Interval;

/// What is known of the curvature of a node over all states.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bend {
    Constant,
    Affine,
    Convex,
    Concave,
    Unknown,
}

impl Bend {
    fn plus(self, other: Self) -> Self {
        match (self, other) {
            (Self::Constant, bend) | (bend, Self::Constant) => bend,
            (Self::Affine, bend) | (bend, Self::Affine) => bend,
            (one, other) if one == other => one,
            _ => Self::Unknown,
        }
    }

    fn scaled(self, factor: Interval) -> Self {
        match self {
            Self::Constant | Self::Affine | Self::Unknown => self,
            _ if factor.low >= 0.0 => self,
            Self::Convex if factor.high <= 0.0 => Self::Concave,
            Self::Concave if factor.high <= 0.0 => Self::Convex,
            _ => Self::Unknown,
        }
    }

    fn is_convex(self) -> bool {
        matches!(self, Self::Constant | Self::Affine | Self::Convex)
    }

    fn is_concave(self) -> bool {
        matches!(self, Self::Constant | Self::Affine | Self::Concave)
    }

    fn is_affine(self) -> bool {
        matches!(self, Self::Constant | Self::Affine)
    }
}

/// Value and gradients at one state, and the curvature over all states.
#[derive(Clone, Debug)]
struct Dual {
    value: Interval,
    /// Holds a subgradient of what is convex, a supergradient of what is concave; `[states]`.
    gradient: Vec<Interval>,
    bend: Bend,
    /// Whether it is 0 or more at every state.
    positive: bool,
    /// Whether it is a sum of squares of affine nodes, with factors and a constant of 0 or more.
    squares: bool,
}

impl Dual {
    fn constant(value: Interval, states: usize) -> Self {
        let positive = value.low >= 0.0;
        let gradient = vec![Interval::ZERO; states];
        Self { value, gradient, bend: Bend::Constant, positive, squares: positive }
    }

    fn unknown(states: usize) -> Self {
        let gradient = vec![Interval::ENTIRE; states];
        let value = Interval::ENTIRE;
        Self { value, gradient, bend: Bend::Unknown, positive: false, squares: false }
    }

    /// The function with `value` whose gradient is `slope` times that of `self`.
    fn chained(&self, value: Interval, slope: Interval, bend: Bend) -> Self {
        let gradient = self.gradient.iter().map(|side| slope * *side).collect();
        Self { value, gradient, bend, positive: value.low >= 0.0, squares: false }
    }

    fn scaled(&self, factor: Interval) -> Self {
        let scaled = self.chained(factor * self.value, factor, self.bend.scaled(factor));
        let kept = factor.low >= 0.0;
        Self { positive: kept && self.positive, squares: kept && self.squares, ..scaled }
    }

    fn plus(&self, other: &Self) -> Self {
        let sides = self.gradient.iter().zip(&other.gradient);
        Self {
            value: self.value + other.value,
            gradient: sides.map(|(a, b)| *a + *b).collect(),
            bend: self.bend.plus(other.bend),
            positive: self.positive && other.positive,
            squares: self.squares && other.squares,
        }
    }

    /// The square, of what is affine.
    fn square(&self) -> Self {
        let slope = Interval::point(2.0) * self.value;
        let square = self.chained(self.value.square(), slope, Bend::Convex);
        Self { positive: true, squares: true, ..square }
    }

    /// The larger of two convex ones: its subgradients at a state are those of the larger there.
    fn max(&self, other: &Self) -> Self {
        let positive = self.positive || other.positive;
        let chosen = if self.value.low >= other.value.high {
            self.clone()
        } else if other.value.low >= self.value.high {
            other.clone()
        } else {
            let sides = self.gradient.iter().zip(&other.gradient);
            let gradient = sides.map(|(a, b)| a.hull(*b)).collect();
            let (a, b) = (self.value, other.value);
            let value = Interval::new(a.low.max(b.low), a.high.max(b.high));
            Self { value, gradient, ..self.clone() }
        };
        Self { bend: Bend::Convex, positive, squares: false, ..chosen }
    }

    /// Euclidean length: its gradient is the direction of the two, whose coordinates are within `[-1, 1]`.
    fn hypot(&self, other: &Self) -> Self {
        let value = (self.value.square() + other.value.square()).sqrt();
        let share = |side: Interval| {
            let share = if value.low > 0.0 { side * value.reciprocal() } else { Interval::ENTIRE };
            Interval::new(share.low.clamp(-1.0, 1.0), share.high.clamp(-1.0, 1.0))
        };
        let (a, b) = (share(self.value), share(other.value));
        let sum = self.chained(value, a, Bend::Convex).plus(&other.chained(value, b, Bend::Convex));
        Self { value, bend: Bend::Convex, positive: true, ..sum }
    }
}

/// A lower bound over the states `x` of `piece`, if it is convex: its tangent at their centers.
pub(super) fn below(piece: &Piece, duals: &Duals, x: &[Affine]) -> Option<f64> {
    let states = x.len();
    let start = Dual::constant(piece.constant, states);
    let sum = piece
        .terms
        .iter()
        .fold(start, |sum, (node, factor)| sum.plus(&duals.0[*node as usize].scaled(*factor)));
    if !sum.bend.is_convex() {
        return None;
    }
    let mut least = sum.value;
    let mut slopes = Vec::with_capacity(states);
    for (side, form) in sum.gradient.iter().zip(x) {
        let middle = 0.5 * side.low + 0.5 * side.high;
        if !middle.is_finite() {
            return None;
        }
        let away = Interval::point((*side - Interval::point(middle)).magnitude());
        let radius = Interval::point(form.radius());
        least = least - away * radius;
        slopes.push(middle);
    }
    let moved: Vec<Affine> = x.iter().map(deviation).collect();
    let terms: Vec<(f64, &Affine)> = slopes.into_iter().zip(&moved).collect();
    Some((least + Affine::combination(&terms, 0.0).range).low)
}

/// The form less its center.
fn deviation(form: &Affine) -> Affine {
    let (ball, spread) = (form.ball.clone(), form.spread.clone());
    if form.known() { Affine::new(0.0, ball, spread, form.rest) } else { form.clone() }
}

/// The nodes at the centers of a set of states.
pub(super) struct Duals(Vec<Dual>);

impl Duals {
    /// All nodes at the state `center`.
    pub(super) fn new(nodes: Nodes<'_>, center: &[f64]) -> Self {
        let mut duals: Vec<Dual> = Vec::with_capacity(nodes.graph.nodes.len());
        for i in 0..nodes.graph.nodes.len() {
            let dual = dual(nodes, i as u32, center, &duals);
            duals.push(dual);
        }
        Self(duals)
    }
}

/// One node, given the earlier ones.
fn dual(nodes: Nodes<'_>, node: u32, center: &[f64], duals: &[Dual]) -> Dual {
    let states = center.len();
    if let Some(value) = nodes.constant(node) {
        return Dual::constant(value, states);
    }
    let at = |i: u32| &duals[i as usize];
    let both = |a: u32, b: u32, bend: fn(Bend) -> bool| bend(at(a).bend) && bend(at(b).bend);
    match nodes.graph.nodes[node as usize] {
        Node::Input(i) if (i as usize) < states => {
            let mut input = Dual::constant(Interval::point(center[i as usize]), states);
            input.gradient[i as usize] = Interval::ONE;
            Dual { bend: Bend::Affine, positive: false, squares: false, ..input }
        }
        Node::Add(a, b) => at(a).plus(at(b)),
        Node::Sub(a, b) => at(a).plus(&at(b).scaled(-Interval::ONE)),
        Node::Neg(a) => at(a).scaled(-Interval::ONE),
        Node::Mul(a, b) if a == b && at(a).bend.is_affine() => at(a).square(),
        Node::Powi(a, 2) if at(a).bend.is_affine() => at(a).square(),
        Node::Mul(a, b) => match [a, b].map(|node| nodes.constant(node)) {
            [Some(number), _] => at(b).scaled(number),
            [_, Some(number)] => at(a).scaled(number),
            _ => Dual::unknown(states),
        },
        Node::Div(a, b) => match nodes.constant(b).filter(|b| !b.contains(0.0)) {
            Some(number) => at(a).scaled(number.reciprocal()),
            None => Dual::unknown(states),
        },
        Node::Abs(a) if at(a).bend.is_affine() => {
            let larger = at(a).max(&at(a).scaled(-Interval::ONE));
            Dual { positive: true, ..larger }
        }
        Node::Max(a, b) if both(a, b, Bend::is_convex) => at(a).max(at(b)),
        Node::IfLt(a, b, yes, no) if (yes, no) == (b, a) && both(a, b, Bend::is_convex) => {
            at(a).max(at(b))
        }
        Node::Min(a, b) if both(a, b, Bend::is_concave) => {
            let [a, b] = [a, b].map(|i| at(i).scaled(-Interval::ONE));
            a.max(&b).scaled(-Interval::ONE)
        }
        Node::Hypot(a, b) if [a, b].iter().all(|i| grows(at(*i))) => at(a).hypot(at(b)),
        Node::Sqrt(a) => root(at(a)),
        Node::Apply(Function::Exp, a) if at(a).bend.is_convex() => exponential(at(a)),
        _ => Dual::unknown(states),
    }
}

/// Whether a length may have it for a side and be convex: it is affine, or convex and never below 0, where
/// lengths rise with their sides.
fn grows(side: &Dual) -> bool {
    side.bend.is_affine() || (side.bend == Bend::Convex && side.positive)
}

/// The root: the length of a vector of affine nodes, or concave.
fn root(square: &Dual) -> Dual {
    let bend = match square.bend {
        _ if square.squares => Bend::Convex,
        bend if bend.is_concave() => Bend::Concave,
        _ => Bend::Unknown,
    };
    if square.value.low <= 0.0 || bend == Bend::Unknown {
        return Dual::unknown(square.gradient.len());
    }
    let value = square.value.sqrt();
    Dual { positive: true, ..square.chained(value, (value + value).reciprocal(), bend) }
}

/// The exponential of what is convex.
fn exponential(x: &Dual) -> Dual {
    let value = crate::real::bound::elementary::exp(x.value);
    Dual { positive: true, ..x.chained(value, value, Bend::Convex) }
}
