//! Multi-layer perceptrons and their safetensors file.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use crate::digest;
use crate::error::{Error, Result};
use crate::real::Real;

/// Activation of the hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// `max(0, x)`.
    Relu,
    /// Hyperbolic tangent.
    Tanh,
    /// `x / (1 + exp(-x))`.
    Silu,
}

impl Activation {
    /// Its name in files.
    fn name(self) -> &'static str {
        match self {
            Self::Relu => "relu",
            Self::Tanh => "tanh",
            Self::Silu => "silu",
        }
    }

    /// The activation at `x`; NaN stays NaN.
    #[inline(always)]
    pub fn apply<R: Real>(self, x: R) -> R {
        let half = R::lit(0.5);
        match self {
            Self::Relu => x.if_lt(R::lit(0.0), R::lit(0.0), x),
            Self::Tanh => x.tanh(),
            // The logistic function is (1 + tanh(x / 2)) / 2.
            Self::Silu => {
                let scaled = half * x;
                scaled + scaled * scaled.tanh()
            }
        }
    }
}

/// Activation of the last layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputActivation {
    /// Hyperbolic tangent: controls in `[-1, 1]`.
    Tanh,
    /// None.
    Identity,
}

impl OutputActivation {
    /// Its name in files.
    fn name(self) -> &'static str {
        match self {
            Self::Tanh => "tanh",
            Self::Identity => "identity",
        }
    }

    /// The activation at `x`.
    #[inline(always)]
    pub fn apply<R: Real>(self, x: R) -> R {
        match self {
            Self::Tanh => x.tanh(),
            Self::Identity => x,
        }
    }
}

/// One dense layer, `y = W x + b`.
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
}

/// A dense network.
///
/// File format: safetensors, f32, tensors `layers.{i}.weight` `[out, in]` and `layers.{i}.bias`
/// `[out]`, metadata `activation` (relu, tanh, silu), `output` (tanh, identity) and
/// `state_order` (names separated by commas).
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    /// Shared by copies of the network.
    layers: Arc<[Layer]>,
    activation: Activation,
    output: OutputActivation,
    state_order: Option<Vec<String>>,
}

impl Mlp {
    /// A network from its layers.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no layer, a shape does not fit its neighbour, or a weight
    /// is not finite.
    pub fn new(
        layers: Vec<Layer>,
        activation: Activation,
        output: OutputActivation,
    ) -> Result<Self> {
        let mlp = Self { layers: layers.into(), activation, output, state_order: None };
        mlp.validate().map_err(|problem| Error::invalid("network", problem))?;
        Ok(mlp)
    }

