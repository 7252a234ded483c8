//! The safetensors file of a network.
//!
//! f32 tensors `layers.{i}.weight` `[out, in]` and `layers.{i}.bias` `[out]`; metadata `activation`
//! (relu, tanh, silu), `output` (tanh, identity) and `state_order` (names separated by commas).

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde_json::{Map, Value, json};

use super::{Activation, Layer, Mlp, OutputActivation};
use crate::error::{Error, Result};
use crate::files::{RECORD_BYTES, read};

impl Mlp {
    /// Reads a safetensors file.
    ///
    /// # Errors
    /// [`Error::File`] naming the tensor or metadata that is missing, of the wrong type or shape,
    /// or not finite.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read(path, RECORD_BYTES).map_err(|e| Error::file(path, e))?;
        Self::from_bytes(&bytes).map_err(|problem| Error::file(path, problem))
    }

    /// Reads the bytes of a safetensors file; the error says what is wrong with them.
    ///
    /// # Errors
    /// A sentence about the first fault found.
    pub fn from_bytes(bytes: &[u8]) -> std::result::Result<Self, String> {
        let damaged = |e| {
            format!(
                "not a whole safetensors file ({e}); files of PyTorch and ONNX are converted by \
                 `reachcast policy import`"
            )
        };
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
        refuse_others(&tensors, layers.len())?;
        let mlp = Self { layers: layers.into(), activation, output, state_order: None };
        mlp.validate()?;
        match state_order {
            None => Ok(mlp),
            Some(names) => mlp.with_state_order(names).map_err(|error| match error {
                Error::Invalid { problem, .. } => format!("metadata `state_order` {problem}"),
                other => other.to_string(),
            }),
        }
    }

    /// The bytes of its safetensors file, the same for the same network.
    pub fn to_bytes(&self) -> Vec<u8> {
        // The library writes the metadata in an order that changes from one run to the next.
        let mut metadata = Map::new();
        metadata.insert("activation".to_owned(), self.activation.name().into());
        metadata.insert("output".to_owned(), self.output.name().into());
        if let Some(names) = &self.state_order {
            metadata.insert("state_order".to_owned(), names.join(",").into());
        }
        let mut header = Map::from_iter([("__metadata__".to_owned(), metadata.into())]);
        let mut numbers = Vec::new();
        for (i, layer) in self.layers.iter().enumerate() {
            let Layer { weight, bias, inputs, outputs } = layer;
            let mut add = |kind: &str, shape: Value, values: &[f32]| {
                let begin = numbers.len();
                numbers.extend(values.iter().flat_map(|value| value.to_le_bytes()));
                let offsets = [begin, numbers.len()];
                let entry = json!({"dtype": "F32", "shape": shape, "data_offsets": offsets});
                header.insert(format!("layers.{i}.{kind}"), entry);
            };
            add("weight", json!([outputs, inputs]), weight);
            add("bias", json!([outputs]), bias);
        }
        let mut header = Value::Object(header).to_string().into_bytes();
        header.resize(header.len().next_multiple_of(8), b' ');
        [&(header.len() as u64).to_le_bytes(), header.as_slice(), &numbers].concat()
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

/// Refuses tensors that are no part of the first `count` layers: a network that left them out would
/// be another one.
fn refuse_others(tensors: &SafeTensors<'_>, count: usize) -> std::result::Result<(), String> {
    let known = |name: &str| {
        (0..count)
            .any(|i| ["weight", "bias"].iter().any(|kind| name == format!("layers.{i}.{kind}")))
    };
    let mut others = tensors.names();
    others.retain(|name| !known(name));
    others.sort_unstable();
    let Some(first) = others.first() else { return Ok(()) };
    let beyond = others.iter().any(|name| name.starts_with("layers."));
    let problem = match (beyond, others.len()) {
        (true, _) => {
            format!("there is no `layers.{count}.weight`: the layers have a gap before it")
        }
        (false, 1) => "it is no layer, and the network would be used without it".to_owned(),
        (false, more) => format!(
            "it is no layer, nor are {} more tensors, and the network would be used without them",
            more - 1
        ),
    };
    Err(format!(
        "tensor `{first}`: {problem}; a policy file has layers.{{i}}.weight and layers.{{i}}.bias \
         alone, i = 0, 1, ..."
    ))
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
    let (bias, shape) = named("bias")?;
    if shape != [outputs] {
        return Err(format!("layers.{i}.bias has shape {shape:?}, expected [{outputs}]"));
    }
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
