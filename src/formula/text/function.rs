//! The functions of formulas by name: how many arguments each takes, and what it is over `Real`.

use crate::real::Real;

/// A function that a formula may call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Absolute value.
    Abs,
    /// The smaller of two.
    Min,
    /// The larger of two.
    Max,
    /// A number kept between a lower and an upper one.
    Clamp,
    /// Square root.
    Sqrt,
    /// Length of a vector in the plane.
    Hypot,
    /// Largest integer not above.
    Floor,
    /// -1, 0 or 1.
    Sign,
    /// Sine of radians.
    Sin,
    /// Cosine of radians.
    Cos,
    /// Tangent of radians.
    Tan,
    /// Inverse sine.
    Asin,
    /// Inverse cosine.
    Acos,
    /// Inverse tangent.
    Atan,
    /// Angle of the vector (second, first).
    Atan2,
    /// Exponential.
    Exp,
    /// Natural logarithm.
    Log,
    /// Hyperbolic tangent.
    Tanh,
    /// Logistic function.
    Sigmoid,
    /// An angle less its nearest multiple of 2 pi.
    Wrap,
}

/// Name and number of arguments of each function.
const TABLE: [(&str, Function, usize); 20] = [
    ("abs", Function::Abs, 1),
    ("min", Function::Min, 2),
    ("max", Function::Max, 2),
    ("clamp", Function::Clamp, 3),
    ("sqrt", Function::Sqrt, 1),
    ("hypot", Function::Hypot, 2),
    ("floor", Function::Floor, 1),
    ("sign", Function::Sign, 1),
    ("sin", Function::Sin, 1),
    ("cos", Function::Cos, 1),
    ("tan", Function::Tan, 1),
    ("asin", Function::Asin, 1),
    ("acos", Function::Acos, 1),
    ("atan", Function::Atan, 1),
    ("atan2", Function::Atan2, 2),
    ("exp", Function::Exp, 1),
    ("log", Function::Log, 1),
    ("tanh", Function::Tanh, 1),
    ("sigmoid", Function::Sigmoid, 1),
    ("wrap", Function::Wrap, 1),
];

/// What is called like a function and is part of the grammar.
const SPECIAL: [&str; 2] = ["if", "net"];

impl Function {
    /// The function of that name.
    pub fn named(name: &str) -> Option<Self> {
        TABLE.iter().find(|entry| entry.0 == name).map(|entry| entry.1)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        TABLE.iter().find(|entry| entry.1 == self).map_or("", |entry| entry.0)
    }

    /// The number of its arguments, at most 3.
    pub fn arguments(self) -> usize {
        TABLE.iter().find(|entry| entry.1 == self).map_or(0, |entry| entry.2)
    }

    /// The names of all functions, `if` and `net` among them.
    pub fn names() -> impl Iterator<Item = &'static str> {
        TABLE.iter().map(|entry| entry.0).chain(SPECIAL)
    }

    /// Its value at its first arguments, as many as it takes.
    pub(super) fn value<R: Real>(self, [a, b, c]: [R; 3]) -> R {
        match self {
            Self::Abs => a.abs(),
            Self::Min => a.min(b),
            Self::Max => a.max(b),
            Self::Clamp => a.clamp(b, c),
            Self::Sqrt => a.sqrt(),
            Self::Hypot => a.hypot(b),
            Self::Floor => a.floor(),
            Self::Sign => stand_in::sign(a),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => stand_in::tan(a),
            Self::Asin => stand_in::asin(a),
            Self::Acos => stand_in::acos(a),
            Self::Atan => stand_in::atan(a),
            Self::Atan2 => stand_in::atan2(a, b),
            Self::Exp => stand_in::exp(a),
            Self::Log => stand_in::ln(a),
            Self::Tanh => a.tanh(),
            Self::Sigmoid => stand_in::sigmoid(a),
            Self::Wrap => stand_in::wrap(a),
        }
    }

    /// Whether its value at the number `a` is no number, although it takes just one.
    pub(super) fn is_undefined_at(self, a: f32) -> bool {
        match self {
            Self::Log => a <= 0.0,
            Self::Sqrt => a < 0.0,
            Self::Asin | Self::Acos => a.abs() > 1.0,
            _ => false,
        }
    }
}

