//! Policies written as ONNX graphs, which are read back as the same policies.

use prost::Message;

use super::onnx::{
    Attribute, Entry, Graph, Length, Model, Named, Node, Operators, Shape, Tensor, TensorType, Type,
};
use super::{Activation, Layer, Mlp, Rescale};

/// Who wrote a graph.
pub(super) const PRODUCER: &str = "reachcast";
/// Entries of a graph: the names of its inputs, and the activation of hidden layers.
pub(super) const STATE_ORDER: &str = "state_order";
pub(super) const HIDDEN: &str = "activation";
/// The version of the format, and of the operators: the first with all activations.
const VERSIONS: [i64; 2] = [9, 20];
/// The number of f32, and those of the kinds of attributes.
const F32: i32 = 1;
const FLOAT: i32 = 1;
const INTEGER: i32 = 2;
const TEXT: i32 = 3;

/// The bytes of an ONNX file of `network`, from `input`, `[batch, inputs]`, to `output`, `[batch, outputs]`.
pub fn onnx_bytes(network: &Mlp) -> Vec<u8> {
    let widths = network.widths();
    let mut writer = Writer {
        graph: Graph { name: "policy".to_owned(), ..Graph::default() },
        last: "input".to_owned(),
    };
    if let Some(map) = network.input_map() {
        writer.map("input_map", map);
    }
    for (i, layer) in network.layers().iter().enumerate() {
        writer.layer(&format!("layers.{i}"), layer);
    }
    if let Some(map) = network.output_map() {
        writer.map("output_map", map);
    }
    // The name of the output is one of its own.
    let last = writer.last.clone();
    writer.node("Identity", &[&last], "output", Vec::new());
    let mut graph = writer.graph;
    graph.inputs = vec![value("input", widths[0])];
    graph.outputs = vec![value("output", widths[widths.len() - 1])];
    let order = network.state_order().map(|names| (STATE_ORDER, names.join(",")));
    // A network of one layer has a word for hidden layers, and none of them in the graph.
    let hidden = network.activation().map(|hidden| (HIDDEN, hidden.name()));
    let entries = order.into_iter().chain(hidden);
    let entries = entries.map(|(key, value)| Entry { key: key.to_owned(), value });
    let model = Model {
        version: VERSIONS[0],
        producer: PRODUCER.to_owned(),
        graph: Some(graph),
        operators: vec![Operators { version: VERSIONS[1] }],
        entries: entries.collect(),
    };
    model.encode_to_vec()
}

/// A graph that grows at its end.
struct Writer {
    graph: Graph,
    /// Name of what it gives so far.
    last: String,
}

impl Writer {
    /// Adds an operation that gives `output`.
    fn node(&mut self, operation: &str, inputs: &[&str], output: &str, attributes: Vec<Attribute>) {
        self.graph.nodes.push(Node {
            inputs: inputs.iter().map(|&name| name.to_owned()).collect(),
            outputs: vec![output.to_owned()],
            operation: operation.to_owned(),
            attributes,
            ..Node::default()
        });
        self.last = output.to_owned();
    }

    /// The same of what the graph gives so far, and tensors.
    fn then(
        &mut self,
        operation: &str,
        tensors: &[&str],
        output: &str,
        attributes: Vec<Attribute>,
    ) {
        let last = self.last.clone();
        let inputs: Vec<&str> =
            std::iter::once(last.as_str()).chain(tensors.iter().copied()).collect();
        self.node(operation, &inputs, output, attributes);
    }

    /// Adds a tensor; its name.
    fn tensor(&mut self, name: String, shape: &[usize], numbers: &[f32]) -> String {
        self.graph.initializers.push(Tensor {
            lengths: shape.iter().map(|&length| length as i64).collect(),
            data_type: F32,
            name: name.clone(),
            raw: numbers.iter().flat_map(|number| number.to_le_bytes()).collect(),
            ..Tensor::default()
        });
        name
    }

    /// Adds a map called `name`; what does nothing is left out.
    fn map(&mut self, name: &str, map: &Rescale) {
        let parts = [
            ("Sub", "center", &map.center, 0.0),
            ("Mul", "scale", &map.scale, 1.0),
            ("Add", "shift", &map.shift, 0.0),
            ("Max", "low", &map.low, f32::NEG_INFINITY),
            ("Min", "high", &map.high, f32::INFINITY),
        ];
        for (operation, part, numbers, nothing) in parts {
            if numbers.iter().any(|&number| number != nothing) {
                let tensor = self.tensor(format!("{name}.{part}"), &[numbers.len()], numbers);
                self.then(operation, &[&tensor], &format!("{name}.{part}.out"), Vec::new());
            }
        }
    }

