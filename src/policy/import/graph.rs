//! From an ONNX graph to a network: its operations followed from the input to the output.

use std::collections::HashMap;

use super::kind::Cast;
use super::layers::MOST_LAYERS;
use super::onnx::{Ends, Graph, Node, Shaped, Tensor};
use crate::policy::{Activation, Layer, Mlp};

/// A step from the input to the output.
enum Step {
    /// A dense layer.
    Dense(Dense),
    /// An activation.
    Activation(Activation),
}

/// A dense layer on the way to its bias.
struct Dense {
    /// Name of its weight.
    name: String,
    /// `[outputs, inputs]`.
    weight: Vec<f32>,
    bias: Option<Vec<f32>>,
    outputs: usize,
}

/// The network of a graph.
pub(super) struct GraphNetwork {
    pub(super) network: Mlp,
    /// Names of the weights of its layers.
    pub(super) layers: Vec<String>,
}

/// The network of an ONNX file.
///
/// # Errors
/// A sentence about damage, or the operation that no dense network has.
pub(super) fn read(bytes: &[u8], cast: Cast) -> Result<GraphNetwork, String> {
    let graph = Graph::decode(bytes)?;
    let Ends { input, output } = graph.ends()?;
    let walk = Walk { tensors: graph.tensors(), users: users(&graph), cast };
    let mut steps = Vec::new();
    let mut at = input;
    // Each turn passes an operation, so one more turn than operations is a circle.
    for _ in 0..=graph.nodes.len() {
        if at == output && !walk.users.contains_key(at) {
            return network(steps);
        }
        at = walk.step(at, &mut steps)?;
        if steps.len() > 2 * MOST_LAYERS {
            return Err(format!("more than {MOST_LAYERS} layers"));
        }
    }
    Err(format!("the operations after `{at}` go in a circle"))
}

/// The operations that take each value.
fn users(graph: &Graph) -> HashMap<&str, Vec<&Node>> {
    let mut users: HashMap<&str, Vec<&Node>> = HashMap::new();
    for node in &graph.nodes {
        for name in &node.inputs {
            users.entry(name).or_default().push(node);
        }
    }
    users
}

/// A graph to be walked through.
struct Walk<'a> {
    tensors: HashMap<&'a str, &'a Tensor>,
    users: HashMap<&'a str, Vec<&'a Node>>,
    cast: Cast,
}

impl<'a> Walk<'a> {
    /// The operations that take the value `name`.
    fn users(&self, name: &str) -> &[&'a Node] {
        self.users.get(name).map_or(&[], Vec::as_slice)
    }

