//! Affine forms: a number as a function of where in a ball and in a box of symbols one is, rounded outward.

use crate::real::bound::Interval;

/// Symbols of a step: each stands for an unknown number in `[-1, 1]`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Symbols(usize);

impl Symbols {
    /// The first `count` are in use.
    pub(super) fn after(count: usize) -> Self {
        Self(count)
    }

    /// A symbol that nothing depends on yet.
    fn fresh(&mut self) -> usize {
        self.0 += 1;
        self.0 - 1
    }
}

/// All values `center + ball . d + spread . s + e` with d in the Euclidean unit ball, each s in
/// `[-1, 1]`, `|e| <= rest`, that lie in `range`.
///
/// Forms of one step share d and s, which is what keeps their differences small. A form with an infinite
/// `rest` says nothing, not even that the value is a number.
#[derive(Clone, Debug)]
pub(super) struct Affine {
    pub(super) center: f64,
    /// Zero beyond its length.
    pub(super) ball: Vec<f64>,
    /// Zero beyond its length.
    pub(super) spread: Vec<f64>,
    pub(super) rest: f64,
    pub(super) range: Interval,
    /// Sum of the sizes of center and coefficients.
    mass: f64,
}

/// An upper bound of a sum that is not negative and was made of `count` rounded operations or fewer.
pub(super) fn upward(sum: f64, count: usize) -> f64 {
    let up = (sum * (1.0 + (count as f64 + 4.0) * f64::EPSILON)).next_up();
    if sum == 0.0 { 0.0 } else { up }
}

/// What `count` rounded sums of products may be off by together, given the sum of their sizes.
fn rounding(mass: f64, count: usize) -> f64 {
    if mass == 0.0 { 0.0 } else { (count as f64 + 4.0) * f64::EPSILON * mass + f64::MIN_POSITIVE }
}

/// An upper bound of the Euclidean norm.
pub(super) fn norm(vector: &[f64]) -> f64 {
    let largest = vector.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    // Squares of smaller numbers are lost; the sum of sizes is never below the norm.
    let length = match largest < 1e-140 {
        true => vector.iter().map(|x| x.abs()).sum(),
        false => vector.iter().map(|x| x * x).sum::<f64>().sqrt(),
    };
    upward(length, vector.len())
}

/// Sum of sizes.
fn sizes(vector: &[f64]) -> f64 {
    vector.iter().map(|x| x.abs()).sum()
}

/// `target += factor source`, longer if need be.
fn add_scaled(target: &mut Vec<f64>, factor: f64, source: &[f64]) {
    if target.len() < source.len() {
        target.resize(source.len(), 0.0);
    }
    target.iter_mut().zip(source).for_each(|(sum, x)| *sum += factor * x);
}

/// `target += factors rows`, four rows at a time.
fn add_rows(target: &mut [f64], factors: &[f64], rows: &[f64]) {
    let columns = target.len();
    for (factors, rows) in factors.chunks(4).zip(rows.chunks(4 * columns)) {
        if let [a, b, c, d] = *factors {
            let (first, second) = rows.split_at(2 * columns);
            let ((p, q), (r, s)) = (first.split_at(columns), second.split_at(columns));
            let pairs = p.iter().zip(q).zip(r.iter().zip(s));
            for (sum, ((p, q), (r, s))) in target.iter_mut().zip(pairs) {
                *sum += (a * p + b * q) + (c * r + d * s);
            }
            continue;
        }
        for (factor, row) in factors.iter().zip(rows.chunks(columns)) {
            target.iter_mut().zip(row).for_each(|(sum, x)| *sum += factor * x);
        }
    }
}

/// The numbers of both; both hold the same ones, so there are some.
fn common(a: Interval, b: Interval) -> Interval {
    let both = Interval::new(a.low.max(b.low), a.high.min(b.high));
    if both.low <= both.high { both } else { a }
}

impl Affine {
    /// The number `value`; an infinity stands for a number beyond all others.
    pub(super) fn constant(value: f64) -> Self {
        if value.is_nan() {
            return Self::unknown();
        }
        let range = Interval::new(value.min(f64::MAX), value.max(f64::MIN));
        let (center, mass) = (value, value.abs());
        Self { center, ball: Vec::new(), spread: Vec::new(), rest: 0.0, range, mass }
    }

    /// Of which nothing is known.
    pub(super) fn unknown() -> Self {
        let range = Interval::ENTIRE;
        let (ball, spread) = (Vec::new(), Vec::new());
        Self { center: 0.0, ball, spread, rest: f64::INFINITY, range, mass: 0.0 }
    }

    /// The form with these parts.
    pub(super) fn new(center: f64, ball: Vec<f64>, spread: Vec<f64>, rest: f64) -> Self {
        let sum = center.abs() + sizes(&ball) + sizes(&spread);
        let mass = upward(sum, ball.len() + spread.len() + 1);
        if !(mass.is_finite() && rest.is_finite()) {
            return Self::unknown();
        }
        let mut form = Self { center, ball, spread, rest, range: Interval::ENTIRE, mass };
        let radius = form.radius();
        form.range = Interval::point(center) + Interval::new(-radius, radius);
        form
    }