    /// Reads a safetensors file.
    ///
    /// # Errors
    /// [`Error::File`] naming the tensor or metadata that is missing, of the wrong type or shape,
    /// or not finite.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        Self::from_bytes(&bytes).map_err(|problem| Error::file(path, problem))
    }

    /// Reads the bytes of a safetensors file; the error says what is wrong with them.
    ///
    /// # Errors
    /// A sentence about the first fault found.
    pub fn from_bytes(bytes: &[u8]) -> std::result::Result<Self, String> {
        let damaged = |e| format!("not a whole safetensors file ({e})");
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(damaged)?;
        let empty = HashMap::new();
        let metadata = header.metadata().as_ref().unwrap_or(&empty);
        let activation = match word(metadata, "activation", "relu, tanh or silu")? {
            "relu" => Activation::Relu,
            "tanh" => Activation::Tanh,
            "silu" => Activation::Silu,
            other => return Err(format!("activation `{other}` is none of relu, tanh, silu")),
        };
        let output = match word(metadata, "output", "tanh or identity")? {
            "tanh" => OutputActivation::Tanh,
            "identity" => OutputActivation::Identity,
            other => return Err(format!("output `{other}` is neither tanh nor identity")),
        };
        let state_order = metadata
            .get("state_order")
            .map(|names| names.split(',').map(|name| name.trim().to_owned()).collect());
        let mut layers = Vec::new();
        while tensors.tensor(&format!("layers.{}.weight", layers.len())).is_ok() {
            layers.push(read_layer(&tensors, layers.len())?);
        }
        let mlp = Self { layers: layers.into(), activation, output, state_order };
        mlp.validate()?;
        Ok(mlp)
    }

    /// The bytes of its safetensors file, which [`Self::from_bytes`] reads.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the library refuses to write them.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let mut tensors = Vec::new();
        for (i, layer) in self.layers.iter().enumerate() {
            let weight = (vec![layer.outputs, layer.inputs], le_bytes(&layer.weight));
            tensors.push((format!("layers.{i}.weight"), weight));
            tensors
                .push((format!("layers.{i}.bias"), (vec![layer.outputs], le_bytes(&layer.bias))));
        }
        let mut words = HashMap::from([
            ("activation".to_owned(), self.activation.name().to_owned()),
            ("output".to_owned(), self.output.name().to_owned()),
        ]);
        words.extend(self.state_order.iter().map(|order| ("state_order".into(), order.join(","))));
        let refused = |e: safetensors::SafeTensorError| Error::invalid("network", e.to_string());
        let mut views = Vec::new();
        for (name, (shape, bytes)) in &tensors {
            let view = TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(refused)?;
            views.push((name, view));
        }
        safetensors::serialize(views, Some(words)).map_err(refused)
    }

    /// The layers, input side first.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Whether `other` is this network or a copy of it, told without a look at its numbers.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let shape = (self.activation, self.output) == (other.activation, other.output);
        shape && Arc::ptr_eq(&self.layers, &other.layers)
    }

    /// Activation of the hidden layers.
    pub fn activation(&self) -> Activation {
        self.activation
    }

    /// Activation of the last layer.
    pub fn output(&self) -> OutputActivation {
        self.output
    }

    /// Input width, then the output width of each layer.
    pub fn widths(&self) -> Vec<usize> {
        let first = self.layers.first().map(|layer| layer.inputs);
        first.into_iter().chain(self.layers.iter().map(|layer| layer.outputs)).collect()
    }

    /// Number of weights and biases.
    pub fn parameter_count(&self) -> usize {
        self.layers.iter().map(|layer| layer.weight.len() + layer.bias.len()).sum()
    }

    /// SHA-256 over widths, activations and parameters, in hexadecimal.
    pub fn digest(&self) -> String {
        let shape = format!("{:?} {:?} {:?}", self.widths(), self.activation, self.output);
        let parameters = self.layers.iter().flat_map(|layer| [&layer.weight, &layer.bias]);
        let bytes = parameters.map(|values| bytemuck::cast_slice(values));
        digest::sha256(std::iter::once(shape.as_bytes()).chain(bytes))
    }

    /// Checks the network against a system of `states` (names in order) and `controls`.
    ///
    /// # Errors
    /// A sentence that names both shapes, or the first state out of order.
    pub fn check_fits(&self, states: &[&str], controls: usize) -> std::result::Result<(), String> {
        let widths = self.widths();
        let (inputs, outputs) = (widths[0], widths[widths.len() - 1]);
        if (inputs, outputs) != (states.len(), controls) {
            return Err(format!(
                "the network maps {inputs} inputs to {outputs} outputs, \
                 the system has {} states and {controls} controls",
                states.len()
            ));
        }
        match &self.state_order {
            Some(order) if order.iter().ne(states) => Err(format!(
                "state_order `{}` is not the system's `{}`",
                order.join(","),
                states.join(",")
            )),
            _ => Ok(()),
        }
    }

    /// The output for `input`, one neuron after the other: the reference for the backends.
    ///
    /// # Panics
    /// If `input` has not the input width.
    pub fn forward<R: Real>(&self, input: &[R]) -> Vec<R> {
        assert_eq!(input.len(), self.layers[0].inputs, "input width of the network");
        let mut x = input.to_vec();
        for (i, layer) in self.layers.iter().enumerate() {
            let last = i + 1 == self.layers.len();
            let neuron = |row: usize| {
                let weights = &layer.weight[row * layer.inputs..(row + 1) * layer.inputs];
                let sum = weights
                    .iter()
                    .zip(&x)
                    .fold(R::lit(layer.bias[row]), |sum, (&w, &x)| sum + R::lit(w) * x);
                if last { self.output.apply(sum) } else { self.activation.apply(sum) }
            };
            x = (0..layer.outputs).map(neuron).collect();
        }
        x
    }

    fn validate(&self) -> std::result::Result<(), String> {
        if self.layers.is_empty() {
            return Err("no tensor `layers.0.weight`: the network has no layer".to_owned());
        }
        for (i, layer) in self.layers.iter().enumerate() {
            let shape = layer.outputs.checked_mul(layer.inputs);
            if layer.inputs == 0 || shape != Some(layer.weight.len()) || layer.outputs == 0 {
                return Err(format!("layers.{i}.weight has not the shape [out, in]"));
            }
            if layer.bias.len() != layer.outputs {
                return Err(format!(
                    "layers.{i}.bias has {} entries, layers.{i}.weight has {} rows",
                    layer.bias.len(),
                    layer.outputs
                ));
            }
            if let Some(before) = i.checked_sub(1).map(|before| &self.layers[before])
                && before.outputs != layer.inputs
            {
                return Err(format!(
                    "layers.{i}.weight has {} columns, layers.{} has {} outputs",
                    layer.inputs,
                    i - 1,
                    before.outputs
                ));
            }
            for (kind, values) in [("weight", &layer.weight), ("bias", &layer.bias)] {
                if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                    return Err(format!("layers.{i}.{kind}[{at}] is {}, not finite", values[at]));
                }
            }
        }
        Ok(())
    }
}

/// The metadata entry `key`; the error names what it may be.
fn word<'a>(
    metadata: &'a HashMap<String, String>,
    key: &str,
    choices: &str,
) -> std::result::Result<&'a str, String> {
    metadata
        .get(key)
        .map(String::as_str)
        .ok_or_else(|| format!("metadata has no `{key}`, expected {choices}"))
}

/// Layer `i` of the file.
fn read_layer(tensors: &SafeTensors<'_>, i: usize) -> std::result::Result<Layer, String> {
    let named = |kind: &str| {
        let name = format!("layers.{i}.{kind}");
        let tensor = tensors.tensor(&name).map_err(|_| format!("no tensor `{name}`"))?;
        let values = floats(&name, &tensor)?;
        Ok::<_, String>((values, tensor.shape().to_vec()))
    };
    let (weight, shape) = named("weight")?;
    let &[outputs, inputs] = shape.as_slice() else {
        return Err(format!("layers.{i}.weight has shape {shape:?}, expected [out, in]"));
    };
    let (bias, _) = named("bias")?;
    Ok(Layer { weight, bias, inputs, outputs })
}

/// The tensor's numbers.
fn floats(name: &str, tensor: &TensorView<'_>) -> std::result::Result<Vec<f32>, String> {
    if tensor.dtype() != Dtype::F32 {
        return Err(format!("{name} is {:?}, expected F32", tensor.dtype()));
    }
    let float = |bytes: &[u8]| bytes.try_into().map(f32::from_le_bytes).unwrap_or(f32::NAN);
    Ok(tensor.data().chunks_exact(4).map(float).collect())
}

/// The numbers as a file holds them.
fn le_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}
