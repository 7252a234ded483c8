//! The text of ACAS networks, `.nnet`: limits and a normalisation of inputs, ReLU layers, a scaled output.

use super::draft::{Draft, MOST_LAYERS, Step};
use super::linear::Linear;
use super::map::Map;
use super::request::{Imported, Origin};
use super::text::Words;
use crate::policy::Activation;

/// The network of a `.nnet` file.
///
/// # Errors
/// A sentence about damage.
pub(super) fn read(bytes: &[u8]) -> Result<Imported, String> {
    let mut words = Words::of(bytes)?;
    let layers = words.count("the number of layers")?;
    if layers > MOST_LAYERS {
        return Err(format!("{layers} layers; a network has at most {MOST_LAYERS}"));
    }
    let (inputs, outputs) =
        (words.count("the number of inputs")?, words.count("the number of outputs")?);
    words.count("the widest layer")?;
    let widths = (0..=layers).map(|_| words.count("a width")).collect::<Result<Vec<_>, _>>()?;
    if (widths[0], widths[layers]) != (inputs, outputs) {
        return Err(format!(
            "widths {widths:?} of a network of {inputs} inputs and {outputs} outputs"
        ));
    }
    // A number that says nothing.
    words.number("the flag")?;
    let [input, output] = maps(&mut words, inputs, outputs)?;
    let mut draft = Draft::of(Some(inputs));
    draft.push(Step::Map(input))?;
    for (i, width) in widths.windows(2).enumerate() {
        let weight = words.numbers(width[0] * width[1], "a weight")?;
        let bias = words.numbers(width[1], "a bias")?;
        draft.push(Step::Linear(Linear { weight, bias, inputs: width[0] }))?;
        if i + 1 < layers {
            draft.push(Step::Activation(Activation::Relu))?;
        }
    }
    draft.push(Step::Map(output))?;
    if words.left() > 0 {
        return Err(format!("{} words behind the last layer", words.left()));
    }
    imported(draft, layers)
}

/// What is done with inputs, and with outputs: both are normalised, inputs within their limits.
fn maps(words: &mut Words<'_>, inputs: usize, outputs: usize) -> Result<[Map; 2], String> {
    let low = words.numbers(inputs, "a least input")?;
    let high = words.numbers(inputs, "a largest input")?;
    if let Some(i) = (0..inputs).find(|&i| low[i] > high[i]) {
        return Err(format!(
            "input {i}: its least value {} lies above its largest, {}",
            low[i], high[i]
        ));
    }
    let mean = words.numbers(inputs + 1, "a mean")?;
    let range = words.numbers(inputs + 1, "a range")?;
    if !range.iter().all(|range| *range > 0.0) {
        return Err("a range that is not positive".to_owned());
    }
    let input = Map::clamp(low, high).then(&Map::normal(&mean[..inputs], &range[..inputs]));
    let output = Map::affine(vec![range[inputs]; outputs], vec![mean[inputs]; outputs]);
    Ok([input, output])
}

/// The network with what is said about it.
fn imported(draft: Draft, layers: usize) -> Result<Imported, String> {
    Ok(Imported {
        network: draft.network()?,
        layers: (0..layers).map(|i| format!("layer {i}")).collect(),
        left_out: Vec::new(),
        layout: Some(".nnet (ACAS)".to_owned()),
        notes: vec![
            "inputs are kept within the limits of the file and normalised, as it says".to_owned(),
        ],
        activation_from: Origin::File,
        output_from: Origin::File,
    })
}