    /// A number of `range` of which nothing else is known; it depends on nothing.
    pub(super) fn within(range: Interval, symbols: &mut Symbols) -> Self {
        Self::constant(0.0).shifted(range, symbols).ranged(range)
    }

    /// Whether something is known of it.
    pub(super) fn known(&self) -> bool {
        self.rest.is_finite()
    }

    /// The number that it is, if it is one; an infinite literal is.
    pub(super) fn number(&self) -> Option<f64> {
        if self.center.is_infinite() {
            return Some(self.center);
        }
        (self.known() && self.range.low == self.range.high).then_some(self.range.low)
    }

    /// How far it may be from its center.
    pub(super) fn radius(&self) -> f64 {
        let sum = norm(&self.ball) + sizes(&self.spread) + self.rest;
        upward(sum, self.spread.len() + 2)
    }

    /// The same with what else is known of its values.
    pub(super) fn ranged(mut self, range: Interval) -> Self {
        if self.known() {
            self.range = common(self.range, range);
        }
        self
    }

    /// The sum of `terms`, each a factor and a form, and a constant.
    ///
    /// Every coefficient of the result is off by at most the rounding of its own sum; what all of them
    /// are off by together goes into the rest.
    pub(super) fn combination(terms: &[(f64, &Self)], constant: f64) -> Self {
        let used = || terms.iter().filter(|(factor, _)| *factor != 0.0);
        if used().any(|(_, form)| !form.known() || form.center.is_infinite()) {
            return Self::unknown();
        }
        let (mut center, mut rest, mut mass) = (constant, 0.0, constant.abs());
        let (mut ball, mut spread) = (Vec::new(), Vec::new());
        let mut count = usize::from(constant != 0.0);
        for (factor, form) in used() {
            center += factor * form.center;
            rest += factor.abs() * form.rest;
            mass += factor.abs() * form.mass;
            add_scaled(&mut ball, *factor, &form.ball);
            add_scaled(&mut spread, *factor, &form.spread);
            count += 1;
        }
        let exact = count <= 1 && used().all(|(factor, _)| factor.abs() == 1.0);
        let lost = if exact { 0.0 } else { rounding(mass, count) };
        let rest = upward(rest + lost, count + 1);
        let range = used().fold(Interval::point(constant), |sum, (factor, form)| {
            sum + Interval::point(*factor) * form.range
        });
        Self::new(center, ball, spread, rest).ranged(range)
    }

    /// The rows of `weight`, `[outputs, inputs]`, times `inputs`, each plus its bias: what
    /// [`Self::combination`] gives row by row, but for the ranges, which long sums gain nothing from.
    pub(super) fn dense(weight: &[f32], bias: &[f32], inputs: &[Self]) -> Vec<Self> {
        if inputs.iter().any(|form| !form.known() || form.center.is_infinite()) {
            return vec![Self::unknown(); bias.len()];
        }
        let live: Vec<usize> =
            (0..inputs.len()).filter(|i| inputs[*i].mass > 0.0 || inputs[*i].rest > 0.0).collect();
        let longest = |part: fn(&Self) -> usize| inputs.iter().map(part).max().unwrap_or(0);
        let ball = longest(|form| form.ball.len());
        let columns = 1 + ball + longest(|form| form.spread.len());
        let mut rows = vec![0.0; live.len() * columns];
        for (row, i) in rows.chunks_mut(columns).zip(&live) {
            let form = &inputs[*i];
            row[0] = form.center;
            row[1..][..form.ball.len()].copy_from_slice(&form.ball);
            row[1 + ball..][..form.spread.len()].copy_from_slice(&form.spread);
        }
        let output = |(weight, bias): (&[f32], &f32)| {
            let factors: Vec<f64> = live.iter().map(|i| f64::from(weight[*i])).collect();
            let bias = f64::from(*bias);
            let mut sum = vec![0.0; columns];
            sum[0] = bias;
            add_rows(&mut sum, &factors, &rows);
            let sized = |part: fn(&Self) -> f64| -> f64 {
                factors.iter().zip(&live).map(|(factor, i)| factor.abs() * part(&inputs[*i])).sum()
            };
            let lost = rounding(bias.abs() + sized(|form| form.mass), live.len() + 1);
            let rest = upward(sized(|form| form.rest) + lost, live.len() + 2);
            Self::new(sum[0], sum[1..=ball].to_vec(), sum[1 + ball..].to_vec(), rest)
        };
        weight.chunks(inputs.len().max(1)).zip(bias).map(output).collect()
    }

