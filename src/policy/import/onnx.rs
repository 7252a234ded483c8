//! The messages of an ONNX file, as far as a dense network needs them, and their tensors.
//!
//! Field numbers are those of `onnx.proto`; other fields are skipped.

use std::collections::HashMap;

use prost::Message;

use super::kind::{Cast, FloatReader, Kind};

/// `ModelProto`.
#[derive(Clone, PartialEq, Message)]
struct Model {
    #[prost(message, optional, tag = "7")]
    graph: Option<Graph>,
}

/// `GraphProto`.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Graph {
    #[prost(message, repeated, tag = "1")]
    pub(super) nodes: Vec<Node>,
    #[prost(message, repeated, tag = "5")]
    initializers: Vec<Tensor>,
    #[prost(message, repeated, tag = "11")]
    inputs: Vec<Named>,
    #[prost(message, repeated, tag = "12")]
    outputs: Vec<Named>,
}

/// `NodeProto`: an operation.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Node {
    /// Names of the values that it takes.
    #[prost(string, repeated, tag = "1")]
    pub(super) inputs: Vec<String>,
    #[prost(string, repeated, tag = "2")]
    outputs: Vec<String>,
    #[prost(string, tag = "4")]
    pub(super) operation: String,
    #[prost(message, repeated, tag = "5")]
    attributes: Vec<Attribute>,
    #[prost(string, tag = "7")]
    domain: String,
}

/// `AttributeProto`.
#[derive(Clone, PartialEq, Message)]
struct Attribute {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(float, tag = "2")]
    float: f32,
    #[prost(int64, tag = "3")]
    integer: i64,
    #[prost(message, optional, tag = "5")]
    tensor: Option<Tensor>,
}

/// `TensorProto`.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Tensor {
    #[prost(int64, repeated, tag = "1")]
    lengths: Vec<i64>,
    #[prost(int32, tag = "2")]
    data_type: i32,
    #[prost(float, repeated, tag = "4")]
    floats: Vec<f32>,
    #[prost(string, tag = "8")]
    name: String,
    #[prost(bytes = "vec", tag = "9")]
    raw: Vec<u8>,
    /// 1 if the numbers are in another file.
    #[prost(int32, tag = "14")]
    location: i32,
}

/// `ValueInfoProto`.
#[derive(Clone, PartialEq, Message)]
struct Named {
    #[prost(string, tag = "1")]
    name: String,
}

/// The values that a graph begins and ends with.
pub(super) struct Ends<'a> {
    /// Name of the input.
    pub(super) input: &'a str,
    /// Name of the output.
    pub(super) output: &'a str,
}

/// The numbers of a tensor.
pub(super) struct Shaped {
    /// Length of each dimension.
    pub(super) shape: Vec<usize>,
    /// The numbers, the last index the fastest.
    pub(super) numbers: Vec<f32>,
}

impl Graph {
    /// The graph of an ONNX file.
    ///
    /// # Errors
    /// A sentence about bytes that are no such file.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, String> {
        let model = Model::decode(bytes).map_err(|e| format!("damaged, or no ONNX file ({e})"))?;
        model.graph.ok_or_else(|| "no graph in it: damaged, or no ONNX file".to_owned())
    }

    /// The tensors that the graph carries, by name.
    pub(super) fn tensors(&self) -> HashMap<&str, &Tensor> {
        let constants = self.nodes.iter().filter_map(Node::constant);
        let initializers = self.initializers.iter().map(|tensor| (tensor.name.as_str(), tensor));
        initializers.chain(constants).collect()
    }

    /// The names of the input and the output, if there is one of each.
    ///
    /// # Errors
    /// A sentence with the names of all of them.
    pub(super) fn ends(&self) -> Result<Ends<'_>, String> {
        let tensors = self.tensors();
        let inputs = self.inputs.iter().map(|input| input.name.as_str());
        let inputs: Vec<&str> = inputs.filter(|name| !tensors.contains_key(name)).collect();
        let outputs: Vec<&str> = self.outputs.iter().map(|output| output.name.as_str()).collect();
        match (inputs.as_slice(), outputs.as_slice()) {
            ([input], [output]) => Ok(Ends { input, output }),
            _ => Err(format!(
                "inputs `{}` and outputs `{}`; a policy has one of each",
                inputs.join(", "),
                outputs.join(", ")
            )),
        }
    }
}

impl Node {
    /// Name and tensor of a constant.
    fn constant(&self) -> Option<(&str, &Tensor)> {
        let name = self.outputs.first().filter(|_| self.operation == "Constant")?;
        let tensor = self.attributes.iter().find_map(|attribute| attribute.tensor.as_ref())?;
        Some((name, tensor))
    }

    /// The value that the operation gives.
    ///
    /// # Errors
    /// A sentence if it gives none, or several.
    pub(super) fn output(&self) -> Result<&str, String> {
        match self.outputs.as_slice() {
            [output] => Ok(output),
            several => Err(format!("a `{}` with {} outputs", self.operation, several.len())),
        }
    }

    /// Whether the operation is one of ONNX itself.
    pub(super) fn is_standard(&self) -> bool {
        self.domain.is_empty() || self.domain == "ai.onnx"
    }

    /// The float attribute `name`, 1 if it is not given, as in `Gemm`.
    pub(super) fn factor(&self, name: &str) -> f32 {
        self.attribute(name).map_or(1.0, |attribute| attribute.float)
    }

    /// The integer attribute `name`, 0 if it is not given.
    pub(super) fn integer(&self, name: &str) -> i64 {
        self.attribute(name).map_or(0, |attribute| attribute.integer)
    }

    fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|attribute| attribute.name == name)
    }
}

impl Tensor {
    /// The numbers in their shape.
    ///
    /// # Errors
    /// A sentence about numbers that are elsewhere, do not fill the shape, or are no f32 if `cast`
    /// does not allow it.
    pub(super) fn numbers(&self, cast: Cast) -> Result<Shaped, String> {
        if self.location != 0 {
            return Err(
                "its numbers are in another file; export with external_data=False".to_owned()
            );
        }
        let kind = Kind::of_onnx(self.data_type);
        let FloatReader { size, number } = kind.reader(cast)?;
        let numbers: Vec<f32> = match kind {
            Kind::F32 if self.raw.is_empty() => self.floats.clone(),
            _ => self.raw.chunks_exact(size).map(number).collect(),
        };
        let shape: Option<Vec<usize>> =
            self.lengths.iter().map(|&length| usize::try_from(length).ok()).collect();
        let count = |shape: &Vec<usize>| shape.iter().try_fold(1, |n: usize, &l| n.checked_mul(l));
        match shape {
            Some(shape) if count(&shape) == Some(numbers.len()) => Ok(Shaped { shape, numbers }),
            _ => Err(format!("{} numbers do not fill the shape {:?}", numbers.len(), self.lengths)),
        }
    }
}
