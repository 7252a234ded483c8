//! What an import is asked for, and what it finds.

use serde::Serialize;

use super::kind::Cast;
use super::map::Map;
use crate::policy::{Activation, Mlp};

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
    /// What the library that wrote the file does by default.
    Layout,
    /// Nobody.
    Default,
}

/// A network that was found.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The network.
    pub network: Mlp,
    /// Names of its layers in the file.
    pub layers: Vec<String>,
    /// Names of the tensors that are no part of it, those of no dense layer first; objects that were not
    /// made have their class behind their names.
    pub left_out: Vec<String>,
    /// The library or format whose layout the file has, where it is known.
    pub layout: Option<String>,
    /// What else was made of the file, and what the library does that is not in it.
    pub notes: Vec<String>,
    /// Who said what the hidden activation is.
    pub activation_from: Origin,
    /// Who said what the last activation is.
    pub output_from: Origin,
}

/// What stands beside the tensors of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Hints {
    /// Activation of the hidden layers.
    pub(super) activation: Option<Activation>,
    /// Activation of the last layer.
    pub(super) output: Option<Activation>,
    /// What follows each layer, where the code beside the tensors says it.
    pub(super) behind: Option<Vec<Activation>>,
    /// Limit of what goes into the last activation, where the library has one.
    pub(super) clip: Option<f64>,
    /// Why it is not known what lies between the layers, unless that is stated.
    pub(super) unsaid: Option<String>,
    /// What the output goes through then; of one number if it is the same for all.
    pub(super) output_map: Option<Map>,
    /// Why the layers are no policy, unless they are asked for by name.
    pub(super) refusal: Option<String>,
    /// What to say about it.
    pub(super) notes: Vec<String>,
    /// What else is done with inputs and outputs, which layers that are asked for by name come without.
    pub(super) around: Vec<String>,
    /// Whether anything stands there.
    pub(super) is_said: bool,
}

impl Hints {
    /// The same with what code says that follows each layer, if it does.
    pub(super) fn with(&self, behind: Option<Vec<Activation>>) -> Self {
        let Some(behind) = behind else { return self.clone() };
        let [activation, output] = [behind.first().copied(), behind.last().copied()];
        Self { activation, output, behind: Some(behind), unsaid: None, ..self.clone() }
    }
}
