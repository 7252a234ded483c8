//! The safetensors file of a network.
//!
//! f32 tensors: `layers.{i}.weight` `[out, in]` and `layers.{i}.bias` `[out]` of each layer; `layers.{i}.norm.weight`
//! and `layers.{i}.norm.bias` `[out]` of one with a LayerNorm; `input.scale`, `input.shift`, `input.low` and
//! `input.high` `[in]` of a map of the inputs, and `input.center` where it has one; `output.scale` and so on `[out]` of
//! one of the outputs.
//!
//! Metadata: `activation` of the hidden layers and `output`, that of the last layer; where the hidden layers differ,
//! `activations` in their place, a word for each layer with spaces between; `layers.{i}.norm.epsilon`, a number;
//! `state_order`, names separated by commas. `format`, by which other programs say who wrote a file, is passed over.
//! Any other tensor or entry is refused: a network that left it out would be another one.

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde_json::{Map, Value, json};

use super::{Activation, Layer, Mlp, Norm, Rescale, repeated};
use crate::error::{Error, Result};
use crate::files::{RECORD_BYTES, read};

/// The entries of the metadata that are not of one layer.
const ENTRIES: [&str; 5] = ["activation", "output", "activations", "state_order", "format"];
/// Bytes of the length of the header.
const LENGTH: usize = 8;
/// The tensors of a map, and one that it may have.
const MAP: [&str; 4] = ["scale", "shift", "low", "high"];
const CENTER: &str = "center";

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
        let (length, header) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        repeated::refuse(&bytes[LENGTH..LENGTH + length])?;
        let tensors = SafeTensors::deserialize(bytes).map_err(damaged)?;
        let empty = HashMap::new();
        let metadata = header.metadata().as_ref().unwrap_or(&empty);
        let mut count = 0;
        while tensors.tensor(&weight_of(count)).is_ok() {
            count += 1;
        }
        let file = File { tensors, metadata };
        // Of a file of another program, the first thing to be said is that it has no words.
        if !metadata.contains_key("activations") {
            ["activation", "output"].iter().try_for_each(|key| file.word(key).map(drop))?;
        }
        file.refuse_tensors(count)?;
        file.refuse_entries(count)?;
        file.network(count)
    }

    /// The bytes of its safetensors file, the same for the same network.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut header = Map::from_iter([("__metadata__".to_owned(), self.entries().into())]);
        let mut numbers = Vec::new();
        for (name, shape, values) in self.tensors() {
            let begin = numbers.len();
            numbers.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            let offsets = [begin, numbers.len()];
            let entry = json!({"dtype": "F32", "shape": shape, "data_offsets": offsets});
            header.insert(name, entry);
        }
        let mut header = Value::Object(header).to_string().into_bytes();
        header.resize(header.len().next_multiple_of(8), b' ');
        [&(header.len() as u64).to_le_bytes(), header.as_slice(), &numbers].concat()
    }

    /// The metadata of its file, in an order that does not change: the library's does from one run to the next.
    fn entries(&self) -> Map<String, Value> {
        let mut entries = Map::new();
        match self.activation() {
            Some(hidden) => {
                entries.insert("activation".to_owned(), hidden.name().into());
                entries.insert("output".to_owned(), self.output().name().into());
            }
            None => {
                let words: Vec<String> =
                    self.layers().iter().map(|layer| layer.activation.name()).collect();
                entries.insert("activations".to_owned(), words.join(" ").into());
            }
        }
        for (i, layer) in self.layers().iter().enumerate() {
            if let Some(norm) = &layer.norm {
                entries.insert(epsilon_of(i), format!("{:?}", norm.epsilon).into());
            }
        }
        if let Some(names) = self.state_order() {
            entries.insert("state_order".to_owned(), names.join(",").into());
        }
        entries
    }

    /// Its tensors: name, shape and numbers.
    fn tensors(&self) -> impl Iterator<Item = (String, Vec<usize>, &[f32])> {
        let layers = self.layers().iter().enumerate().flat_map(|(i, layer)| {
            let name = move |kind: &str| format!("layers.{i}.{kind}");
            let own = [
                (name("weight"), vec![layer.outputs, layer.inputs], layer.weight.as_slice()),
                (name("bias"), vec![layer.outputs], layer.bias.as_slice()),
            ];
            let norm = layer.norm.iter().flat_map(move |norm| {
                let of = [("norm.weight", &norm.scale), ("norm.bias", &norm.shift)];
                of.map(|(kind, values)| (name(kind), vec![values.len()], values.as_slice()))
            });
            own.into_iter().chain(norm)
        });
        let ends = [("input", self.input_map()), ("output", self.output_map())];
        let maps = ends.into_iter().filter_map(|(end, map)| Some((end, map?)));
        layers.chain(maps.flat_map(|(end, map)| {
            let name = move |kind| format!("{end}.{kind}");
            map.tensors()
                .map(move |(kind, values)| (name(kind), vec![values.len()], values.as_slice()))
        }))
    }
}

