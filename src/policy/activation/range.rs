//! Values and slopes of activations over an interval, of the exact functions in real numbers.

use super::{Activation, Interval};
use crate::real::bound::elementary;

/// The smallest and the largest of a function that turns, and around where.
#[derive(Clone, Copy)]
struct Turn {
    at: Interval,
    value: f64,
}

/// A function that falls, rises from a valley on, and whose slope has one least and one largest value.
struct Bend {
    value: fn(f64) -> f64,
    slope: fn(f64) -> f64,
    /// Rounded outward, as are the other two.
    valley: Turn,
    least: Turn,
    most: Turn,
}

/// A place to within 1e-4.
const fn turn(low: f64, high: f64, value: f64) -> Turn {
    Turn { at: Interval::new(low, high), value }
}

const SILU: Bend = Bend {
    value: |x| x * logistic(x),
    slope: |x| logistic(x) * (1.0 + x * logistic(-x)),
    valley: turn(-1.2785, -1.2784, -0.278_464_6),
    least: turn(-2.3994, -2.3993, -0.099_839_4),
    most: turn(2.3993, 2.3994, 1.099_84),
};
const GELU: Bend = Bend {
    value: |x| x * elementary::normal(x),
    slope: |x| elementary::normal(x) + x * elementary::normal_density(x),
    valley: turn(-0.7518, -0.7517, -0.169_971_3),
    least: turn(-1.4144, -1.4141, -0.128_904_2),
    most: turn(1.4141, 1.4144, 1.128_904_2),
};
const GELU_BY_TANH: Bend = Bend {
    value: |x| 0.5 * x * (1.0 + inner(x).0.tanh()),
    slope: |x| {
        let (value, slope) = inner(x);
        let tanh = value.tanh();
        0.5 * (1.0 + tanh) + 0.5 * x * slope * (1.0 - tanh * tanh)
    },
    valley: turn(-0.7525, -0.7524, -0.170_040_8),
    least: turn(-1.4186, -1.4185, -0.128_993_1),
    most: turn(1.4185, 1.4186, 1.128_993_1),
};
const MISH: Bend = Bend {
    value: |x| x * x.exp().ln_1p().tanh(),
    slope: |x| {
        let tanh = x.exp().ln_1p().tanh();
        tanh + x * logistic(x) * (1.0 - tanh * tanh)
    },
    valley: turn(-1.1925, -1.1924, -0.308_843_5),
    least: turn(-2.2564, -2.2563, -0.112_526_2),
    most: turn(1.4905, 1.4906, 1.088_498_2),
};

