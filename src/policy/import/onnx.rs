//! ONNX files read: what a graph begins and ends with, the attributes of its nodes, and its numbers.

use std::collections::HashMap;

use prost::Message;

use super::array::Array;
use super::form::Form;
use super::kind::{Cast, FloatReader, Kind};
use crate::policy::export::PRODUCER;
use crate::policy::onnx::{Attribute, Entry, Graph, Model, Named, Node, Tensor};

/// The numbers of two kinds of integers.
const INT32: i32 = 6;
const INT64: i32 = 7;

/// What gives a value that is neither an input nor a tensor.
const OPERATION: &str = "what an operation gives";
/// Most numbers of one input, which a graph claims without having them.
const MOST_INPUTS: usize = 1 << 16;

/// The value that a graph begins with.
pub(super) struct Input<'a> {
    /// Its name.
    pub(super) name: &'a str,
    /// Its dimensions.
    pub(super) form: Form,
}

/// A graph, and what its file says about it.
#[derive(Debug)]
pub(super) struct Written {
    pub(super) graph: Graph,
    /// The program that wrote it.
    producer: String,
    entries: Vec<Entry>,
}

impl Written {
    /// Whether it is a policy that was exported.
    pub(super) fn is_own(&self) -> bool {
        self.producer == PRODUCER
    }

    /// What a policy that was exported says about itself.
    pub(super) fn entry(&self, key: &str) -> Option<&str> {
        let entry = self.entries.iter().find(|entry| entry.key == key);
        entry.filter(|_| self.is_own()).map(|entry| entry.value.as_str())
    }
}

/// The graph of an ONNX file.
///
/// # Errors
/// A sentence about bytes that are no such file.
pub(super) fn decode(bytes: &[u8]) -> Result<Written, String> {
    let model = Model::decode(bytes).map_err(|e| format!("damaged, or no ONNX file ({e})"))?;
    let graph = model.graph.ok_or("no graph in it: damaged, or no ONNX file")?;
    Ok(Written { graph, producer: model.producer, entries: model.entries })
}

impl Graph {
    /// The tensors that the graph carries, by name.
    pub(super) fn tensors(&self) -> impl Iterator<Item = (&str, &Tensor)> {
        self.initializers.iter().map(|tensor| (tensor.name.as_str(), tensor))
    }

    /// The input, if there is one.
    ///
    /// # Errors
    /// A sentence with the names of all of them.
    pub(super) fn input(&self) -> Result<Input<'_>, String> {
        let tensor =
            |input: &&Named| self.initializers.iter().any(|tensor| tensor.name == input.name);
        let inputs: Vec<&Named> = self.inputs.iter().filter(|input| !tensor(input)).collect();
        match inputs.as_slice() {
            [input] => {
                input.floats()?;
                let form = input.form();
                if let Some(width) = form.width().filter(|width| *width > MOST_INPUTS) {
                    return Err(format!(
                        "the input `{}` has {width} numbers; at most {MOST_INPUTS} are read",
                        input.name
                    ));
                }
                Ok(Input { name: &input.name, form })
            }
            [] => {
                Err("no input: it has none, or all are tensors that it carries; a policy has one"
                    .to_owned())
            }
            several => {
                let names: Vec<&str> = several.iter().map(|input| input.name.as_str()).collect();
                Err(format!(
                    "inputs `{}`; a policy has one, and a state of its own, as recurrent networks have, is none",
                    names.join(", ")
                ))
            }
        }
    }

    /// Refuses names that stand for two values.
    ///
    /// # Errors
    /// A sentence with the name.
    pub(super) fn distinct(&self) -> Result<(), String> {
        let mut given = HashMap::new();
        for (name, _) in self.tensors().filter(|(name, _)| !name.is_empty()) {
            if given.insert(name, "a tensor that the graph carries").is_some() {
                return Err(format!("two tensors are called `{name}`"));
            }
        }
        for input in &self.inputs {
            given.entry(&input.name).or_insert("an input of the graph");
        }
        for node in &self.nodes {
            for name in node.outputs.iter().filter(|name| !name.is_empty()) {
                match given.insert(name, OPERATION) {
                    Some(OPERATION) => return Err(format!("two operations give `{name}`")),
                    Some(other) => {
                        return Err(format!(
                            "operation `{}` gives `{name}`, which is {other}",
                            node.operation
                        ));
                    }
                    None => {}
                }
            }
        }
        Ok(())
    }

    /// The names of the outputs.
    pub(super) fn outputs(&self) -> Vec<&str> {
        self.outputs.iter().map(|output| output.name.as_str()).collect()
    }
}

impl Named {
    /// Refuses one whose numbers are no floats: integers are divided otherwise.
    fn floats(&self) -> Result<(), String> {
        let kind = self.kind.as_ref().and_then(|kind| kind.tensor.as_ref());
        match kind.map_or(0, |tensor| tensor.element) {
            // Nothing is said.
            0 => Ok(()),
            element if Kind::of_onnx(element).size() > 0 => Ok(()),
            element => Err(format!(
                "the numbers of the input `{}` are no floats (their type is {element} in ONNX); export the model with \
                 an input of floats",
                self.name
            )),
        }
    }

