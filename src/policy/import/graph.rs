//! From an ONNX graph to a network: the operations that its output needs, one after the other.

use std::collections::{HashMap, HashSet};

use super::constants::folded;
use super::draft::Draft;
use super::kind::Cast;
use super::onnx::{Written, decode};
use super::operations::{self, OPERATIONS};
use super::request::{Imported, Origin};
use super::walk::{Problem, Value, Walk};
use crate::policy::Activation;
use crate::policy::export::{HIDDEN, STATE_ORDER};
use crate::policy::onnx::{Graph, Node};

/// Most operations.
const MOST_NODES: usize = 4096;
/// Most numbers of all constants that operations make of others.
const MOST_MADE: usize = 1 << 24;
/// Numbers that are kept for a value, about.
const VALUE: usize = 256;

/// A graph on the way to a network.
struct Run<'g> {
    walk: Walk,
    values: HashMap<&'g str, Value>,
    /// Numbers of constants that were made of others.
    made: usize,
    cast: Cast,
}

/// The network of an ONNX file: of the output `asked`, or of the only one.
///
/// # Errors
/// A sentence about damage, or the operation that no dense network has.
pub(super) fn read(bytes: &[u8], asked: &[String], cast: Cast) -> Result<Imported, String> {
    let written = decode(bytes)?;
    let graph = &written.graph;
    if graph.nodes.len() > MOST_NODES {
        return Err(format!("{} operations; at most {MOST_NODES} are read", graph.nodes.len()));
    }
    graph.distinct()?;
    let output = output(graph, asked)?;
    let needed = needed(graph, output);
    let input = graph.input()?;
    let walk = Walk::of(draft(&written, input.form.width())?);
    let values = HashMap::from([(input.name, walk.number(input.form))]);
    let mut run = Run { walk, values, made: 0, cast };
    for (name, tensor) in graph.tensors().filter(|(name, _)| needed.names.contains(name)) {
        let array = tensor.array(cast).map_err(|problem| format!("`{name}`: {problem}"))?;
        run.values.insert(name, Value::Constant(array));
    }
    for node in needed.nodes {
        run.node(node).map_err(|problem| told(graph, &place(node), problem))?;
    }
    let last = run.value(output).map_err(|problem| told(graph, "the output", problem))?;
    let last = match last {
        Some(Value::Number(last)) => last,
        Some(Value::Above(..)) => return Err(format!("the output `{output}` is true or false")),
        _ => return Err(format!("the output `{output}` does not depend on the input")),
    };
    let Run { mut walk, .. } = run;
    if !last.form.is_in_order() {
        return Err(format!(
            "the output is {}: transposed, it does not count inputs first",
            last.form
        ));
    }
    walk.close(last, None).map_err(|problem| told(graph, "the output", problem))?;
    let floats =
        graph.tensors().filter(|(name, tensor)| !needed.names.contains(name) && tensor.is_float());
    let others = graph.outputs().into_iter().filter(|name| *name != output);
    let mut network = walk.draft.network()?;
    if let Some(names) = written.entry(STATE_ORDER) {
        let names = names.split(',').map(str::to_owned).collect();
        network = network.with_state_order(names).map_err(|error| error.to_string())?;
    }
    Ok(Imported {
        network,
        layers: walk.layers,
        left_out: floats.map(|(name, _)| name).chain(others).map(str::to_owned).collect(),
        layout: None,
        notes: Vec::new(),
        activation_from: Origin::File,
        output_from: Origin::File,
    })
}

/// The network without a step; that of a policy that was exported stays as it was.
fn draft(written: &Written, inputs: Option<usize>) -> Result<Draft, String> {
    if !written.is_own() {
        return Ok(Draft::of(inputs));
    }
    let hidden = written.entry(HIDDEN).map(str::parse::<Activation>).transpose()?;
    Ok(Draft::as_is(inputs, hidden))
}

/// The output that is asked for, or the only one.
fn output<'g>(graph: &'g Graph, asked: &[String]) -> Result<&'g str, String> {
    let outputs = graph.outputs();
    let named = |name: &String| outputs.iter().copied().find(|output| output == name);
    match (outputs.as_slice(), asked) {
        ([one], []) => Ok(one),
        ([_], _) => Err("the graph holds one network; leave --network out".to_owned()),
        (several, [one]) if several.len() > 1 => {
            named(one).ok_or_else(|| format!("no output `{one}`; it has {}", several.join(", ")))
        }
        (several, _) => {
            Err(format!("outputs `{}`; a policy has one: --network names it", several.join(", ")))
        }
    }
}