/// What is inside of the tangent of `gelu_tanh`, and its slope.
fn inner(x: f64) -> (f64, f64) {
    let [first, third] = Activation::GELU_TANH.map(f64::from);
    (x * (first + third * x * x), first + 3.0 * third * x * x)
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// An interval around a value that was computed in f64 by a few operations on numbers up to `scale`.
fn about(value: f64, scale: f64) -> Interval {
    let slack = 1e-14 * (1.0 + scale.abs());
    match value.is_finite() {
        true => Interval::new(value - slack, value + slack),
        false => Interval::new(value.min(f64::MAX), value.max(f64::MIN)),
    }
}

fn meets(a: Interval, b: Interval) -> bool {
    a.low <= b.high && b.low <= a.high
}

impl Bend {
    fn range(&self, x: Interval) -> (Interval, Interval) {
        // Farther out each is 0 or the number itself, but for less than 1e-20.
        let value = |x: f64| match x {
            ..-60.0 => about(0.0, 0.0),
            60.0.. => about(x, x),
            _ => about((self.value)(x), x),
        };
        let slope = |x: f64| match x {
            ..-60.0 => about(0.0, 0.0),
            60.0.. => about(1.0, 1.0),
            _ => about((self.slope)(x), x),
        };
        let values = value(x.low).hull(value(x.high));
        let slopes = slope(x.low).hull(slope(x.high));
        let with = |range: Interval, turn: Turn| match meets(x, turn.at) {
            true => range.hull(Interval::point(turn.value)),
            false => range,
        };
        (with(values, self.valley), with(with(slopes, self.least), self.most))
    }
}

/// The range of a function that rises, by slopes of at most 1 that fall or rise all the way.
fn monotone(
    x: Interval,
    value: impl Fn(f64) -> f64,
    slope: impl Fn(f64) -> f64,
) -> (Interval, Interval) {
    let at = |x: f64| about(value(x), value(x));
    let steep = |x: f64| {
        let slope = about(slope(x), slope(x));
        Interval::new(slope.low.max(0.0), slope.high.min(1.0))
    };
    (Interval::new(at(x.low).low, at(x.high).high), steep(x.low).hull(steep(x.high)))
}

/// A linear unit that ends in an exponential below 0: `above x`, `below (exp(x / width) - 1)`.
fn exponential(x: Interval, [above, below, width]: [f64; 3]) -> (Interval, Interval) {
    let value = |x: f64| if x < 0.0 { below * (x / width).exp_m1() } else { above * x };
    let (values, _) = monotone(x, value, |_| 0.0);
    let left = |x: f64| about(below / width * (x.min(0.0) / width).exp(), below / width);
    let right = Interval::point(above);
    let slopes = match (x.low < 0.0, x.high > 0.0) {
        (true, true) => left(x.low).hull(left(0.0)).hull(right),
        (false, true) => right,
        // 0 itself has both slopes.
        (_, false) if x.high == 0.0 => left(x.low).hull(left(0.0)).hull(right),
        (_, false) => left(x.low).hull(left(x.high)),
    };
    (values, slopes)
}

/// A function that is linear but for corners at `corners`: values and slopes between.
fn linear(
    x: Interval,
    corners: &[f64],
    slopes: &[f64],
    value: impl Fn(f64) -> f64,
) -> (Interval, Interval) {
    let mut values = about(value(x.low), value(x.low)).hull(about(value(x.high), value(x.high)));
    let mut found: Option<Interval> = None;
    for (i, slope) in slopes.iter().enumerate() {
        let low = i.checked_sub(1).map_or(f64::NEG_INFINITY, |before| corners[before]);
        let high = corners.get(i).copied().unwrap_or(f64::INFINITY);
        if meets(x, Interval::new(low, high)) {
            let slope = Interval::point(*slope);
            found = Some(found.map_or(slope, |slopes| slopes.hull(slope)));
        }
    }
    for corner in corners.iter().filter(|corner| x.contains(**corner)) {
        values = values.hull(Interval::point(value(*corner)));
    }
    (values, found.unwrap_or(Interval::ENTIRE))
}

impl Activation {
    /// Values and slopes over `x`; where it has a corner, the slopes of both sides.
    pub(crate) fn range(self, x: Interval) -> (Interval, Interval) {
        match self {
            Self::Identity => (x, Interval::ONE),
            Self::Relu => (
                Interval::new(x.low.max(0.0), x.high.max(0.0)),
                linear(x, &[0.0], &[0.0, 1.0], |x| x.max(0.0)).1,
            ),
            Self::LeakyRelu { slope } => {
                let slope = f64::from(slope);
                let value = |x: f64| if x < 0.0 && slope != 0.0 { slope * x } else { x.max(0.0) };
                linear(x, &[0.0], &[slope, 1.0], value)
            }
            Self::Hardtanh { low, high } => {
                let [low, high] = [low, high].map(f64::from);
                linear(x, &[low, high], &[0.0, 1.0, 0.0], |x| x.clamp(low, high))
            }
            Self::Relu6 => linear(x, &[0.0, 6.0], &[0.0, 1.0, 0.0], |x| x.clamp(0.0, 6.0)),
            Self::Elu { alpha } => exponential(x, [1.0, f64::from(alpha), 1.0]),
            Self::Celu { alpha } => {
                let alpha = f64::from(alpha);
                exponential(x, [1.0, alpha, alpha])
            }
            Self::Selu => {
                let [scale, alpha] = Self::SELU;
                exponential(x, [f64::from(scale), f64::from(scale * alpha), 1.0])
            }
            Self::Silu => SILU.range(x),
            Self::Gelu => GELU.range(x),
            Self::GeluTanh => GELU_BY_TANH.range(x),
            Self::Mish => MISH.range(x),
            Self::Tanh => {
                let values = elementary::tanh(x);
                let slopes = Interval::ONE - values.square();
                (values, Interval::new(slopes.low.max(0.0), slopes.high))
            }
            Self::Sigmoid => elementary::sigmoid(x),
            Self::Softplus { beta } => {
                let beta = f64::from(beta);
                let value = |x: f64| x.max(0.0) + (-(beta * x).abs()).exp().ln_1p() / beta;
                monotone(x, value, |x| logistic(beta * x))
            }
            Self::Softsign => {
                let value = |x: f64| if x.is_infinite() { x.signum() } else { x / (1.0 + x.abs()) };
                let slope = |x: f64| (1.0 + x.abs()).powi(-2);
                let (values, slopes) = monotone(x, value, slope);
                (values, if x.contains(0.0) { slopes.hull(Interval::ONE) } else { slopes })
            }
        }
    }

    /// An upper bound of the absolute values of its slopes.
    pub(crate) fn slope(self) -> f64 {
        match self {
            // Exactly 1, not 1 and what rounding adds.
            Self::Tanh | Self::Softsign | Self::Softplus { .. } => 1.0,
            _ => self.range(Interval::ENTIRE).1.magnitude(),
        }
    }
}
