//! What a graph does to each number on its own: maps and activations one after the other, or an expression that
//! is an activation written out.

use std::array::from_fn;

use super::draft::Step;
use super::map::Map;
use crate::policy::Activation;

/// Numbers that an expression is looked at for.
const SEEN: usize = 192;
/// Beyond it an exponential of a number may be more than f32 has.
const OVERFLOW: f64 = 88.0;
/// Largest difference of an activation written out, as a part of its value or of 1.
const DIFFERENCE: f64 = 1e-6;
/// Activations that are written out: those of a single form.
const WRITTEN_OUT: [Activation; 8] = [
    Activation::Silu,
    Activation::Mish,
    Activation::Gelu,
    Activation::GeluTanh,
    Activation::Sigmoid,
    Activation::Softplus { beta: 1.0 },
    Activation::Softsign,
    Activation::Relu,
];

/// One operation on each number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Each {
    /// `scale x + shift`.
    Affine { scale: f64, shift: f64 },
    /// `clamp(x, low, high)`.
    Clamp { low: f64, high: f64 },
    /// An activation.
    Activation(Activation),
}

impl Each {
    /// It on `width` numbers.
    pub(super) fn step(self, width: usize) -> Step {
        match self {
            Self::Affine { scale, shift } => {
                Step::Map(Map::affine(vec![scale; width], vec![shift; width]))
            }
            Self::Clamp { low, high } => Step::Map(Map::clamp(vec![low; width], vec![high; width])),
            Self::Activation(activation) => Step::Activation(activation),
        }
    }

    /// Whether it cuts off at another number than 0.
    fn is_clip(self) -> bool {
        let cuts = |limit: f64| limit.is_finite() && limit != 0.0;
        match self {
            Self::Clamp { low, high } => cuts(low) || cuts(high),
            Self::Activation(activation) => {
                matches!(activation, Activation::Hardtanh { .. } | Activation::Relu6)
            }
            Self::Affine { .. } => false,
        }
    }

    /// The value at `x`.
    fn apply(self, x: f64) -> f64 {
        match self {
            Self::Affine { scale, shift } => scale * x + shift,
            Self::Clamp { low, high } => x.max(low).min(high),
            Self::Activation(activation) => activation.apply(x),
        }
    }
}

/// A function of one number, as operations and by its values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Expression {
    /// Its operations, if they come one after the other.
    steps: Option<Vec<Each>>,
    /// Its values at the numbers of [`seen`].
    values: Box<[f64; SEEN]>,
    /// Whether it is cut off somewhere, which its values need not show.
    is_clipped: bool,
}

impl Expression {
    /// The number itself.
    pub(super) fn plain() -> Self {
        Self { steps: Some(Vec::new()), values: Box::new(seen()), is_clipped: false }
    }

    /// Its operations one after the other; `None` for an expression that is no activation.
    pub(super) fn steps(&self) -> Option<&[Each]> {
        self.steps.as_deref()
    }

    /// The same with one more operation.
    pub(super) fn then(mut self, each: Each) -> Self {
        *self.values = self.values.map(|x| each.apply(x));
        self.is_clipped |= each.is_clip();
        match &mut self.steps {
            Some(steps) => {
                steps.push(each);
                softplus(steps);
            }
            None => return self.known(),
        }
        self
    }

    /// A function that is no activation of its value.
    pub(super) fn through(self, f: impl Fn(f64) -> f64) -> Self {
        Self { steps: None, values: Box::new(self.values.map(f)), ..self }.known()
    }

    /// `f` of it and another of the same number.
    pub(super) fn with(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let values = Box::new(from_fn(|i| f(self.values[i], other.values[i])));
        let is_clipped = self.is_clipped || other.is_clipped;
        Self { steps: None, values, is_clipped }.known()
    }

    /// It where `beta` times it is at most `limit`, and `beyond` elsewhere: a softplus with the threshold beyond
    /// which it is its input, if the difference is none that counts.
    pub(super) fn up_to(&self, scaled: &Self, limit: f64, beyond: &Self) -> Option<Self> {
        let (own, before) = (self.steps()?, beyond.steps()?);
        let (Each::Activation(Activation::Softplus { beta }), inner) = own.split_last()? else {
            return None;
        };
        let beta = f64::from(*beta);
        let stretched = match scaled.steps()?.strip_prefix(before)? {
            [] => 1.0,
            [Each::Affine { scale, shift: 0.0 }] => *scale,
            _ => return None,
        };
        // What softplus has more than its input, at the threshold.
        let excess = (-limit).exp().ln_1p() / beta;
        let is_nothing = excess <= DIFFERENCE * (limit / beta).max(1.0);
        (inner == before && stretched as f32 == beta as f32 && is_nothing).then(|| self.clone())
    }

    /// The same as the activation that its values are those of, if there is one.
    fn known(mut self) -> Self {
        if self.is_clipped {
            return self;
        }
        let inputs = seen();
        let is = |activation: &Activation| {
            inputs.iter().zip(self.values.iter()).all(|(&x, value)| {
                let expected: f64 = activation.apply(x);
                let near = (value - expected).abs() <= DIFFERENCE * expected.abs().max(1.0);
                // An exponential written out leaves the range of floats there.
                near || (x.abs() > OVERFLOW && !value.is_finite())
            })
        };
        // A softplus is ln(2) / beta at 0.
        let beta = (std::f64::consts::LN_2 / self.values[0]) as f32;
        let softplus = Activation::Softplus { beta };
        let softplus = softplus.check().is_ok().then_some(softplus);
        if let Some(activation) = WRITTEN_OUT.into_iter().chain(softplus).find(is) {
            self.steps = Some(vec![Each::Activation(activation)]);
        }
        self
    }
}

/// Makes one activation of a softplus that is stretched on its way in and shrunk on its way out.
fn softplus(steps: &mut Vec<Each>) {
    let &[
        ..,
        Each::Affine { scale: beta, shift: 0.0 },
        Each::Activation(Activation::Softplus { beta: 1.0 }),
        Each::Affine { scale, shift: 0.0 },
    ] = steps.as_slice()
    else {
        return;
    };
    if beta > 0.0 && (beta * scale - 1.0).abs() < 1e-6 {
        steps.truncate(steps.len() - 3);
        steps.push(Each::Activation(Activation::Softplus { beta: beta as f32 }));
    }
}

/// Numbers of both signs, near 0 and far from it.
fn seen() -> [f64; SEEN] {
    from_fn(|i| {
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let at = (i / 2) as f64;
        // Even steps up to 8, where activations bend, and from 10 to a million.
        sign * if at < 80.0 { at / 10.0 } else { 10.0_f64.powf(1.0 + (at - 80.0) / 3.0) }
    })
}

/// The error function in f64, to 1e-9 (Abramowitz and Stegun have 7.1.5 and 7.1.14).
pub(super) fn erf(x: f64) -> f64 {
    if x.abs() > 6.0 {
        return x.signum();
    }
    if x.abs() < 3.0 {
        // The series x - x^3 / 3 + x^5 / (2! 5) - ...
        let (mut term, mut sum) = (x, x);
        for n in 1..80_i32 {
            term *= -x * x / f64::from(n);
            sum += term / f64::from(2 * n + 1);
        }
        return sum * std::f64::consts::FRAC_2_SQRT_PI;
    }
    // The continued fraction of the complement.
    let a = x.abs();
    let fraction = (1..60).rev().fold(a, |below, n| a + f64::from(n) / 2.0 / below);
    x.signum() * (1.0 - (-a * a).exp() * std::f64::consts::FRAC_2_SQRT_PI / 2.0 / fraction)
}
