//! Closed intervals of f64 whose arithmetic rounds outward.

use std::ops::{Add, Mul, Neg, Sub};

/// The real numbers from `low` to `high`.
///
/// `low` is never positive infinity, `high` never negative infinity, and neither is NaN: an
/// infinite end says that nothing is known on that side. Every operation encloses the exact
/// result for all numbers of its operands; results that are exact are not widened, so that zero
/// stays zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A lower bound of `a + b`, tight.
fn sum_down(a: f64, b: f64) -> f64 {
    let sum = a + b;
    if sum.is_infinite() {
        return sum.next_down();
    }
    // The error of a rounded sum is itself a float (Knuth's TwoSum). Where the test itself
    // overflows it is NaN, and the sum is widened.
    let part = sum - a;
    let error = (a - (sum - part)) + (b - part);
    if error >= 0.0 { sum } else { sum.next_down() }
}

/// Lower and upper bound of `a b`; zero times an unbounded end is zero.
fn product(a: f64, b: f64) -> (f64, f64) {
    if a == 0.0 || b == 0.0 {
        return (0.0, 0.0);
    }
    let product = a * b;
    if (a.abs() == 1.0 || b.abs() == 1.0) && product.is_finite() {
        return (product, product);
    }
    (product.next_down(), product.next_up())
}

impl Interval {
    /// All real numbers.
    pub const ENTIRE: Self = Self::new(f64::NEG_INFINITY, f64::INFINITY);
    /// Zero.
    pub const ZERO: Self = Self::point(0.0);
    /// One.
    pub const ONE: Self = Self::point(1.0);

    /// The numbers from `low` to `high`.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// The number `value`, finite.
    pub const fn point(value: f64) -> Self {
        Self::new(value, value)
    }

    /// Whether `value` is one of the numbers.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// Whether the interval is the number zero.
    pub fn is_zero(self) -> bool {
        self.low == 0.0 && self.high == 0.0
    }

    /// Largest absolute value.
    pub fn magnitude(self) -> f64 {
        self.high.max(-self.low)
    }

    /// Smallest absolute value.
    pub fn smallest(self) -> f64 {
        self.low.max(-self.high).max(0.0)
    }

    /// The smallest interval with the numbers of both.
    pub fn hull(self, other: Self) -> Self {
        Self::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// The square of each number.
    pub fn square(self) -> Self {
        let (low, _) = product(self.smallest(), self.smallest());
        let (_, high) = product(self.magnitude(), self.magnitude());
        Self::new(low.max(0.0), high)
    }

    /// The square root of each number; the interval must not reach below zero.
    pub fn sqrt(self) -> Self {
        let low = self.low.sqrt().next_down().max(0.0);
        let high = if self.high == 0.0 { 0.0 } else { self.high.sqrt().next_up() };
        Self::new(low, high)
    }

    /// One by each number other than zero.
    pub fn reciprocal(self) -> Self {
        if self.high <= 0.0 && self.low < 0.0 {
            return -(-self).reciprocal();
        }
        if self.low < 0.0 || self.high == 0.0 {
            return Self::ENTIRE;
        }
        let exact = |x: f64| x == 1.0;
        let low = (1.0 / self.high).next_down().max(0.0);
        // The low end may be negative zero.
        let high = (1.0 / self.low.abs()).next_up();
        Self::new(
            if exact(self.high) { 1.0 } else { low },
            if exact(self.low) { 1.0 } else { high },
        )
    }
}

impl Add for Interval {
    type Output = Self;
    fn add(self, rhs: Self) -> Self {
        Self::new(sum_down(self.low, rhs.low), -sum_down(-self.high, -rhs.high))
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.high, -self.low)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, rhs: Self) -> Self {
        self + -rhs
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, rhs: Self) -> Self {
        let ends = [
            product(self.low, rhs.low),
            product(self.low, rhs.high),
            product(self.high, rhs.low),
            product(self.high, rhs.high),
        ];
        let low = ends.iter().map(|end| end.0).fold(f64::INFINITY, f64::min);
        let high = ends.iter().map(|end| end.1).fold(f64::NEG_INFINITY, f64::max);
        Self::new(low, high)
    }
}

/// An upper bound of the Euclidean norm of every vector in the box `sides`.
pub(super) fn norm(sides: &[Interval]) -> f64 {
    sides.iter().fold(Interval::ZERO, |sum, side| sum + side.square()).sqrt().high
}

#[cfg(test)]
mod tests {
    use super::Interval;

    #[test]
    fn rounding_encloses_and_exact_results_stay() {
        let tenth = Interval::point(0.1);
        // The exact sum of these two floats lies between the float 0.3 and the next.
        let sum = tenth + Interval::point(0.2);
        assert_eq!(sum, Interval::new(0.3, 0.3_f64.next_up()));
        assert_eq!(tenth - tenth, Interval::ZERO);
        assert_eq!(Interval::point(0.5) + Interval::ONE, Interval::point(1.5));
        let square = tenth * tenth;
        assert!(square.low < 0.1 * 0.1 && 0.1 * 0.1 < square.high);
        assert_eq!(Interval::ENTIRE * Interval::ZERO, Interval::ZERO);
        let root = Interval::point(2.0).sqrt();
        assert!(root.low < root.high && (root * root).contains(2.0));
    }

    #[test]
    fn overflow_and_unbounded_ends_stay_sound() {
        let huge = Interval::point(f64::MAX);
        assert_eq!(huge + huge, Interval::new(f64::MAX, f64::INFINITY));
        assert_eq!(Interval::ENTIRE + Interval::ENTIRE, Interval::ENTIRE);
        assert_eq!(Interval::ENTIRE * Interval::point(-2.0), Interval::ENTIRE);
        let tiny = Interval::point(f64::MIN_POSITIVE);
        assert!((tiny * tiny).high > 0.0);
        assert_eq!(Interval::new(0.0, 2.0).reciprocal().high, f64::INFINITY);
        assert_eq!(Interval::new(-1.0, 2.0).reciprocal(), Interval::ENTIRE);
        assert_eq!(Interval::new(2.0, f64::INFINITY).reciprocal().low, 0.0);
    }

    #[test]
    fn squares_know_their_sign() {
        assert_eq!(Interval::new(-2.0, 1.0).square().low, 0.0);
        assert!(Interval::new(-2.0, 1.0).square().contains(4.0));
        assert!(Interval::new(-3.0, -2.0).square().low > 3.9);
    }
}