    /// The sum of both.
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self::combination(&[(1.0, self), (1.0, other)], 0.0)
    }

    /// The difference of both; nothing where both are one form.
    pub(super) fn minus(&self, other: &Self) -> Self {
        Self::combination(&[(1.0, self), (-1.0, other)], 0.0)
    }

    /// Negated.
    pub(super) fn negated(&self) -> Self {
        if self.center.is_infinite() {
            return Self::constant(-self.center);
        }
        Self::combination(&[(-1.0, self)], 0.0)
    }

    /// The form plus any number of `offset`, which depends on nothing else.
    pub(super) fn shifted(&self, offset: Interval, symbols: &mut Symbols) -> Self {
        let Interval { low, high } = offset;
        let middle = 0.5 * low + 0.5 * high;
        let half = (Interval::point(high) - Interval::point(middle))
            .hull(Interval::point(middle) - Interval::point(low))
            .magnitude();
        if !half.is_finite() {
            return Self::unknown();
        }
        let mut moved = Self::combination(&[(1.0, self)], middle);
        if half <= f64::EPSILON * moved.mass {
            moved.rest = upward(moved.rest + half, 1);
        } else {
            let symbol = symbols.fresh();
            moved.spread.resize(symbol + 1, 0.0);
            moved.spread[symbol] = half;
        }
        let range = self.range + offset;
        Self::new(moved.center, moved.ball, moved.spread, moved.rest).ranged(range)
    }

    /// `factor` times the form plus any number of `offset`.
    pub(super) fn scaled(&self, factor: f64, offset: Interval, symbols: &mut Symbols) -> Self {
        Self::combination(&[(factor, self)], 0.0).shifted(offset, symbols)
    }

    /// The product of both.
    pub(super) fn times(&self, other: &Self, symbols: &mut Symbols) -> Self {
        if !(self.known() && other.known()) {
            return Self::unknown();
        }
        for (number, form) in [(self.number(), other), (other.number(), self)] {
            if let Some(number) = number {
                return match number.is_finite() {
                    true => Self::combination(&[(number, form)], 0.0),
                    false => Self::unknown(),
                };
            }
        }
        let (a, b) = (self.center, other.center);
        let linear = Self::combination(&[(b, self), (a, other)], 0.0);
        let offset = self.deviations(other) - Interval::point(a) * Interval::point(b);
        linear.shifted(offset, symbols).ranged(self.range * other.range)
    }

    /// The products of what both may be off their centers by: a quarter of the difference of the squares of
    /// sum and difference, the two scaled to one size.
    fn deviations(&self, other: &Self) -> Interval {
        let (a, b) = (self.radius(), other.radius());
        let scale = (b / a).sqrt();
        let plain = (Interval::point(a) * Interval::point(b)).high;
        if !(scale.is_normal() && scale.recip().is_normal()) {
            return Interval::new(-plain, plain);
        }
        // The factors' own rounding makes no difference: any two whose product is 1 would do, and what
        // their product misses of 1 is added.
        let inverse = scale.recip();
        let missing = plain * 4.0 * f64::EPSILON;
        let side = |sign: f64| {
            let sum = Self::combination(&[(scale, self), (sign * inverse, other)], 0.0).radius();
            let quarter = (Interval::point(sum).square() * Interval::point(0.25)).high;
            upward(quarter.min(plain) + missing, 2)
        };
        Interval::new(-side(-1.0), side(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of `form` at a place of ball and symbols.
    fn at(form: &Affine, d: &[f64], s: &[f64]) -> f64 {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        form.center + dot(&form.ball, d) + dot(&form.spread, s)
    }

    #[test]
    fn products_hold_every_product() {
        let mut symbols = Symbols::after(1);
        let a = Affine::new(2.0, vec![0.3, -0.1], vec![0.2], 0.0);
        let b = Affine::new(-1.0, vec![0.2, 0.4], vec![-0.3], 0.0);
        let product = a.times(&b, &mut symbols);
        for i in 0..400 {
            let angle = 0.1 * f64::from(i);
            let length = f64::from(i % 7) / 6.0;
            let d = [length * angle.cos(), length * angle.sin()];
            let s = [f64::from(i % 3) - 1.0];
            let truth = at(&a, &d, &s) * at(&b, &d, &s);
            // What the last symbol and the rest leave open.
            let known = at(&product, &d, &s);
            let open = product.spread.get(1).copied().unwrap_or(0.0) + product.rest;
            assert!((truth - known).abs() <= open, "{truth} {known} {open}");
            assert!(product.range.contains(truth));
        }
        // The ranges alone give -4.41 to -0.37.
        assert!(product.range.low > -4.0 && product.range.high < -0.37, "{:?}", product.range);
    }

    #[test]
    fn sums_are_rounded_outward_and_copies_are_exact() {
        let tenth = Affine::constant(0.1);
        let sum = tenth.plus(&Affine::constant(0.2));
        // The exact sum of these two floats lies between 0.3 and the next.
        assert!(sum.range.contains(0.3) && sum.range.contains(0.3_f64.next_up()));
        assert_eq!(tenth.negated().number(), Some(-0.1));
        assert_eq!(tenth.minus(&tenth).range.low, 0.0);
    }

    #[test]
    fn what_is_not_known_stays_so() {
        let mut symbols = Symbols::default();
        let unknown = Affine::constant(f64::NAN);
        assert!(!unknown.known() && !unknown.plus(&Affine::constant(1.0)).known());
        let zero = Affine::constant(0.0);
        assert!(!zero.times(&unknown, &mut symbols).known());
        let huge = Affine::constant(f64::MAX);
        assert!(!huge.plus(&huge).known());
    }
}
