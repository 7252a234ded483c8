//! The bound type: sound Lipschitz constants and gradient enclosures of formulas over a box.

mod branch;
mod direction;
pub(crate) mod elementary;
mod pieces;
#[cfg(test)]
mod tests;

use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::rc::Rc;

use super::Real;
use super::approx::Exponent;
pub use super::interval::Interval;
pub use pieces::{Caveats, Enclosure, Piece};

thread_local! {
    /// The expressions of the formula under evaluation.
    static ARENA: RefCell<Arena> = RefCell::default();
}

/// Expressions by index, and the number of varying coordinates.
#[derive(Default)]
struct Arena {
    dimensions: usize,
    expressions: Vec<Rc<Enclosure>>,
}

/// A number of the formula in progress on this thread; of no use outside [`enclose`].
///
/// It stands for the exact functions of real arithmetic with f32 literals widened, so `sin` and the
/// like are those that the polynomials of the other instances approximate.
#[derive(Clone, Copy, Debug)]
pub struct Bound(u32);

/// The box that a formula is bounded over.
#[derive(Clone, Copy, Debug)]
pub struct Domain<'a> {
    /// Lower ends, one per input; may be negative infinity.
    pub low: &'a [f64],
    /// Upper ends, not below the lower; may be infinity.
    pub high: &'a [f64],
    /// Which inputs are perturbed: gradients are taken with respect to these alone, for every
    /// value of the others.
    pub varies: &'a [bool],
}

/// A Lipschitz constant in the Euclidean norm over the varying inputs, and what it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lipschitz {
    /// Never below the true constant of the function of real arithmetic; infinite if none could
    /// be shown.
    pub constant: f64,
    /// Number of smooth pieces that it is the largest gradient norm of.
    pub pieces: usize,
    /// Whether the pieces passed the limit, so that the constant is looser than need be.
    pub hulled: bool,
    /// Whether a general `if_lt` is assumed, not shown, to be continuous.
    pub assumed_continuous: bool,
}

/// Values and gradients of each output of `formula` over a box.
///
/// # Panics
/// If the sides of `domain` differ in length or are not intervals.
pub fn enclose(domain: Domain<'_>, formula: impl FnOnce(&[Bound]) -> Vec<Bound>) -> Vec<Enclosure> {
    let Domain { low, high, varies } = domain;
    assert!(
        low.len() == high.len() && low.len() == varies.len(),
        "a box has as many lower as upper ends"
    );
    assert!(
        low.iter()
            .zip(high)
            .all(|(&low, &high)| low <= high && low < f64::INFINITY && high > f64::NEG_INFINITY),
        "a lower end is not above its upper end"
    );
    let dimensions = varies.iter().filter(|&&varies| varies).count();
    let outer = ARENA.replace(Arena { dimensions, expressions: Vec::new() });
    let mut next = 0;
    let inputs: Vec<Bound> = (0..low.len())
        .map(|i| {
            let mut gradient = vec![Interval::ZERO; dimensions];
            if varies[i] {
                gradient[next] = Interval::ONE;
                next += 1;
            }
            Bound::new(Enclosure::smooth(Interval::new(low[i], high[i]), gradient))
        })
        .collect();
    let outputs = formula(&inputs);
    let enclosures = outputs.iter().map(|output| (*output.get()).clone());
    let enclosures = enclosures.collect();
    ARENA.set(outer);
    enclosures
}

/// The Lipschitz constant of `formula` over a box.
///
/// ```
/// use reachcast::real::{Real, bound::{Domain, lipschitz}};
/// let domain = Domain { low: &[-1.0, -1.0], high: &[1.0, 1.0], varies: &[true, true] };
/// let found = lipschitz(domain, |x| (x[0] + x[1]).max(x[0] * Real::lit(0.5)));
/// assert!((found.constant - 2.0_f64.sqrt()).abs() < 1e-15 && found.pieces == 2);
/// ```
///
/// # Panics
/// If the sides of `domain` differ in length or are not intervals.
pub fn lipschitz(domain: Domain<'_>, formula: impl FnOnce(&[Bound]) -> Bound) -> Lipschitz {
    let mut outputs = enclose(domain, |inputs| vec![formula(inputs)]);
    let output = outputs.remove(0);
    Lipschitz {
        constant: output.constant(),
        pieces: output.pieces.len(),
        hulled: output.caveats.hulled,
        assumed_continuous: output.caveats.assumed_continuous,
    }
}

