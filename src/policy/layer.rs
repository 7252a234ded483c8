//! What a network is made of: dense layers, the norms behind their sums, and the maps at its ends.

use super::Activation;
use crate::real::Real;
use crate::real::bound::Interval;

/// One layer, `y = activation(norm(W x + b))`.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// `W`, `[outputs, inputs]` row by row.
    pub weight: Vec<f32>,
    /// `b`, `[outputs]`.
    pub bias: Vec<f32>,
    /// Columns of `W`.
    pub inputs: usize,
    /// Rows of `W`.
    pub outputs: usize,
    /// Between the sums and the activation.
    pub norm: Option<Norm>,
    /// Of each output.
    pub activation: Activation,
}

/// LayerNorm over the outputs of a layer: less their mean, over the root of their variance and `epsilon`, times
/// `scale`, plus `shift`.
///
/// Both sums take the outputs in order, each over as many as there are. A variance that leaves the range of f32
/// makes every output NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct Norm {
    /// `[outputs]`.
    pub scale: Vec<f32>,
    /// `[outputs]`.
    pub shift: Vec<f32>,
    /// Positive.
    pub epsilon: f32,
}

/// An affine map of each number at an end of a network, and a clip behind it: `scale (x - center) + shift` within
/// `low` and `high`, which are infinite where there is no limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Rescale {
    /// What is taken away first, 0 in most maps: of numbers far from 0, a difference keeps digits that a sum of
    /// products loses.
    pub center: Vec<f32>,
    /// Factors.
    pub scale: Vec<f32>,
    /// Summands.
    pub shift: Vec<f32>,
    /// Lower limits.
    pub low: Vec<f32>,
    /// Upper limits.
    pub high: Vec<f32>,
}

impl Layer {
    /// The layer of `weight`, `[outputs, inputs]`, and `bias`, `[outputs]`; neither norm nor activation.
    pub fn dense(weight: Vec<f32>, bias: Vec<f32>) -> Self {
        let (inputs, outputs) = (weight.len() / bias.len().max(1), bias.len());
        Self { weight, bias, inputs, outputs, norm: None, activation: Activation::Identity }
    }

    /// The same with an activation.
    #[must_use]
    pub fn activated(self, activation: Activation) -> Self {
        Self { activation, ..self }
    }

    /// Its outputs at `x`, one neuron after the other.
    pub(super) fn forward<R: Real>(&self, x: &[R]) -> Vec<R> {
        let sums = R::dense(&self.weight, &self.bias, x);
        let normed = match &self.norm {
            Some(norm) => norm.apply(&sums),
            None => sums,
        };
        normed.into_iter().map(|sum| self.activation.apply(sum)).collect()
    }

    /// Refuses shapes that do not fit, parameters without sense, and numbers that are not finite; `i` is its number.
    pub(super) fn validate(&self, i: usize) -> Result<(), String> {
        let shape = self.outputs.checked_mul(self.inputs);
        if self.inputs == 0 || shape != Some(self.weight.len()) || self.outputs == 0 {
            return Err(format!("layers.{i}.weight has not the shape [out, in]"));
        }
        let (bias, rows) = (self.bias.len(), self.outputs);
        if bias != rows {
            return Err(format!(
                "layers.{i}.bias has {bias} entries, layers.{i}.weight has {rows} rows"
            ));
        }
        for (kind, values) in [("weight", &self.weight), ("bias", &self.bias)] {
            all_finite(&format!("layers.{i}.{kind}"), values)?;
        }
        if let Some(norm) = &self.norm {
            norm.validate(i, self.outputs)?;
        }
        self.activation.check().map_err(|problem| format!("layer {i}: activation {problem}"))
    }
}

impl Norm {
    /// The norm of `sums`.
    pub(crate) fn apply<R: Real>(&self, sums: &[R]) -> Vec<R> {
        let count = R::lit(sums.len() as f32);
        let zero = R::lit(0.0);
        let mean = sums.iter().fold(zero, |total, &sum| total + sum) / count;
        let apart: Vec<R> = sums.iter().map(|&sum| sum - mean).collect();
        let variance = apart.iter().fold(zero, |total, &gap| total + gap * gap) / count;
        let known = variance.known_by(|variance| normaliser_range(variance, self.epsilon));
        let factor = known.unwrap_or_else(|| normaliser(variance, R::lit(self.epsilon)));
        let each = apart.iter().zip(self.scale.iter().zip(&self.shift));
        each.map(|(&gap, (&scale, &shift))| gap * factor * R::lit(scale) + R::lit(shift)).collect()
    }

    /// An upper bound of its slope in the Euclidean norm: the factor is never above `1 / sqrt(epsilon)`, and its own
    /// slope only takes away.
    pub(super) fn slope(&self) -> f64 {
        let largest =
            self.scale.iter().fold(0.0, |most: f64, scale| most.max(f64::from(*scale).abs()));
        (Interval::point(largest) * Interval::point(f64::from(self.epsilon)).sqrt().reciprocal())
            .high
    }