/// The operations that an output needs, in the order of the file, and the values that these take.
struct Needed<'g> {
    nodes: Vec<&'g Node>,
    names: HashSet<&'g str>,
}

/// What `output` needs.
fn needed<'g>(graph: &'g Graph, output: &'g str) -> Needed<'g> {
    let mut names = HashSet::from([output]);
    let mut nodes = Vec::new();
    for node in graph.nodes.iter().rev() {
        if !node.outputs.iter().any(|name| names.contains(name.as_str())) {
            continue;
        }
        names.extend(node.inputs.iter().map(String::as_str).filter(|name| !name.is_empty()));
        nodes.push(node);
    }
    nodes.reverse();
    Needed { nodes, names }
}

/// The operation `node` in words.
fn place(node: &Node) -> String {
    match node.is_standard() {
        true => format!("operation `{}`", node.operation),
        false => format!("operation `{}` of the domain `{}`", node.operation, node.domain),
    }
}

/// A problem at `place`; of a value that was gone on from already, what goes on from it.
fn told(graph: &Graph, place: &str, problem: Problem) -> String {
    match problem {
        Problem::Stale(name) => branches(graph, &name),
        Problem::Words(problem) => format!("{place}: {problem}"),
        Problem::Foreign => {
            format!("{place}, which is not ONNX's own; export with operators of ONNX alone")
        }
        Problem::Unknown => {
            format!("{place}; what a dense network may have is {}", OPERATIONS.join(", "))
        }
    }
}

/// The refusal of a value that goes several ways.
fn branches(graph: &Graph, name: &str) -> String {
    let users = graph.nodes.iter().filter(|node| node.inputs.iter().any(|input| input == name));
    let users: Vec<&str> = users.map(|node| node.operation.as_str()).collect();
    format!(
        "`{name}` branches into {}: a skip connection, or parts side by side, which a network of layers one after \
         the other does not have. Formulas of a model may join networks: export each part by itself, and call \
         it as net('FILE', ...)[0] in the formula of the policy",
        users.join(", ")
    )
}

impl<'g> Run<'g> {
    /// The operation `node`.
    fn node(&mut self, node: &'g Node) -> Result<(), Problem> {
        if !node.is_standard() {
            return Err(Problem::Foreign);
        }
        self.check_size(node)?;
        let inputs =
            node.inputs.iter().map(|name| self.value(name)).collect::<Result<Vec<_>, _>>()?;
        let constants = inputs.iter().map(|input| match input {
            None => Some(None),
            Some(Value::Constant(array)) => Some(Some(array)),
            _ => None,
        });
        let given = match constants.collect::<Option<Vec<_>>>() {
            Some(constants) => {
                let constant = folded(node, &constants, self.cast)?;
                self.made += constant.numbers.len();
                vec![Value::Constant(constant)]
            }
            None => operations::apply(&mut self.walk, node, inputs)?,
        };
        if self.made > MOST_MADE {
            return Err(Problem::Words(format!("more than {MOST_MADE} numbers made of constants")));
        }
        for (name, value) in node.outputs.iter().zip(given) {
            self.values.insert(name, value);
        }
        Ok(())
    }

    /// Refuses an operation that takes values many times over, which a small file may ask for.
    fn check_size(&self, node: &Node) -> Result<(), Problem> {
        let size = |name: &String| match self.values.get(name.as_str()) {
            Some(Value::Constant(array)) => array.numbers.len(),
            Some(Value::Number(number)) => number.rows.as_ref().map_or(0, Vec::len) + VALUE,
            _ => VALUE,
        };
        match node.inputs.iter().map(size).sum::<usize>() > MOST_MADE {
            true => Err(Problem::Words(format!("that takes more than {MOST_MADE} numbers"))),
            false => Ok(()),
        }
    }

    /// The value `name`; nothing for an input that is left out.
    fn value(&self, name: &str) -> Result<Option<Value>, Problem> {
        match self.values.get(name) {
            _ if name.is_empty() => Ok(None),
            Some(value) if self.walk.is_stale(value) => Err(Problem::Stale(name.to_owned())),
            Some(value) => Ok(Some(value.clone())),
            None => Err(Problem::Words(format!("`{name}` is given by nothing before it"))),
        }
    }
}