impl Bound {
    fn new(expression: impl Into<Rc<Enclosure>>) -> Self {
        ARENA.with_borrow_mut(|arena| {
            arena.expressions.push(expression.into());
            Self((arena.expressions.len() - 1) as u32)
        })
    }

    fn get(self) -> Rc<Enclosure> {
        ARENA.with_borrow(|arena| Rc::clone(&arena.expressions[self.0 as usize]))
    }

    /// A function whose domain is the whole line.
    fn map(self, range: impl Fn(Interval) -> (Interval, Interval)) -> Self {
        Self::new(self.get().map(range))
    }

    /// A function of which nothing is known where its operand may lie outside its domain.
    fn within(
        self,
        domain: impl Fn(Interval) -> bool,
        range: impl Fn(Interval) -> (Interval, Interval),
    ) -> Self {
        let a = self.get();
        if a.pieces.iter().all(|piece| domain(piece.value)) {
            return self.map(range);
        }
        Self::new(a.without_bound())
    }
}

impl Add for Bound {
    type Output = Self;
    fn add(self, rhs: Self) -> Self {
        Self::new(Enclosure::combine(&self.get(), &rhs.get(), |a, b| (a + b, [Interval::ONE; 2])))
    }
}

impl Sub for Bound {
    type Output = Self;
    fn sub(self, rhs: Self) -> Self {
        Self::new(Enclosure::combine(&self.get(), &rhs.get(), |a, b| {
            (a - b, [Interval::ONE, -Interval::ONE])
        }))
    }
}

impl Mul for Bound {
    type Output = Self;
    fn mul(self, rhs: Self) -> Self {
        let (a, b) = (self.get(), rhs.get());
        let square = Rc::ptr_eq(&a, &b);
        Self::new(Enclosure::combine(&a, &b, |a, b| {
            (if square { a.square() } else { a * b }, [b, a])
        }))
    }
}

impl Div for Bound {
    type Output = Self;
    /// Nothing is known of a quotient whose denominator may be zero.
    fn div(self, rhs: Self) -> Self {
        let (a, b) = (self.get(), rhs.get());
        if b.value().contains(0.0) {
            let anything = |_, _| (Interval::ENTIRE, [Interval::ENTIRE; 2]);
            return Self::new(Enclosure::combine(&a, &b, anything).without_bound());
        }
        Self::new(Enclosure::combine(&a, &b, |a, b| {
            let inverse = b.reciprocal();
            (a * inverse, [inverse, -(a * inverse.square())])
        }))
    }
}

impl Neg for Bound {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(|value| (-value, -Interval::ONE))
    }
}

impl Real for Bound {
    fn lit(value: f32) -> Self {
        let dimensions = ARENA.with_borrow(|arena| arena.dimensions);
        // An infinity stands for a number larger than any.
        let value = f64::from(value);
        let range = Interval::new(value.min(f64::MAX), value.max(f64::MIN));
        let number = Enclosure::smooth(range, vec![Interval::ZERO; dimensions]);
        Self::new(if value.is_nan() { number.without_bound() } else { number })
    }

    fn abs(self) -> Self {
        Self::new(branch::abs(&self.get()))
    }

    fn sqrt(self) -> Self {
        self.within(
            |value| value.low >= 0.0,
            |value| {
                let root = value.sqrt();
                (root, (root + root).reciprocal())
            },
        )
    }

    /// Of the hulls of the inputs: one piece for each neuron. A rectified neuron that may be on either
    /// side of 0 has two pieces until the next layer, so the gradient of a network is that of every
    /// pattern of its neurons at once.
    fn dense(weight: &[f32], bias: &[f32], inputs: &[Self]) -> Vec<Self> {
        let hulls: Vec<Enclosure> = inputs.iter().map(|input| input.get().hull()).collect();
        let dimensions = ARENA.with_borrow(|arena| arena.dimensions);
        let rows = weight.chunks(inputs.len().max(1)).zip(bias);
        let sums = rows.map(|(row, bias)| Enclosure::weighted(row, *bias, &hulls, dimensions));
        sums.map(Self::new).collect()
    }