    fn validate(&self, i: usize, outputs: usize) -> Result<(), String> {
        for (kind, values) in [("weight", &self.scale), ("bias", &self.shift)] {
            let (name, count) = (format!("layers.{i}.norm.{kind}"), values.len());
            if count != outputs {
                return Err(format!(
                    "{name} has {count} entries, layers.{i}.weight has {outputs} rows"
                ));
            }
            all_finite(&name, values)?;
        }
        match self.epsilon.is_finite() && self.epsilon >= f32::MIN_POSITIVE {
            true => Ok(()),
            false => Err(format!("layers.{i}.norm.epsilon is {}, not above 0", self.epsilon)),
        }
    }
}

/// `1 / sqrt(variance + epsilon)`; NaN of an infinite variance, which is one that f32 does not have.
#[inline(always)]
pub(crate) fn normaliser<R: Real>(variance: R, epsilon: R) -> R {
    let root = (variance + epsilon).sqrt();
    variance.if_lt(R::lit(f32::INFINITY), R::lit(1.0) / root, R::lit(f32::NAN))
}

/// Its values and slopes over `variance`, none of which is below 0.
pub(crate) fn normaliser_range(variance: Interval, epsilon: f32) -> (Interval, Interval) {
    let variance = Interval::new(variance.low.max(0.0), variance.high.max(0.0));
    let factor = (variance + Interval::point(f64::from(epsilon))).sqrt().reciprocal();
    (factor, -(Interval::point(0.5) * factor * factor.square()))
}

impl Rescale {
    /// `scale x + shift` without limits.
    pub fn affine(scale: Vec<f32>, shift: Vec<f32>) -> Self {
        let count = scale.len();
        Self {
            center: vec![0.0; count],
            scale,
            shift,
            low: vec![f32::NEG_INFINITY; count],
            high: vec![f32::INFINITY; count],
        }
    }

    /// The map of `x`.
    pub(crate) fn apply<R: Real>(&self, x: &[R]) -> Vec<R> {
        x.iter().enumerate().map(|(i, &x)| self.at(i, x)).collect()
    }

    /// Of number `i`; what does nothing is left out.
    fn at<R: Real>(&self, i: usize, x: R) -> R {
        let (scale, shift) = (self.scale[i], self.shift[i]);
        let center = self.center[i];
        let apart = if center == 0.0 { x } else { x - R::lit(center) };
        let scaled = if scale == 1.0 { apart } else { R::lit(scale) * apart };
        let moved = if shift == 0.0 { scaled } else { scaled + R::lit(shift) };
        let (low, high) = (R::lit(self.low[i]), R::lit(self.high[i]));
        match (self.low[i].is_finite(), self.high[i].is_finite()) {
            (true, true) => moved.clamp(low, high),
            (true, false) => moved.if_lt(low, low, moved),
            (false, true) => high.if_lt(moved, high, moved),
            (false, false) => moved,
        }
    }

    /// Whether it clips nothing.
    pub(super) fn is_affine(&self) -> bool {
        self.low.iter().chain(&self.high).all(|limit| limit.is_infinite())
    }

    /// An upper bound of its slope in the Euclidean norm.
    pub(super) fn slope(&self) -> f64 {
        self.scale.iter().fold(0.0, |most, scale| most.max(f64::from(*scale).abs()))
    }

    /// Whether it takes something away first.
    pub(super) fn is_centered(&self) -> bool {
        self.center.iter().any(|center| *center != 0.0)
    }

    /// Its tensors by name; the center where there is one.
    pub(super) fn tensors(&self) -> impl Iterator<Item = (&'static str, &Vec<f32>)> {
        let center = self.is_centered().then_some(("center", &self.center));
        let others = [
            ("scale", &self.scale),
            ("shift", &self.shift),
            ("low", &self.low),
            ("high", &self.high),
        ];
        others.into_iter().chain(center)
    }

    /// Refuses a map at `end`, of another size than `count`, with numbers that are not finite, or without room
    /// between limits.
    pub(super) fn validate(&self, end: &str, count: usize) -> Result<(), String> {
        for (kind, values) in self.tensors().chain([("center", &self.center)]) {
            if values.len() != count {
                return Err(format!(
                    "{end}.{kind} has {} entries, the network has {count} {end}s",
                    values.len()
                ));
            }
        }
        all_finite(&format!("{end}.center"), &self.center)?;
        all_finite(&format!("{end}.scale"), &self.scale)?;
        all_finite(&format!("{end}.shift"), &self.shift)?;
        let wrong =
            |(low, high): (&f32, &f32)| low.partial_cmp(high) != Some(std::cmp::Ordering::Less);
        match self.low.iter().zip(&self.high).position(wrong) {
            None => Ok(()),
            Some(at) => {
                let (low, high) = (self.low[at], self.high[at]);
                Err(format!("{end}.low[{at}] is {low}, not below {end}.high[{at}], {high}"))
            }
        }
    }
}

/// Refuses a number of the tensor `name` that is not finite.
fn all_finite(name: &str, values: &[f32]) -> Result<(), String> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(at) => Err(format!("{name}[{at}] is {}, not finite", values[at])),
    }
}