    /// Adds a layer called `name`.
    fn layer(&mut self, name: &str, layer: &Layer) {
        let Layer { weight, bias, inputs, outputs, norm, activation } = layer;
        let weight = self.tensor(format!("{name}.weight"), &[*outputs, *inputs], weight);
        let bias = self.tensor(format!("{name}.bias"), &[*outputs], bias);
        self.then("Gemm", &[&weight, &bias], &format!("{name}.sum"), vec![integer("transB", 1)]);
        if let Some(norm) = norm {
            let scale = self.tensor(format!("{name}.norm.weight"), &[*outputs], &norm.scale);
            let shift = self.tensor(format!("{name}.norm.bias"), &[*outputs], &norm.shift);
            let epsilon = vec![float("epsilon", norm.epsilon)];
            self.then("LayerNormalization", &[&scale, &shift], &format!("{name}.normed"), epsilon);
        }
        self.activation(name, *activation);
    }

    /// Adds the activation of the layer `name`.
    fn activation(&mut self, name: &str, activation: Activation) {
        let out = format!("{name}.out");
        let mut plain = |operation: &str, attributes| self.then(operation, &[], &out, attributes);
        match activation {
            Activation::Identity => {}
            Activation::Relu => plain("Relu", vec![]),
            Activation::LeakyRelu { slope } => plain("LeakyRelu", vec![float("alpha", slope)]),
            Activation::Elu { alpha } => plain("Elu", vec![float("alpha", alpha)]),
            Activation::Selu => plain("Selu", vec![]),
            Activation::Celu { alpha } => plain("Celu", vec![float("alpha", alpha)]),
            Activation::Gelu => plain("Gelu", vec![text("approximate", "none")]),
            Activation::GeluTanh => plain("Gelu", vec![text("approximate", "tanh")]),
            Activation::Mish => plain("Mish", vec![]),
            Activation::Tanh => plain("Tanh", vec![]),
            Activation::Sigmoid => plain("Sigmoid", vec![]),
            Activation::Softsign => plain("Softsign", vec![]),
            Activation::Silu => {
                let sum = self.last.clone();
                self.then("Sigmoid", &[], &format!("{name}.share"), vec![]);
                let share = self.last.clone();
                self.node("Mul", &[&sum, &share], &out, vec![]);
            }
            Activation::Softplus { beta } => self.softplus(name, &out, beta),
            Activation::Hardtanh { low, high } => self.clip(name, &out, [low, high]),
            Activation::Relu6 => self.clip(name, &out, [0.0, 6.0]),
        }
    }

    /// Adds a softplus, which ONNX has without a factor.
    fn softplus(&mut self, name: &str, out: &str, beta: f32) {
        if beta == 1.0 {
            return self.then("Softplus", &[], out, vec![]);
        }
        let beta = self.tensor(format!("{name}.beta"), &[], &[beta]);
        self.then("Mul", &[&beta], &format!("{name}.stretched"), vec![]);
        self.then("Softplus", &[], &format!("{name}.softplus"), vec![]);
        self.then("Div", &[&beta], out, vec![]);
    }

    /// Adds a clip.
    fn clip(&mut self, name: &str, out: &str, [low, high]: [f32; 2]) {
        let low = self.tensor(format!("{name}.low"), &[], &[low]);
        let high = self.tensor(format!("{name}.high"), &[], &[high]);
        self.then("Clip", &[&low, &high], out, vec![]);
    }
}

/// A value `[batch, width]`.
fn value(name: &str, width: usize) -> Named {
    let batch = Length { name: "batch".to_owned(), ..Length::default() };
    let lengths = vec![batch, Length { value: width as i64, ..Length::default() }];
    let tensor = Some(TensorType { element: F32, shape: Some(Shape { lengths }) });
    Named { name: name.to_owned(), kind: Some(Type { tensor }) }
}

fn float(name: &str, float: f32) -> Attribute {
    Attribute { name: name.to_owned(), float: Some(float), kind: FLOAT, ..Attribute::default() }
}

fn integer(name: &str, integer: i64) -> Attribute {
    Attribute { name: name.to_owned(), integer, kind: INTEGER, ..Attribute::default() }
}

fn text(name: &str, text: &str) -> Attribute {
    Attribute {
        name: name.to_owned(),
        text: text.as_bytes().to_vec(),
        kind: TEXT,
        ..Attribute::default()
    }
}