/// `base` to the power of the number `exponent`.
pub(super) fn power<R: Real>(base: R, exponent: f32) -> R {
    // Beyond 2^24 an f32 no longer tells odd from even.
    if exponent.fract() == 0.0 && exponent.abs() <= 16_777_216.0 {
        stand_in::powi(base, exponent as i32)
    } else {
        stand_in::powf(base, exponent)
    }
}

/// Plain compositions of functions that the scalar trait does not have.
mod stand_in {
    use std::f32::consts::{FRAC_PI_2, PI, TAU};

    use crate::real::Real;

    pub(super) fn sign<R: Real>(x: R) -> R {
        let zero = R::lit(0.0);
        x.if_lt(zero, R::lit(-1.0), zero.if_lt(x, R::lit(1.0), x))
    }

    pub(super) fn tan<R: Real>(x: R) -> R {
        x.sin() / x.cos()
    }

    pub(super) fn exp<R: Real>(x: R) -> R {
        let small = (-x.abs()).exp_negative();
        x.if_lt(R::lit(0.0), small, R::lit(1.0) / small)
    }

    pub(super) fn ln<R: Real>(x: R) -> R {
        let (zero, one) = (R::lit(0.0), R::lit(1.0));
        let above = -(one / x).ln_unit();
        let positive = x.if_lt(one, x.ln_unit(), above);
        zero.if_lt(x, positive, zero / zero)
    }

    pub(super) fn sigmoid<R: Real>(x: R) -> R {
        let half = R::lit(0.5);
        half + half * (half * x).tanh()
    }

    pub(super) fn wrap<R: Real>(x: R) -> R {
        let turns = (x * R::lit(0.5 / PI) + R::lit(0.5)).floor();
        x - turns * R::lit(TAU)
    }

    /// On `[0, 1]` a polynomial of Abramowitz and Stegun (4.4.49), absolute error below 2e-8.
    fn atan_unit<R: Real>(x: R) -> R {
        let square = x * x;
        let coefficients = [
            0.002_866_226,
            -0.016_165_737,
            0.042_909_614,
            -0.075_289_64,
            0.106_562_64,
            -0.142_088_99,
            0.199_935_51,
            -0.333_331_45,
            1.0,
        ];
        let sum = |sum: R, c: f32| sum * square + R::lit(c);
        coefficients.into_iter().fold(R::lit(0.0), sum) * x
    }

    pub(super) fn atan<R: Real>(x: R) -> R {
        let (zero, one) = (R::lit(0.0), R::lit(1.0));
        let size = x.abs();
        let large = R::lit(FRAC_PI_2) - atan_unit(one / size);
        let angle = one.if_lt(size, large, atan_unit(size));
        x.if_lt(zero, -angle, angle)
    }

    pub(super) fn atan2<R: Real>(y: R, x: R) -> R {
        let zero = R::lit(0.0);
        let half = R::lit(2.0) * atan(y / (x.hypot(y) + x.abs()));
        let turned = y.if_lt(zero, R::lit(-PI) - half, R::lit(PI) - half);
        x.if_lt(zero, turned, half)
    }

    pub(super) fn asin<R: Real>(x: R) -> R {
        atan2(x, (R::lit(1.0) - x * x).sqrt())
    }

    pub(super) fn acos<R: Real>(x: R) -> R {
        R::lit(FRAC_PI_2) - asin(x)
    }

    pub(super) fn powi<R: Real>(x: R, exponent: i32) -> R {
        let mut result: Option<R> = None;
        let mut square = x;
        let mut left = exponent.unsigned_abs();
        while left > 0 {
            if left % 2 == 1 {
                result = Some(result.map_or(square, |result| result * square));
            }
            left /= 2;
            if left > 0 {
                square = square * square;
            }
        }
        match result {
            None => R::lit(1.0),
            Some(result) if exponent < 0 => R::lit(1.0) / result,
            Some(result) => result,
        }
    }

    pub(super) fn powf<R: Real>(x: R, exponent: f32) -> R {
        exp(R::lit(exponent) * ln(x))
    }
}
