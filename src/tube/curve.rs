//! Functions of one number: values, slopes and curvatures over an interval, and the line that fits best.

use super::affine::{Affine, Symbols};
use crate::formula::Function;
use crate::policy::{Activation, normaliser_range};
use crate::real::bound::{Interval, elementary};

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Curve {
    /// Square root.
    Root,
    /// One by the number.
    Reciprocal,
    /// A whole power.
    Whole(i32),
    /// Another constant power.
    Power(f32),
    /// An elementary function without jumps.
    Apply(Function),
    /// An activation of a network.
    Activated(Activation),
    /// The factor of a norm with this epsilon, of a variance.
    Normaliser(f32),
}

/// A line and what the function may be off it: `slope x + offset`.
#[derive(Clone, Copy, Debug)]
struct Line {
    slope: f64,
    offset: Interval,
}

impl Line {
    fn width(&self) -> f64 {
        self.offset.high - self.offset.low
    }
}

fn point(x: f64) -> Interval {
    Interval::point(x)
}

impl Curve {
    /// Whether it has a value and a slope at every number of `x`, but for an infinite slope at an end.
    fn defined(self, x: Interval) -> bool {
        match self {
            Self::Root => x.low >= 0.0,
            Self::Reciprocal => !x.contains(0.0),
            Self::Whole(exponent) => exponent >= 0 || !x.contains(0.0),
            Self::Power(exponent) if exponent > 0.0 => exponent.is_finite() && x.low >= 0.0,
            Self::Power(exponent) => exponent.is_finite() && x.low > 0.0,
            Self::Apply(Function::Ln | Function::LnUnit) => x.low > 0.0,
            Self::Apply(Function::Tan) => elementary::tan_defined(x),
            Self::Apply(Function::Asin | Function::Acos) => elementary::within_one(x),
            Self::Normaliser(_) => x.low >= 0.0,
            Self::Apply(_) | Self::Activated(_) => true,
        }
    }

    /// Values and slopes over `x`.
    fn range(self, x: Interval) -> (Interval, Interval) {
        match self {
            Self::Root => {
                let root = x.sqrt();
                (root, (root + root).reciprocal())
            }
            Self::Reciprocal => (x.reciprocal(), -x.reciprocal().square()),
            Self::Whole(exponent) => elementary::powi(x, exponent),
            Self::Power(exponent) => elementary::powf(x, f64::from(exponent)),
            Self::Apply(function) => applied(function, x),
            Self::Activated(activation) => activation.range(x),
            Self::Normaliser(epsilon) => normaliser_range(x, epsilon),
        }
    }

    /// Second derivatives over `x`, where there is a formula for them.
    fn curvature(self, x: Interval) -> Option<Interval> {
        let curvature = match self {
            Self::Root => {
                let root = x.sqrt();
                -(point(4.0) * root * root.square()).reciprocal()
            }
            Self::Reciprocal => point(2.0) * x.reciprocal() * x.reciprocal().square(),
            Self::Whole(exponent @ 2..) => {
                let factor = f64::from(exponent) * (f64::from(exponent) - 1.0);
                point(factor) * elementary::powi(x, exponent - 2).0
            }
            Self::Whole(_) | Self::Power(_) | Self::Activated(_) | Self::Normaliser(_) => {
                return None;
            }
            Self::Apply(function) => bent(function, x)?,
        };
        Some(curvature)
    }

    /// The line with the narrowest offset among those that the slopes and the curvature give.
    fn line(self, x: Interval) -> Option<Line> {
        let (values, slopes) = self.range(x);
        let [low, high] = [x.low, x.high].map(|end| self.range(point(end)).0);
        let flat = Line { slope: 0.0, offset: values };
        // Less a line that is steeper nowhere, the function rises; less one that is nowhere flatter, it falls.
        let rising = |slope: f64| {
            let at = |end: f64, value: Interval| value - point(slope) * point(end);
            Line { slope, offset: Interval::new(at(x.low, low).low, at(x.high, high).high) }
        };
        let falling = |slope: f64| {
            let at = |end: f64, value: Interval| value - point(slope) * point(end);
            Line { slope, offset: Interval::new(at(x.high, high).low, at(x.low, low).high) }
        };
        let lines =
            [Some(flat), Some(rising(slopes.low)), Some(falling(slopes.high)), self.tangent(x)];
        let usable = |line: &Line| line.slope.is_finite() && line.width().is_finite();
        let usable = lines.into_iter().flatten().filter(usable);
        usable.min_by(|a, b| a.width().total_cmp(&b.width()))
    }

    /// The tangent in the middle, and what the curvature takes the function off it.
    fn tangent(self, x: Interval) -> Option<Line> {
        let curvature = self.curvature(x)?;
        let middle = (0.5 * x.low + 0.5 * x.high).clamp(x.low, x.high);
        let (value, slopes) = self.range(point(middle));
        let slope = 0.5 * slopes.low + 0.5 * slopes.high;
        let away = (x - point(middle)).magnitude();
        let square = Interval::new(0.0, point(away).square().high);
        let bend = point(0.5) * curvature * square;
        let tilt = (slopes - point(slope)) * Interval::new(-away, away);
        Some(Line { slope, offset: value - point(slope) * point(middle) + tilt + bend })
    }

