//! Prints a recorded graph as a WGSL function.

mod lost;

use std::sync::Arc;

use self::lost::Flags;
use super::{Call, Graph, Node};

/// The functions that printed formulas call: choices that hand a NaN on.
pub const CHOICES: &str = include_str!("../../shaders/choices.wgsl");

/// How sums, products, quotients and roots are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    /// As operators: a driver may contract products, reorder sums, and miss quotients and roots by a few
    /// units of the last place.
    Plain,
    /// Products as calls of `product`, which keeps them from being contracted.
    Apart,
    /// All four as calls of `sum`, `product`, `quotient` and `root`, which round as the host does.
    Exact,
}

/// The WGSL function `name`, one `let` per operation of the expanded graph ([`Graph::expanded`]),
/// its arithmetic printed plainly. It calls what [`CHOICES`] holds.
///
/// `arguments` are names and lengths of the array arguments, whose elements are the graph's
/// inputs in order; an argument of length 1 is a plain f32. The result is an f32, or an array of
/// them where there are several outputs.
///
/// ```
/// use reachcast::formula::{record, wgsl::function};
/// let graph = record(3, |x| vec![x[0] * x[2]]);
/// let text = function("scaled", &[("x", 2), ("by", 1)], &graph);
/// assert!(text.starts_with("fn scaled(x: array<f32, 2>, by: f32) -> f32 {"));
/// ```
///
/// # Panics
/// If the arguments do not add up to the graph's inputs.
pub fn function(name: &str, arguments: &[(&str, usize)], graph: &Graph) -> String {
    function_with(name, arguments, graph, Arithmetic::Plain)
}

/// Like [`function`], with arithmetic as `arithmetic` says.
///
/// # Panics
/// As [`function`] does.
pub fn function_with(
    name: &str,
    arguments: &[(&str, usize)],
    graph: &Graph,
    arithmetic: Arithmetic,
) -> String {
    printed(name, arguments, &graph.expanded(), arithmetic, None)
}

/// Like [`function`], with every NaN kept, whatever a driver makes of `a - a` or `0 * a`: flags follow
/// those that the formula gives birth to, and the result is marked by them.
///
/// # Panics
/// As [`function`] does.
pub fn careful_function(name: &str, arguments: &[(&str, usize)], graph: &Graph) -> String {
    let graph = graph.expanded();
    printed(name, arguments, &graph, Arithmetic::Plain, Flags::of(&graph.nodes))
}

/// The function of an expanded graph, with flags where there are any.
fn printed(
    name: &str,
    arguments: &[(&str, usize)],
    graph: &Graph,
    arithmetic: Arithmetic,
    mut flags: Option<Flags<'_>>,
) -> String {
    let inputs: Vec<String> = arguments
        .iter()
        .flat_map(|&(name, length)| {
            (0..length).map(move |i| if length == 1 { name.into() } else { format!("{name}[{i}]") })
        })
        .collect();
    assert_eq!(inputs.len(), graph.inputs, "arguments of the WGSL function `{name}`");
    let parameters: Vec<String> =
        arguments.iter().map(|(name, length)| format!("{name}: {}", float_type(*length))).collect();
    let result = float_type(graph.outputs.len());
    let mut text = format!("fn {name}({}) -> {result} {{\n", parameters.join(", "));
    let digests = digests(&graph.calls);
    for (i, node) in graph.nodes.iter().enumerate() {
        text += &match *node {
            Node::Literal(bits) => literal(i, f32::from_bits(bits)),
            Node::Said(call, output) => {
                let call = call as usize;
                said(i, &graph.calls[call], &digests[call], output)
            }
            Node::SelectLt(a, b, yes, no) => {
                let less = flags.as_ref().map_or(format!("v{a} < v{b}"), |flags| flags.less(a, b));
                format!("    let v{i} = select(v{no}, v{yes}, {less});\n")
            }
            node => format!("    let v{i} = {};\n", operation(node, &inputs, arithmetic)),
        };
        text += &flags.as_mut().map_or(String::new(), Flags::next);
    }
    let output = |i: &u32| match flags.as_ref().and_then(|flags| flags.name(*i)) {
        Some(flag) => format!("marked(v{i}, {flag})"),
        None => format!("v{i}"),
    };
    let outputs: Vec<String> = graph.outputs.iter().map(output).collect();
    let outputs = outputs.join(", ");
    let value = if graph.outputs.len() == 1 { outputs } else { format!("{result}({outputs})") };
    text + &format!("    return {value};\n}}\n")
}

