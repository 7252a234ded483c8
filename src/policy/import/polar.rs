//! The text of Sherlock and of POLAR: widths, activations where they are named, and the weights of each neuron.

use super::draft::{Draft, MOST_LAYERS, Step};
use super::linear::Linear;
use super::map::Map;
use super::request::{Imported, Origin};
use super::text::Words;
use crate::policy::Activation;

/// What follows each layer, and who says so.
struct Between {
    activations: Vec<Activation>,
    layout: &'static str,
    notes: Vec<String>,
}

/// The network of such a text.
///
/// # Errors
/// A sentence about damage.
pub(super) fn read(bytes: &[u8]) -> Result<Imported, String> {
    let mut words = Words::of(bytes)?;
    let (inputs, outputs) =
        (words.count("the number of inputs")?, words.count("the number of outputs")?);
    let hidden = words.count("the number of hidden layers")?;
    if hidden >= MOST_LAYERS {
        return Err(format!("{} layers; a network has at most {MOST_LAYERS}", hidden + 1));
    }
    let mut widths = vec![inputs];
    for _ in 0..hidden {
        widths.push(words.count("a width")?);
    }
    widths.push(outputs);
    let between = between(&mut words, hidden + 1)?;
    let mut draft = Draft::of(Some(inputs));
    for (width, activation) in widths.windows(2).zip(&between.activations) {
        draft.push(Step::Linear(layer(&mut words, width[0], width[1])?))?;
        draft.push(Step::Activation(*activation))?;
    }
    if words.left() > 0 {
        draft.push(Step::Map(ends(&mut words, outputs)?))?;
    }
    Ok(Imported {
        network: draft.network()?,
        layers: (0..=hidden).map(|i| format!("layer {i}")).collect(),
        left_out: Vec::new(),
        layout: Some(between.layout.to_owned()),
        notes: between.notes,
        activation_from: if between.layout == POLAR { Origin::File } else { Origin::Layout },
        output_from: if between.layout == POLAR { Origin::File } else { Origin::Layout },
    })
}

const POLAR: &str = "POLAR text";
const SHERLOCK: &str = "Sherlock text";

/// The activations behind `count` layers: POLAR names them, in Sherlock's networks each neuron is a ReLU.
fn between(words: &mut Words<'_>, count: usize) -> Result<Between, String> {
    if !words.is_word() {
        let notes = vec![
            "in a text of Sherlock every neuron is a ReLU, those of the last layer too".to_owned(),
        ];
        return Ok(Between { activations: vec![Activation::Relu; count], layout: SHERLOCK, notes });
    }
    let word = |words: &mut Words<'_>| {
        let word = words.word("an activation")?;
        match word.to_ascii_lowercase().as_str() {
            "relu" => Ok(Activation::Relu),
            "tanh" => Ok(Activation::Tanh),
            "sigmoid" => Ok(Activation::Sigmoid),
            "affine" | "linear" | "identity" => Ok(Activation::Identity),
            _ => Err(format!("activation `{word}` is none of ReLU, tanh, sigmoid, Affine")),
        }
    };
    let activations = (0..count).map(|_| word(words)).collect::<Result<_, String>>()?;
    Ok(Between { activations, layout: POLAR, notes: Vec::new() })
}

/// A layer: the weights and the bias of one neuron after the other.
fn layer(words: &mut Words<'_>, inputs: usize, outputs: usize) -> Result<Linear, String> {
    let (mut weight, mut bias) = (Vec::new(), Vec::new());
    for _ in 0..outputs {
        weight.extend(words.numbers(inputs, "a weight")?);
        bias.push(words.number("a bias")?);
    }
    Ok(Linear { weight, bias, inputs })
}

/// What is taken from the output, and the factor of the difference.
fn ends(words: &mut Words<'_>, outputs: usize) -> Result<Map, String> {
    let (offset, scale) = (words.number("the offset")?, words.number("the scale")?);
    if words.left() > 0 {
        return Err(format!(
            "{} words behind the offset and the scale of the output",
            words.left()
        ));
    }
    Ok(Map::affine(vec![scale; outputs], vec![-offset * scale; outputs]))
}