    /// The function of a form.
    pub(super) fn of(self, x: &Affine, symbols: &mut Symbols) -> Affine {
        if !x.known() || x.center.is_infinite() || !self.defined(x.range) {
            return Affine::unknown();
        }
        let Some(line) = self.line(x.range) else { return Affine::unknown() };
        x.scaled(line.slope, line.offset, symbols).ranged(self.range(x.range).0)
    }
}

/// Values and slopes of an elementary function over `x`, of those that jump nowhere.
fn applied(function: Function, x: Interval) -> (Interval, Interval) {
    let pair = |value: Interval, slope: Interval| (value, slope);
    match function {
        Function::Sin | Function::PrincipalSin => pair(elementary::sin(x), elementary::cos(x)),
        Function::Cos | Function::PrincipalCos => pair(elementary::cos(x), -elementary::sin(x)),
        Function::Tan => elementary::tan(x),
        Function::Asin => elementary::asin(x),
        Function::Acos => elementary::acos(x),
        Function::Atan => elementary::atan(x),
        Function::Exp | Function::ExpNegative => pair(elementary::exp(x), elementary::exp(x)),
        Function::Ln | Function::LnUnit => pair(elementary::ln(x), x.reciprocal()),
        Function::Tanh => {
            let value = elementary::tanh(x);
            let slope = Interval::ONE - value.square();
            pair(value, Interval::new(slope.low.max(0.0), slope.high))
        }
        Function::Sigmoid => elementary::sigmoid(x),
        Function::Wrap => pair(elementary::wrap(x), Interval::ONE),
    }
}

/// Second derivatives of an elementary function over `x`.
fn bent(function: Function, x: Interval) -> Option<Interval> {
    let (value, slope) = applied(function, x);
    Some(match function {
        Function::Sin | Function::PrincipalSin | Function::Cos | Function::PrincipalCos => -value,
        Function::Exp | Function::ExpNegative => value,
        Function::Ln | Function::LnUnit => -slope.square(),
        Function::Tanh => -(point(2.0) * value * slope),
        Function::Sigmoid => slope * (Interval::ONE - point(2.0) * value),
        Function::Tan => point(2.0) * value * slope,
        Function::Atan => -(point(2.0) * x * slope.square()),
        Function::Asin | Function::Acos | Function::Wrap => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function as the platform has it.
    type Scalar = fn(f64) -> f64;

    /// Every function over many intervals: its line and its offset hold the sampled values.
    #[test]
    fn lines_hold_the_function() {
        let mut curves: Vec<(Curve, Scalar)> = vec![
            (Curve::Root, f64::sqrt),
            (Curve::Reciprocal, f64::recip),
            (Curve::Whole(2), |x| x * x),
            (Curve::Whole(3), |x| x * x * x),
            (Curve::Whole(-2), |x| 1.0 / (x * x)),
            (Curve::Power(1.7), |x| x.powf(f64::from(1.7_f32))),
        ];
        let applied: [(Function, Scalar); 10] = [
            (Function::Sin, f64::sin),
            (Function::Cos, f64::cos),
            (Function::Tan, f64::tan),
            (Function::Asin, f64::asin),
            (Function::Acos, f64::acos),
            (Function::Atan, f64::atan),
            (Function::Exp, f64::exp),
            (Function::Ln, f64::ln),
            (Function::Tanh, f64::tanh),
            (Function::Sigmoid, |x| 1.0 / (1.0 + (-x).exp())),
        ];
        curves.extend(applied.map(|(function, value)| (Curve::Apply(function), value)));
        let mut held = 0;
        for (curve, value) in curves {
            for i in 0..400 {
                let low = -3.0 + 6.0 * f64::from(i) / 400.0;
                for width in [1e-9, 0.01, 0.3, 2.0] {
                    let x = Interval::new(low, low + width);
                    if !curve.defined(x) {
                        continue;
                    }
                    let line = curve.line(x).expect("a line");
                    for j in 0..=20 {
                        let at = low + width * f64::from(j) / 20.0;
                        let off = value(at) - line.slope * at;
                        let slack = 1e-14 * (1.0 + off.abs());
                        let Interval { low, high } = line.offset;
                        assert!(
                            low - slack <= off && off <= high + slack,
                            "{curve:?} {x:?} {line:?}"
                        );
                        held += 1;
                    }
                }
            }
        }
        assert!(held > 200_000, "{held}");
    }

    /// The offset of a smooth function falls with the square of the width; that of the hyperbolic tangent by
    /// the product of its value and its slope, 0.92, which are bounded apart.
    #[test]
    fn lines_are_tight() {
        for (function, bend) in [(Function::Sin, 1.0), (Function::Tanh, 0.92), (Function::Exp, 2.0)]
        {
            let line = Curve::Apply(function).line(Interval::new(0.4, 0.6)).expect("a line");
            assert!(line.width() <= 0.5 * bend * 0.01 + 1e-12, "{function:?}: {line:?}");
        }
        let square = Curve::Whole(2).line(Interval::new(-0.1, 0.3)).expect("a line");
        assert!((square.width() - 0.04).abs() < 1e-12 && (square.slope - 0.2).abs() < 1e-12);
    }
}