    /// Adds what is done with the value `at` to `steps`; the value that comes of it.
    fn step(&self, at: &str, steps: &mut Vec<Step>) -> Result<&'a str, String> {
        match *self.users(at) {
            [] => Err(format!("`{at}` is not the output and leads nowhere")),
            [node] => self.operation(node, at, steps),
            ref several => match self.silu(several, at) {
                Some(output) => {
                    steps.push(Step::Activation(Activation::Silu));
                    Ok(output)
                }
                None => {
                    let names: Vec<_> = several.iter().map(|n| n.operation.as_str()).collect();
                    let names = names.join(", ");
                    Err(format!("`{at}` branches into {names}; a plain network does not"))
                }
            },
        }
    }

    /// The product of `at` and its own sigmoid, if that is what the two operations are.
    fn silu(&self, pair: &[&'a Node], at: &str) -> Option<&'a str> {
        let is = |node: &Node, name: &str| node.operation == name && node.is_standard();
        let (sigmoid, product) = match *pair {
            [s, m] if is(s, "Sigmoid") && is(m, "Mul") => (s, m),
            [m, s] if is(s, "Sigmoid") && is(m, "Mul") => (s, m),
            _ => return None,
        };
        let share = sigmoid.output().ok()?;
        let factors = [product.inputs.first()?.as_str(), product.inputs.get(1)?.as_str()];
        let both = factors == [at, share] || factors == [share, at];
        let output = product.output().ok()?;
        (both && self.users(share).len() == 1).then_some(output)
    }

    /// Adds the operation `node` on the value `at` to `steps`; the value that comes of it.
    fn operation(
        &self,
        node: &'a Node,
        at: &str,
        steps: &mut Vec<Step>,
    ) -> Result<&'a str, String> {
        match node.operation.as_str() {
            _ if !node.is_standard() => return Err(unknown(node)),
            "Gemm" => steps.push(Step::Dense(self.gemm(node, at)?)),
            "MatMul" => steps.push(Step::Dense(self.product(node, at, Order::InOut)?)),
            "Add" => match steps.last_mut() {
                Some(Step::Dense(dense)) if dense.bias.is_none() => {
                    let other = node.inputs.iter().find(|name| *name != at);
                    dense.bias = Some(self.bias(other.map_or("", String::as_str), dense.outputs)?);
                }
                _ => return Err("an `Add` that does not follow on a `MatMul`".to_owned()),
            },
            "Relu" => steps.push(Step::Activation(Activation::Relu)),
            "Tanh" => steps.push(Step::Activation(Activation::Tanh)),
            "Identity" => {}
            _ => return Err(unknown(node)),
        }
        node.output()
    }

    /// The layer of a `Gemm`: a product and, as its third input, a bias.
    fn gemm(&self, node: &Node, at: &str) -> Result<Dense, String> {
        let plain = node.factor("alpha") == 1.0 && node.factor("beta") == 1.0;
        if !plain || node.integer("transA") != 0 {
            return Err("a `Gemm` with alpha, beta or transA, which no dense layer has".to_owned());
        }
        let order = if node.integer("transB") == 0 { Order::InOut } else { Order::OutIn };
        let mut dense = self.product(node, at, order)?;
        if let Some(bias) = node.inputs.get(2).filter(|name| !name.is_empty()) {
            dense.bias = Some(self.bias(bias, dense.outputs)?);
        }
        Ok(dense)
    }

    /// The layer of a product of `at` and a tensor, without its bias.
    fn product(&self, node: &Node, at: &str, order: Order) -> Result<Dense, String> {
        let name = match node.inputs.as_slice() {
            [value, weight, ..] if value == at => weight,
            _ => {
                return Err(format!("a `{}` of which `{at}` is not the left side", node.operation));
            }
        };
        let Shaped { shape, numbers } = self.numbers(name)?;
        let &[rows, columns] = shape.as_slice() else {
            return Err(format!("`{name}` has shape {shape:?}; a weight has two dimensions"));
        };
        let (outputs, weight) = match order {
            Order::OutIn => (rows, numbers),
            Order::InOut => {
                let row = |row| numbers[row..].iter().step_by(columns);
                (columns, (0..columns).flat_map(row).copied().collect())
            }
        };
        Ok(Dense { name: name.clone(), weight, bias: None, outputs })
    }

    /// The bias `name` of a layer with so many outputs.
    fn bias(&self, name: &str, outputs: usize) -> Result<Vec<f32>, String> {
        let Shaped { shape, numbers } = self.numbers(name)?;
        match shape == [outputs] || shape == [1, outputs] {
            true => Ok(numbers),
            false => Err(format!("`{name}` has shape {shape:?}, its layer {outputs} outputs")),
        }
    }

    /// The numbers of the tensor `name`.
    fn numbers(&self, name: &str) -> Result<Shaped, String> {
        let tensor = self.tensors.get(name);
        let tensor = tensor.ok_or_else(|| format!("`{name}` is no tensor that the file holds"))?;
        tensor.numbers(self.cast).map_err(|problem| format!("`{name}`: {problem}"))
    }
}

/// How a weight lies in its tensor.
#[derive(Clone, Copy)]
enum Order {
    /// `[outputs, inputs]`.
    OutIn,
    /// `[inputs, outputs]`.
    InOut,
}

/// The refusal of an operation.
fn unknown(node: &Node) -> String {
    format!(
        "operation `{}`; a dense network has Gemm, MatMul and Add, Relu, Tanh, Sigmoid and Mul \
         (SiLU), Identity",
        node.operation
    )
}

/// The network of these steps: layers with the same activation between all of them.
fn network(mut steps: Vec<Step>) -> Result<GraphNetwork, String> {
    let output = match steps.pop() {
        Some(Step::Activation(Activation::Tanh)) => Activation::Tanh,
        Some(last @ Step::Dense(_)) => {
            steps.push(last);
            Activation::Identity
        }
        Some(Step::Activation(other)) => {
            return Err(format!("ends in {}; a policy ends in tanh or a layer", other.name()));
        }
        None => return Err("no operation between input and output".to_owned()),
    };
    let (mut layers, mut names, mut hidden) = (Vec::new(), Vec::new(), None);
    for (i, step) in steps.into_iter().enumerate() {
        match step {
            Step::Dense(dense) if i % 2 == 0 => {
                let Dense { name, weight, bias, outputs, .. } = dense;
                let bias = bias.unwrap_or_else(|| vec![0.0; outputs]);
                layers.push(Layer::dense(weight, bias));
                names.push(name);
            }
            Step::Activation(activation) if i % 2 == 1 => {
                let first = *hidden.get_or_insert(activation);
                if first != activation {
                    let (first, other) = (first.name(), activation.name());
                    return Err(format!(
                        "both {first} and {other} between layers; one is supported"
                    ));
                }
            }
            _ => return Err("layers and activations do not take turns".to_owned()),
        }
    }
    let network = Mlp::new(layers, hidden.unwrap_or(Activation::Relu), output);
    Ok(GraphNetwork { network: network.map_err(|e| e.to_string())?, layers: names })
}