fn weight_of(layer: usize) -> String {
    format!("layers.{layer}.weight")
}

fn epsilon_of(layer: usize) -> String {
    format!("layers.{layer}.norm.epsilon")
}

/// Whether `name` is a tensor of one of the first `count` layers or of a map.
fn is_known(name: &str, count: usize) -> bool {
    let of_layer = |i: usize| {
        let kinds = ["weight", "bias", "norm.weight", "norm.bias"];
        i < count && kinds.iter().any(|kind| *name == format!("layers.{i}.{kind}"))
    };
    let of_map =
        |(end, kind)| ["input", "output"].contains(&end) && (MAP.contains(&kind) || kind == CENTER);
    number_of(name).is_some_and(of_layer) || name.split_once('.').is_some_and(of_map)
}

/// A file whose tensors and metadata are named.
struct File<'a> {
    tensors: SafeTensors<'a>,
    metadata: &'a HashMap<String, String>,
}

impl File<'_> {
    /// The network of `count` layers.
    fn network(&self, count: usize) -> std::result::Result<Mlp, String> {
        let mut mlp = match self.metadata.get("activations") {
            None => Mlp::new(self.layers(count)?, self.word("activation")?, self.word("output")?),
            Some(list) => {
                let words = self.words(list, count)?;
                let layers = self.layers(count)?.into_iter().zip(words);
                Mlp::from_layers(layers.map(|(layer, word)| layer.activated(word)).collect())
            }
        }
        .map_err(in_words)?;
        if let Some(map) = self.map("input")? {
            mlp = mlp.with_input(map).map_err(in_words)?;
        }
        if let Some(map) = self.map("output")? {
            mlp = mlp.with_output(map).map_err(in_words)?;
        }
        let Some(names) = self.metadata.get("state_order") else { return Ok(mlp) };
        let names = names.split(',').map(|name| name.trim().to_owned()).collect();
        let problem = |error| format!("metadata `state_order` {}", in_words(error));
        mlp.with_state_order(names).map_err(problem)
    }

    /// The activation of each of `count` layers, from a list of words.
    fn words(&self, list: &str, count: usize) -> std::result::Result<Vec<Activation>, String> {
        let mut pair = ["activation", "output"].iter();
        if let Some(other) = pair.find(|key| self.metadata.contains_key(**key)) {
            return Err(format!(
                "metadata has both `activations` and `{other}`: a word for each layer, or the two of all"
            ));
        }
        let words: std::result::Result<Vec<Activation>, String> =
            list.split_whitespace().map(str::parse).collect();
        let words = words.map_err(|problem| {
            format!("activations `{list}`: {problem}; a word for each layer, with spaces between")
        })?;
        match words.len() == count {
            true => Ok(words),
            false => Err(format!(
                "activations `{list}` are {}, the file has {count} layers",
                words.len()
            )),
        }
    }

    /// The activation in the metadata entry `key`.
    fn word(&self, key: &str) -> std::result::Result<Activation, String> {
        let word = self.metadata.get(key);
        let missing =
            || format!("metadata has no `{key}`, expected one of {}", Activation::words());
        word.ok_or_else(missing)?.parse().map_err(|problem| format!("{key} {problem}"))
    }

    /// The layers, without activations.
    fn layers(&self, count: usize) -> std::result::Result<Vec<Layer>, String> {
        (0..count).map(|i| self.layer(i)).collect()
    }

    /// Layer `i`.
    fn layer(&self, i: usize) -> std::result::Result<Layer, String> {
        let name = weight_of(i);
        let (weight, shape) = self.numbers(&name)?;
        let &[outputs, inputs] = shape.as_slice() else {
            return Err(format!("{name} has shape {shape:?}, expected [out, in]"));
        };
        let bias = self.vector(&format!("layers.{i}.bias"), outputs)?;
        let (norm, activation) = (self.norm(i, outputs)?, Activation::Identity);
        Ok(Layer { weight, bias, inputs, outputs, norm, activation })
    }

    /// The norm of layer `i`: both tensors and the entry, or none of them.
    fn norm(&self, i: usize, outputs: usize) -> std::result::Result<Option<Norm>, String> {
        let key = epsilon_of(i);
        let names = ["weight", "bias"].map(|kind| format!("layers.{i}.norm.{kind}"));
        let has = names.iter().any(|name| self.tensors.tensor(name).is_ok());
        if !has && !self.metadata.contains_key(&key) {
            return Ok(None);
        }
        let [scale, shift] = &names;
        let (scale, shift) = (self.vector(scale, outputs)?, self.vector(shift, outputs)?);
        let epsilon = self.metadata.get(&key).ok_or_else(|| format!("metadata has no `{key}`"))?;
        let epsilon =
            epsilon.trim().parse().map_err(|_| format!("{key} `{epsilon}` is no number"))?;
        Ok(Some(Norm { scale, shift, epsilon }))
    }

    /// The map at `end`: four tensors, and a center, or none of them.
    fn map(&self, end: &str) -> std::result::Result<Option<Rescale>, String> {
        let name = |kind: &str| format!("{end}.{kind}");
        let has = |kind: &str| self.tensors.tensor(&name(kind)).is_ok();
        if !MAP.into_iter().any(has) && !has(CENTER) {
            return Ok(None);
        }
        let (scale, shape) = self.numbers(&name("scale"))?;
        let &[count] = shape.as_slice() else {
            return Err(format!(
                "{end}.scale has shape {shape:?}, expected a number for each {end}"
            ));
        };
        let vector = |kind: &str| self.vector(&name(kind), count);
        let center = if has(CENTER) { vector(CENTER)? } else { vec![0.0; count] };
        Ok(Some(Rescale {
            center,
            scale,
            shift: vector("shift")?,
            low: vector("low")?,
            high: vector("high")?,
        }))
    }

    /// A tensor of `count` numbers.
    fn vector(&self, name: &str, count: usize) -> std::result::Result<Vec<f32>, String> {
        let (values, shape) = self.numbers(name)?;
        match shape == [count] {
            true => Ok(values),
            false => Err(format!("{name} has shape {shape:?}, expected [{count}]")),
        }
    }

    /// A tensor's numbers and its shape.
    fn numbers(&self, name: &str) -> std::result::Result<(Vec<f32>, Vec<usize>), String> {
        let tensor = self.tensors.tensor(name).map_err(|_| format!("no tensor `{name}`"))?;
        Ok((floats(name, &tensor)?, tensor.shape().to_vec()))
    }

    /// Refuses tensors that are no part of the first `count` layers or of a map.
    fn refuse_tensors(&self, count: usize) -> std::result::Result<(), String> {
        let mut others = self.tensors.names();
        others.retain(|name| !is_known(name, count));
        others.sort_unstable();
        let Some(first) = others.first() else { return Ok(()) };
        let beyond =
            others.iter().any(|name| number_of(name).is_some_and(|number| number >= count));
        let problem = match (beyond, others.len()) {
            (true, _) => {
                format!("there is no `{}`: the layers have a gap before it", weight_of(count))
            }
            (false, 1) => "it is no part of a network, which would be used without it".to_owned(),
            (false, more) => format!(
                "it is no part of a network, nor are {} more tensors, and it would be used without them",
                more - 1
            ),
        };
        Err(format!(
            "tensor `{first}`: {problem}; a policy file has layers.{{i}}.weight and layers.{{i}}.bias, i = 0, 1, ..., \
             layers.{{i}}.norm.weight and .bias, and scale, shift, low, high and center of input and output"
        ))
    }

    /// Refuses metadata that says nothing of the first `count` layers: it may have been meant to.
    fn refuse_entries(&self, count: usize) -> std::result::Result<(), String> {
        let of_layer =
            |key: &str| number_of(key).is_some_and(|i| i < count && *key == epsilon_of(i));
        let known = |key: &str| ENTRIES.contains(&key) || of_layer(key);
        match self.metadata.keys().filter(|key| !known(key.as_str())).min() {
            None => Ok(()),
            Some(key) => Err(format!(
                "metadata `{key}` is none of {} and layers.{{i}}.norm.epsilon; the network would be used without it",
                ENTRIES.join(", ")
            )),
        }
    }
}

/// The number of the layer that a tensor belongs to.
fn number_of(name: &str) -> Option<usize> {
    name.strip_prefix("layers.")?.split('.').next()?.parse().ok()
}

/// What is wrong with a network, without the words around it.
fn in_words(error: Error) -> String {
    match error {
        Error::Invalid { problem, .. } => problem,
        other => other.to_string(),
    }
}

/// The tensor's numbers.
fn floats(name: &str, tensor: &TensorView<'_>) -> std::result::Result<Vec<f32>, String> {
    if tensor.dtype() != Dtype::F32 {
        return Err(format!("{name} is {:?}, expected F32", tensor.dtype()));
    }
    let float = |bytes: &[u8]| bytes.try_into().map(f32::from_le_bytes).unwrap_or(f32::NAN);
    Ok(tensor.data().chunks_exact(4).map(float).collect())
}

#[cfg(test)]
mod tests;
