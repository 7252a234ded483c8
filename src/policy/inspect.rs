//! What a network is in numbers: sizes, weights, a Lipschitz bound, and the range of its outputs.

use serde::Serialize;

use super::spectral::norm_bound;
use super::{Layer, Mlp, Norm, Rescale, normaliser_range};
use crate::error::{Error, Result};
use crate::real::Lanes;
use crate::real::bound::Interval;

/// A network in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Input width, then the output width of each layer.
    pub widths: Vec<usize>,
    /// Activation of the hidden layers; where they differ, of each.
    pub activation: String,
    /// Activation of the last layer.
    pub output: String,
    /// Whether the inputs go through a map before the first layer, and the outputs through one behind the last.
    pub maps: [bool; 2],
    /// Names of the inputs, where the file has them.
    pub state_order: Option<Vec<String>>,
    /// Number of weights and biases, those of norms among them.
    pub parameter_count: usize,
    /// SHA-256 over widths, activations and parameters.
    pub digest: String,
    /// The layers, input side first.
    pub layers: Vec<LayerInspection>,
    /// Upper bound of the Lipschitz constant in the Euclidean norm, over all inputs: the product
    /// of the layers' spectral norms and the slopes of norms, activations and maps.
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
    /// Whether a LayerNorm follows its sums.
    pub norm: bool,
    /// Activation behind that.
    pub activation: String,
    /// Upper bound of the spectral norm of the weight, at most 1.0001 times the norm unless it is rough.
    #[serde(with = "crate::files::number")]
    pub spectral_norm: f64,
    /// Whether that bound is one by sums of squares and of magnitudes, as the layer is too wide for a better one.
    pub spectral_norm_is_rough: bool,
}

impl Inspection {
    /// The numbers of `network`.
    pub fn of(network: &Mlp) -> Self {
        let layers: Vec<LayerInspection> = network.layers().iter().map(layer).collect();
        let factors = layers.iter().map(|layer| layer.spectral_norm).chain(slopes(network));
        Self {
            widths: network.widths(),
            activation: network.hidden_words(),
            output: network.output().name(),
            maps: [network.input_map().is_some(), network.output_map().is_some()],
            state_order: network.state_order().map(<[String]>::to_vec),
            parameter_count: network.parameter_count(),
            digest: network.digest(),
            lipschitz_bound: factors.fold(1.0, |product, factor| (product * factor).next_up()),
            layers,
        }
    }
}

/// The largest slopes of all that is not a weight: those of hidden activations, and others but for 1.
fn slopes(network: &Mlp) -> impl Iterator<Item = f64> {
    let last = network.layers().len() - 1;
    let activations = network.layers().iter().enumerate();
    let activations = activations.map(move |(i, layer)| (i < last, layer.activation.slope()));
    let norms = network.layers().iter().filter_map(|layer| layer.norm.as_ref()).map(Norm::slope);
    let maps =
        [network.input_map(), network.output_map()].into_iter().flatten().map(Rescale::slope);
    let others = norms.chain(maps).map(|slope| (true, slope));
    activations
        .chain(others)
        .filter(|(counts, slope)| *counts || *slope != 1.0)
        .map(|(_, slope)| slope)
}

/// The numbers of a layer.
fn layer(layer: &Layer) -> LayerInspection {
    let Layer { weight, bias, inputs, outputs, norm, activation } = layer;
    let (inputs, outputs) = (*inputs, *outputs);
    let spectral = norm_bound(weight, [outputs, inputs]);
    LayerInspection {
        inputs,
        outputs,
        weight_range: range(weight),
        bias_range: range(bias),
        norm: norm.is_some(),
        activation: activation.name(),
        spectral_norm: spectral.bound,
        spectral_norm_is_rough: spectral.is_rough,
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
    let seen = network.input_map().map_or_else(|| inputs.to_vec(), |map| mapped(map, inputs));
    let said = network.layers().iter().fold(seen, |x, layer| layer_intervals(layer, &x));
    Ok(network.output_map().map_or_else(|| said.clone(), |map| mapped(map, &said)))
}

/// The range of each output of a layer.
fn layer_intervals(layer: &Layer, x: &[Interval]) -> Vec<Interval> {
    let rows = layer.weight.chunks_exact(layer.inputs).zip(&layer.bias);
    let sum = |(row, &bias): (&[f32], &f32)| {
        let products = row.iter().zip(x).map(|(&w, &x)| Interval::point(w.into()) * x);
        products.fold(Interval::point(bias.into()), |sum, product| sum + product)
    };
    let sums: Vec<Interval> = rows.map(sum).collect();
    let normed = layer.norm.as_ref().map_or_else(|| sums.clone(), |norm| normed(norm, &sums));
    normed.into_iter().map(|x| layer.activation.range(x).0).collect()
}

/// The range of each output of a norm.
fn normed(norm: &Norm, sums: &[Interval]) -> Vec<Interval> {
    let share = Interval::point(sums.len() as f64).reciprocal();
    let total =
        |all: &mut dyn Iterator<Item = Interval>| all.fold(Interval::ZERO, |sum, x| sum + x);
    let mean = total(&mut sums.iter().copied()) * share;
    let apart: Vec<Interval> = sums.iter().map(|&sum| sum - mean).collect();
    let variance = total(&mut apart.iter().map(|gap| gap.square())) * share;
    let (factor, _) = normaliser_range(variance, norm.epsilon);
    // No number is farther from the mean than the root of one less than their count, in deviations.
    let most = Interval::point(sums.len() as f64 - 1.0).sqrt().high;
    let each = apart.iter().zip(norm.scale.iter().zip(&norm.shift));
    each.map(|(&gap, (&scale, &shift))| {
        let product = gap * factor;
        let held = Interval::new(product.low.clamp(-most, most), product.high.clamp(-most, most));
        held * Interval::point(scale.into()) + Interval::point(shift.into())
    })
    .collect()
}

/// The range of each number behind a map.
fn mapped(map: &Rescale, x: &[Interval]) -> Vec<Interval> {
    let each = x.iter().enumerate().map(|(i, &x)| {
        let [center, scale, shift] =
            [&map.center, &map.scale, &map.shift].map(|values| Interval::point(values[i].into()));
        let moved = scale * (x - center) + shift;
        let (low, high) = (f64::from(map.low[i]), f64::from(map.high[i]));
        Interval::new(moved.low.clamp(low, high), moved.high.clamp(low, high))
    });
    each.collect()
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