/// `f32` or an array of them.
fn float_type(length: usize) -> String {
    if length == 1 { "f32".to_owned() } else { format!("array<f32, {length}>") }
}

/// The right-hand side of a primitive other than a literal.
fn operation(node: Node, inputs: &[String], arithmetic: Arithmetic) -> String {
    use Arithmetic::{Exact, Plain};
    match node {
        Node::Add(a, b) if arithmetic == Exact => format!("sum(v{a}, v{b})"),
        Node::Sub(a, b) if arithmetic == Exact => format!("sum(v{a}, -v{b})"),
        Node::Mul(a, b) if arithmetic != Plain => format!("product(v{a}, v{b})"),
        Node::Div(a, b) if arithmetic == Exact => format!("quotient(v{a}, v{b})"),
        Node::Sqrt(a) if arithmetic == Exact => format!("root(v{a})"),
        Node::Input(i) => inputs[i as usize].clone(),
        Node::Add(a, b) => format!("v{a} + v{b}"),
        Node::Sub(a, b) => format!("v{a} - v{b}"),
        Node::Mul(a, b) => format!("v{a} * v{b}"),
        Node::Div(a, b) => format!("v{a} / v{b}"),
        Node::Neg(a) => format!("-v{a}"),
        Node::Abs(a) => format!("abs(v{a})"),
        Node::Sqrt(a) => format!("sqrt(v{a})"),
        Node::Floor(a) => format!("floor(v{a})"),
        Node::Sign(a) => format!("sign_of(v{a})"),
        Node::Min(a, b) => format!("lesser(v{a}, v{b})"),
        Node::Max(a, b) => format!("greater(v{a}, v{b})"),
        Node::Clamp(a, low, high) => format!("held(v{a}, v{low}, v{high})"),
        Node::IfLt(a, b, yes, no) => format!("choose(v{a}, v{b}, v{yes}, v{no})"),
        other => unreachable!("an expanded graph has no {other:?}"),
    }
}

/// The statement of an output of a network, which WGSL has no operation for: its text tells plants
/// apart, and no kernel is made of it. The network is named by its digest.
fn said(i: usize, call: &Call, digest: &str, output: u32) -> String {
    let arguments: Vec<String> = call.arguments.iter().map(|at| format!("v{at}")).collect();
    let arguments = arguments.join(", ");
    format!("    let v{i} = network_{digest}({arguments})[{output}];\n")
}

/// The digest of the network of each call, computed once for each network.
fn digests(calls: &[Call]) -> Vec<String> {
    let mut digests: Vec<String> = Vec::with_capacity(calls.len());
    for (i, call) in calls.iter().enumerate() {
        let known = calls[..i].iter().position(|one| Arc::ptr_eq(&one.network, &call.network));
        digests.push(known.map_or_else(|| call.network.digest(), |one| digests[one].clone()));
    }
    digests
}

/// The statements of literal number `i`: the shortest decimal that is read back as the same f32. What
/// is not finite has none, and no constant expression may come to it, so its bits go through a
/// variable.
fn literal(i: usize, value: f32) -> String {
    if value.is_finite() {
        return format!("    let v{i} = {value:?}f;\n");
    }
    let bits = value.to_bits();
    format!("    var b{i} = {bits}u;\n    let v{i} = bitcast<f32>(b{i});\n")
}
