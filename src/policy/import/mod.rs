//! Policies from files of other programs: PyTorch checkpoints and ONNX graphs.
//!
//! Nothing in a file is executed, and no length in it decides how much memory is taken.

mod checkpoint;
mod graph;
mod kind;
mod layers;
mod onnx;
mod pickle;
mod value;

use std::path::Path;

use serde::Serialize;

use super::{Activation, Layer, Mlp};
use crate::error::{Error, Result};
use crate::files;
use checkpoint::{Checkpoint, Opened};
use graph::GraphNetwork;
pub use kind::Cast;

/// First bytes of a zip archive.
const ZIP: &[u8] = b"PK\x03\x04";
/// First byte of a pickle, which checkpoints of PyTorch before 1.6 are.
const PICKLE: u8 = 0x80;

/// Which network is wanted, and what its file does not say.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Prefixes of the names of its layers, one after the other; none if there is one network.
    pub networks: Vec<String>,
    /// Activation of the hidden layers.
    pub activation: Option<Activation>,
    /// Activation of the last layer.
    pub output: Option<Activation>,
    /// What is done with floats of another width.
    pub cast: Cast,
}

/// Where a property of the network comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// The file.
    File,
    /// The request.
    Stated,
    /// Neither.
    Default,
}

/// A network that was found.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The network.
    pub network: Mlp,
    /// Names of its layers in the file.
    pub layers: Vec<String>,
    /// Names of the tensors that are no part of it, those of no dense layer first.
    pub left_out: Vec<String>,
    /// Who said what the hidden activation is.
    pub activation_from: Origin,
    /// Who said what the last activation is.
    pub output_from: Origin,
}

/// Reads a network from a PyTorch checkpoint or an ONNX graph.
///
/// A checkpoint is a state dict, or dictionaries with state dicts in them; its layers are taken to
/// be applied one after the other, with `relu` between them and `tanh` at the end (nothing at the
/// end of a `critic`), unless the request states otherwise.
///
/// # Errors
/// [`Error::File`] saying what is damaged, not supported or not clear, and what to do;
/// [`Error::Invalid`] for a request that does not go with the file.
pub fn read(path: &Path, request: &Request) -> Result<Imported> {
    let bytes = files::read(path, files::ARCHIVE_BYTES).map_err(|e| Error::file(path, e))?;
    from_bytes(path, &bytes, request)
}

/// Reads a network from the content of the file `path`.
///
/// # Errors
/// As [`read`].
pub fn from_bytes(path: &Path, bytes: &[u8], request: &Request) -> Result<Imported> {
    let refused = |problem: String| Error::file(path, problem);
    if bytes.starts_with(ZIP) {
        return from_checkpoint(bytes, request).map_err(refused);
    }
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("onnx")) {
        return as_stated(graph::read(bytes, request.cast).map_err(refused)?, request);
    }
    let problem = match bytes.first() {
        Some(&PICKLE) => {
            "the format of PyTorch before 1.6; load it and save it again: \
             torch.save(torch.load(FILE, weights_only=True), OTHER)"
        }
        _ => "neither a checkpoint of PyTorch (a zip archive) nor called .onnx",
    };
    Err(refused(problem.to_owned()))
}

/// The network of a checkpoint.
fn from_checkpoint(bytes: &[u8], request: &Request) -> std::result::Result<Imported, String> {
    let Opened { mut checkpoint, tensors } = Checkpoint::open(bytes)?;
    let chosen = layers::choose(&tensors, &request.networks)?;
    let left_out = layers::left_out(&tensors, &chosen);
    let mut numbers = |tensor: &checkpoint::Tensor| {
        let numbers = checkpoint.numbers(tensor, request.cast);
        numbers.map_err(|problem| format!("`{}`: {problem}", tensor.name))
    };
    let mut layers = Vec::new();
    for layer in &chosen {
        let bias = layer.bias.map(&mut numbers).transpose()?;
        layers.push(Layer::dense(
            numbers(layer.weight)?,
            bias.unwrap_or_else(|| vec![0.0; layer.outputs()]),
        ));
    }
    let names: Vec<String> = chosen.iter().map(|layer| layer.name.to_owned()).collect();
    let usual = match names.iter().any(|name| name.split('.').any(|key| key.starts_with("critic")))
    {
        true => Activation::Identity,
        false => Activation::Tanh,
    };
    let origin = |stated: bool| if stated { Origin::Stated } else { Origin::Default };
    let network = Mlp::new(
        layers,
        request.activation.unwrap_or(Activation::Relu),
        request.output.unwrap_or(usual),
    );
    Ok(Imported {
        network: network.map_err(|e| e.to_string())?,
        layers: names,
        left_out,
        activation_from: origin(request.activation.is_some()),
        output_from: origin(request.output.is_some()),
    })
}

/// The network of a graph, which a request may repeat but not change.
fn as_stated(found: GraphNetwork, request: &Request) -> Result<Imported> {
    let GraphNetwork { network, layers } = found;
    if !request.networks.is_empty() {
        return Err(Error::invalid("network", "an ONNX graph is one network; leave it out"));
    }
    let differs = |place: &str, stated: &str, has: &str| {
        Err(Error::invalid(place, format!("{stated} is stated, the graph has {has}; leave it out")))
    };
    match (request.activation, request.output) {
        (Some(stated), _) if network.activation().is_none_or(|has| has != stated) => {
            differs("activation", &stated.name(), &network.hidden_words())
        }
        (_, Some(stated)) if stated != network.output() => {
            differs("output", &stated.name(), &network.output().name())
        }
        _ => Ok(Imported {
            network,
            layers,
            left_out: Vec::new(),
            activation_from: Origin::File,
            output_from: Origin::File,
        }),
    }
}
