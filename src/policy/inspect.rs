//! What a network is in numbers: sizes, weights, a Lipschitz bound, and the range of its outputs.

use serde::Serialize;

use super::spectral::norm_bound;
use super::{Activation, Layer, Mlp, OutputActivation};
use crate::error::{Error, Result};
use crate::real::Lanes;
use crate::real::bound::{Interval, tanh};

/// Largest slope of `x / (1 + exp(-x))`, 1.099839..., rounded up.
const SILU_SLOPE: f64 = 1.09984;
/// Around the place of its least value, -1.278464...
const SILU_VALLEY: Interval = Interval::new(-1.2785, -1.2784);
/// That value, -0.27846454..., rounded down.
const SILU_LEAST: f64 = -0.2784646;

/// A network in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Input width, then the output width of each layer.
    pub widths: Vec<usize>,
    /// Activation of the hidden layers.
    pub activation: &'static str,
    /// Activation of the last layer.
    pub output: &'static str,
    /// Names of the inputs, where the file has them.
    pub state_order: Option<Vec<String>>,
    /// Number of weights and biases.
    pub parameter_count: usize,
    /// SHA-256 over widths, activations and parameters.
    pub digest: String,
    /// The layers, input side first.
    pub layers: Vec<LayerInspection>,
    /// Upper bound of the Lipschitz constant in the Euclidean norm, over all inputs: the product
    /// of the layers' spectral norms and the slopes of the activations.
    #[serde(with = "crate::files::number")]
    pub lipschitz_bound: f64,
}

/// A layer in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerInspection {
    /// Columns of the weight.
    pub inputs: usize,
    /// Rows of the weight.
    pub outputs: usize,
    /// Least and largest weight.
    #[serde(with = "crate::files::number")]
    pub weight_range: [f32; 2],
    /// Least and largest bias.
    #[serde(with = "crate::files::number")]
    pub bias_range: [f32; 2],
    /// Upper bound of the spectral norm of the weight, at most 1.0001 times the norm.
    #[serde(with = "crate::files::number")]
    pub spectral_norm: f64,
}

impl Inspection {
    /// The numbers of `network`.
    pub fn of(network: &Mlp) -> Self {
        let layers: Vec<LayerInspection> = network.layers().iter().map(layer).collect();
        // All activations but SiLU, that of the last layer too, have slopes of at most 1.
        let slope = match network.activation() {
            Activation::Silu => SILU_SLOPE,
            Activation::Relu | Activation::Tanh => 1.0,
        };
        let hidden = std::iter::repeat_n(slope, layers.len() - 1);
        let factors = layers.iter().map(|layer| layer.spectral_norm).chain(hidden);
        Self {
            widths: network.widths(),
            activation: network.activation().name(),
            output: network.output().name(),
            state_order: network.state_order().map(<[String]>::to_vec),
            parameter_count: network.parameter_count(),
            digest: network.digest(),
            lipschitz_bound: factors.fold(1.0, |product, factor| (product * factor).next_up()),
            layers,
        }
    }
}

/// The numbers of a layer.
fn layer(layer: &Layer) -> LayerInspection {
    let Layer { weight, bias, inputs, outputs } = layer;
    let (inputs, outputs) = (*inputs, *outputs);
    LayerInspection {
        inputs,
        outputs,
        weight_range: range(weight),
        bias_range: range(bias),
        spectral_norm: norm_bound(weight, [outputs, inputs]),
    }
}

/// Least and largest of the values.
fn range(values: &[f32]) -> [f32; 2] {
    let least = values.iter().copied().fold(f32::INFINITY, f32::min);
    [least, values.iter().copied().fold(f32::NEG_INFINITY, f32::max)]
}

/// An interval for each output that holds its values for every input in `inputs`, by interval
/// arithmetic: of the network in real numbers, and wide where the box or the network is.
///
/// # Errors
/// [`Error::Invalid`] if there are not as many intervals as inputs.
pub fn output_intervals(network: &Mlp, inputs: &[Interval]) -> Result<Vec<Interval>> {
    let (has, width) = (inputs.len(), network.widths()[0]);
    if has != width {
        let problem = format!("{has} intervals for the {width} inputs of the network");
        return Err(Error::invalid("inputs", problem));
    }
    let last = network.layers().len() - 1;
    let layers = network.layers().iter().enumerate();
    Ok(layers.fold(inputs.to_vec(), |x, (i, layer)| {
        let rows = layer.weight.chunks_exact(layer.inputs).zip(&layer.bias);
        let sum = |(row, &bias): (&[f32], &f32)| {
            let products = row.iter().zip(&x).map(|(&w, &x)| Interval::point(w.into()) * x);
            products.fold(Interval::point(bias.into()), |sum, product| sum + product)
        };
        let sums = rows.map(sum);
        match (i == last, network.output()) {
            (false, _) => sums.map(|sum| activated(network.activation(), sum)).collect(),
            (true, OutputActivation::Tanh) => sums.map(tanh).collect(),
            (true, OutputActivation::Identity) => sums.collect(),
        }
    }))
}

/// The range of an activation.
fn activated(activation: Activation, x: Interval) -> Interval {
    match activation {
        Activation::Relu => Interval::new(x.low.max(0.0), x.high.max(0.0)),
        Activation::Tanh => tanh(x),
        Activation::Silu => {
            let ends = silu(x.low).hull(silu(x.high));
            let valley = x.low <= SILU_VALLEY.high && x.high >= SILU_VALLEY.low;
            // It falls up to the valley and rises from there on.
            Interval::new(if valley { SILU_LEAST } else { ends.low }, ends.high)
        }
    }
}

/// SiLU at `x`, as `x (1 + tanh(x / 2)) / 2`; an infinite `x` is the limit.
fn silu(x: f64) -> Interval {
    match x {
        f64::NEG_INFINITY => Interval::ZERO,
        f64::INFINITY => Interval::new(0.0, x),
        _ => {
            let half = Interval::point(0.5) * Interval::point(x);
            half + half * tanh(half)
        }
    }
}

/// Least and largest value of each output over batches of inputs.
pub fn output_ranges<const N: usize>(
    network: &Mlp,
    batches: impl Iterator<Item = Vec<Lanes<N>>>,
) -> Vec<[f32; 2]> {
    let outputs = network.layers().last().map_or(0, |layer| layer.outputs);
    let none = vec![[f32::INFINITY, f32::NEG_INFINITY]; outputs];
    batches.fold(none, |mut ranges, batch| {
        for ([low, high], Lanes(values)) in ranges.iter_mut().zip(network.forward(&batch)) {
            let [least, largest] = range(&values);
            (*low, *high) = (low.min(least), high.max(largest));
        }
        ranges
    })
}