    fn floor(self) -> Self {
        Self::new(branch::floor(&self.get()))
    }

    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        Self::new(branch::if_lt(&self.get(), &rhs.get(), &yes.get(), &no.get()))
    }

    /// No bound has a NaN.
    fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        self.if_lt(rhs, yes, no)
    }

    fn sign(self) -> Self {
        Self::new(branch::sign(&self.get()))
    }

    fn wrap(self) -> Self {
        Self::new(branch::wrap(&self.get()))
    }

    fn atan2(self, x: Self) -> Self {
        Self::new(branch::atan2(&self.get(), &x.get()))
    }

    fn min(self, rhs: Self) -> Self {
        Self::new(branch::min(&self.get(), &rhs.get()))
    }

    fn max(self, rhs: Self) -> Self {
        Self::new(branch::max(&self.get(), &rhs.get()))
    }

    fn clamp(self, low: Self, high: Self) -> Self {
        Real::min(Real::max(self, low), high)
    }

    /// The gradient is `u[0] grad a + u[1] grad b` with `u` the direction of `(a, b)`; linear in
    /// `u`, so it is enough to take the corners of a polygon that contains the arcs of `u`.
    fn hypot(self, rhs: Self) -> Self {
        let push = |a: &Piece, b: &Piece, pieces: &mut Vec<Piece>| {
            let value = (a.value.square() + b.value.square()).sqrt();
            if a.flat() && b.flat() {
                pieces.push(Piece::sum(value, [Interval::ZERO; 2], a, b));
                return;
            }
            for corner in direction::directions([a.value, b.value]) {
                pieces.push(Piece::sum(value, corner, a, b));
            }
        };
        let (a, b) = (self.get(), rhs.get());
        Self::new(Enclosure::paired(&a, &b, direction::ARCS, push))
    }

    fn sin(self) -> Self {
        self.map(|angle| (elementary::sin(angle), elementary::cos(angle)))
    }

    fn cos(self) -> Self {
        self.map(|angle| (elementary::cos(angle), -elementary::sin(angle)))
    }

    fn tanh(self) -> Self {
        self.map(|value| {
            let range = elementary::tanh(value);
            let slope = Interval::ONE - range.square();
            (range, Interval::new(slope.low.max(0.0), slope.high))
        })
    }

    fn principal_sin_cos(self) -> [Self; 2] {
        [self.sin(), self.cos()]
    }

    fn tan(self) -> Self {
        self.within(elementary::tan_defined, elementary::tan)
    }

    fn asin(self) -> Self {
        self.within(elementary::within_one, elementary::asin)
    }

    fn acos(self) -> Self {
        self.within(elementary::within_one, elementary::acos)
    }

    fn atan(self) -> Self {
        self.map(elementary::atan)
    }

    fn exp(self) -> Self {
        self.map(|value| {
            let range = elementary::exp(value);
            (range, range)
        })
    }

    fn exp_negative(self) -> Self {
        self.exp()
    }

    fn exp_m1_negative(self) -> Self {
        Real::min(self, Self::lit(0.0)).exp() - Self::lit(1.0)
    }

    fn softplus_excess(self) -> Self {
        (Self::lit(1.0) + (-self.abs()).exp()).ln()
    }

    fn normal_share(self) -> Self {
        self.map(elementary::normal_share)
    }

    fn known_by(self, range: impl Fn(Interval) -> (Interval, Interval)) -> Option<Self> {
        Some(self.map(range))
    }

    fn sigmoid(self) -> Self {
        self.map(elementary::sigmoid)
    }

    fn ln(self) -> Self {
        self.within(|value| value.low > 0.0, |value| (elementary::ln(value), value.reciprocal()))
    }

    fn ln_unit(self) -> Self {
        self.ln()
    }

    fn powi(self, exponent: i32) -> Self {
        let domain = |value: Interval| exponent >= 0 || !value.contains(0.0);
        self.within(domain, |value| elementary::powi(value, exponent))
    }

    fn powf(self, exponent: f32) -> Self {
        match Exponent::of(exponent) {
            Exponent::Whole(exponent) => self.powi(exponent),
            Exponent::Root => self.sqrt(),
            Exponent::Other => {
                let domain = |value: Interval| {
                    exponent.is_finite()
                        && if exponent > 0.0 { value.low >= 0.0 } else { value.low > 0.0 }
                };
                self.within(domain, |value| elementary::powf(value, f64::from(exponent)))
            }
        }
    }
}
