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
            Self::Sign => a.sign(),
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Asin => a.asin(),
            Self::Acos => a.acos(),
            Self::Atan => a.atan(),
            Self::Atan2 => a.atan2(b),
            Self::Exp => a.exp(),
            Self::Log => a.ln(),
            Self::Tanh => a.tanh(),
            Self::Sigmoid => a.sigmoid(),
            Self::Wrap => a.wrap(),
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
        base.powi(exponent as i32)
    } else {
        base.powf(exponent)
    }
}