    /// Its dimensions.
    fn form(&self) -> Form {
        let shape = self.kind.as_ref().and_then(|kind| kind.tensor.as_ref()?.shape.as_ref());
        let lengths: Option<Vec<i64>> =
            shape.map(|shape| shape.lengths.iter().map(|length| length.value).collect());
        Form::of(lengths.as_deref())
    }
}

impl Node {
    /// The tensor of a constant.
    ///
    /// # Errors
    /// A sentence about a constant of another form.
    pub(super) fn constant(&self, cast: Cast) -> Result<Array, String> {
        match self.attributes.first() {
            Some(Attribute { tensor: Some(tensor), .. }) => tensor.array(cast),
            Some(value) => match value.name.as_str() {
                "value_float" => Ok(Array::number(value.float.unwrap_or_default().into())),
                "value_int" => Ok(Array::number(value.integer as f64).integers(true)),
                "value_floats" => Ok(Array::list(value.floats.iter().map(|&f| f.into()).collect())),
                "value_ints" => {
                    Ok(Array::list(value.integers.iter().map(|&i| i as f64).collect())
                        .integers(true))
                }
                other => Err(format!("a constant with `{other}`, which is no number")),
            },
            None => Err("a constant without a value".to_owned()),
        }
    }

    /// Whether the operation is one of ONNX itself.
    pub(super) fn is_standard(&self) -> bool {
        self.domain.is_empty() || self.domain == "ai.onnx"
    }

    /// The float attribute `name`, if it is given.
    pub(super) fn float(&self, name: &str) -> Option<f32> {
        self.attribute(name).map(|attribute| attribute.float.unwrap_or_default())
    }

    /// The integer attribute `name`, if it is given.
    pub(super) fn integer(&self, name: &str) -> Option<i64> {
        self.attribute(name).map(|attribute| attribute.integer)
    }

    /// The list of integers `name`, if it is given.
    pub(super) fn integers(&self, name: &str) -> Option<&[i64]> {
        self.attribute(name).map(|attribute| attribute.integers.as_slice())
    }

    /// The text attribute `name`, empty if it is not given.
    pub(super) fn text(&self, name: &str) -> &str {
        let text = self.attribute(name).map(|attribute| attribute.text.as_slice());
        text.and_then(|text| std::str::from_utf8(text).ok()).unwrap_or_default()
    }

    fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|attribute| attribute.name == name)
    }
}

impl Tensor {
    /// Whether its numbers are floats.
    pub(super) fn is_float(&self) -> bool {
        Kind::of_onnx(self.data_type).is_float()
    }

    /// The numbers in their shape; integers as they are.
    ///
    /// # Errors
    /// A sentence about numbers that are elsewhere, do not fill the shape, or are no f32 if `cast`
    /// does not allow it.
    pub(super) fn array(&self, cast: Cast) -> Result<Array, String> {
        if self.location != 0 {
            return Err(
                "its numbers are in another file; export with external_data=False".to_owned()
            );
        }
        self.placed()?;
        let numbers = if self.is_float() { self.reals(cast)? } else { self.wholes()? };
        let shape: Option<Vec<usize>> =
            self.lengths.iter().map(|&length| usize::try_from(length).ok()).collect();
        let array = shape.and_then(|shape| Array::new(shape, &numbers));
        let array = array.map(|array| array.integers(!self.is_float()));
        array.ok_or_else(|| {
            format!("{} numbers do not fill the shape {:?}", numbers.len(), self.lengths)
        })
    }

    /// Refuses numbers that lie in two places, and bytes that are no whole numbers.
    fn placed(&self) -> Result<(), String> {
        let size = match self.data_type {
            INT32 => 4,
            INT64 => 8,
            other => Kind::of_onnx(other).size().max(1),
        };
        let lists = [self.floats.len(), self.small.len(), self.integers.len(), self.doubles.len()];
        match self.raw.len() {
            0 => Ok(()),
            _ if lists != [0; 4] => {
                Err("its numbers are there twice, as bytes and as a list".to_owned())
            }
            bytes if bytes % size > 0 => {
                Err(format!("its {bytes} bytes are no whole numbers of {size} bytes each"))
            }
            _ => Ok(()),
        }
    }

    fn reals(&self, cast: Cast) -> Result<Vec<f64>, String> {
        let kind = Kind::of_onnx(self.data_type);
        let FloatReader { size, number } = kind.reader(cast)?;
        Ok(match kind {
            Kind::F32 if self.raw.is_empty() => self.floats.iter().map(|&f| f.into()).collect(),
            Kind::F64 if self.raw.is_empty() => self.doubles.clone(),
            _ => self.raw.chunks_exact(size).map(number).collect(),
        })
    }

    /// Integers of 32 or 64 bits, and truth values.
    fn wholes(&self) -> Result<Vec<f64>, String> {
        let (words, rest) = self.raw.as_chunks::<8>();
        Ok(match self.data_type {
            INT64 if self.raw.is_empty() => self.integers.iter().map(|&i| i as f64).collect(),
            INT64 if rest.is_empty() => {
                words.iter().map(|&word| i64::from_le_bytes(word) as f64).collect()
            }
            INT32 if self.raw.is_empty() => self.small.iter().map(|&i| i.into()).collect(),
            INT32 => {
                let (words, _) = self.raw.as_chunks::<4>();
                words.iter().map(|&word| i32::from_le_bytes(word).into()).collect()
            }
            _ => return Err("its numbers are no floats".to_owned()),
        })
    }
}
