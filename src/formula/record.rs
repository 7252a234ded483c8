//! The recorder: a scalar whose operations build an expression graph.

use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::real::Real;

/// One operation of a graph; operands are indices of earlier nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// The input of that number.
    Input(u32),
    /// A literal, as the bits of its f32.
    Literal(u32),
    /// Sum.
    Add(u32, u32),
    /// Difference.
    Sub(u32, u32),
    /// Product.
    Mul(u32, u32),
    /// Quotient.
    Div(u32, u32),
    /// Negation.
    Neg(u32),
    /// Absolute value.
    Abs(u32),
    /// Square root.
    Sqrt(u32),
    /// Floor.
    Floor(u32),
    /// `if a < b { yes } else { no }`, in this order.
    IfLt(u32, u32, u32, u32),
}

impl Node {
    /// Its value for `inputs`, given the `values` of the earlier nodes.
    #[inline(always)]
    pub fn value<R: Real>(self, inputs: &[R], values: &[R]) -> R {
        let at = |i: u32| values[i as usize];
        match self {
            Self::Input(i) => inputs[i as usize],
            Self::Literal(bits) => R::lit(f32::from_bits(bits)),
            Self::Add(a, b) => at(a) + at(b),
            Self::Sub(a, b) => at(a) - at(b),
            Self::Mul(a, b) => at(a) * at(b),
            Self::Div(a, b) => at(a) / at(b),
            Self::Neg(a) => -at(a),
            Self::Abs(a) => at(a).abs(),
            Self::Sqrt(a) => at(a).sqrt(),
            Self::Floor(a) => at(a).floor(),
            Self::IfLt(a, b, yes, no) => at(a).if_lt(at(b), at(yes), at(no)),
        }
    }
}

/// A recorded formula: nodes in order of evaluation, and which of them are the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// Number of inputs.
    pub inputs: usize,
    /// The operations; each refers to earlier ones only.
    pub nodes: Vec<Node>,
    /// Indices of the outputs.
    pub outputs: Vec<u32>,
}

/// A graph under construction.
#[derive(Default)]
struct Arena {
    nodes: Vec<Node>,
    /// The index of each node.
    known: HashMap<Node, u32>,
    /// The inputs that formulas ask for by name.
    parameters: HashMap<String, Expr>,
}

thread_local! {
    /// The graph under construction.
    static ARENA: RefCell<Arena> = RefCell::default();
}

/// A number of the recording in progress on this thread.
#[derive(Clone, Copy, Debug)]
pub struct Expr(u32);

impl Expr {
    fn new(node: Node) -> Self {
        ARENA.with_borrow_mut(|Arena { nodes, known, .. }| {
            let next = nodes.len() as u32;
            let index = *known.entry(node).or_insert(next);
            if index == next {
                nodes.push(node);
            }
            Self(index)
        })
    }
}

/// Records `formula` on `inputs` inputs.
///
/// Equal operations become one node; nodes that no output needs are left out.
///
/// ```
/// use reachcast::formula::record;
/// use reachcast::real::Real;
/// let graph = record(2, |x| vec![x[0] * x[1] + x[0] * x[1]]);
/// assert_eq!(graph.nodes.len(), 4); // two inputs, one product, one sum
/// assert_eq!(graph.eval(&[3.0_f32, 4.0]), [24.0]);
/// ```
pub fn record(inputs: usize, formula: impl FnOnce(&[Expr]) -> Vec<Expr>) -> Graph {
    record_with(inputs, &[], formula)
}

/// Records `formula` on `inputs` inputs, some of which it may ask for by name
/// ([`Real::parameter`]): `parameters` has their names and places.
pub fn record_with(
    inputs: usize,
    parameters: &[(&str, usize)],
    formula: impl FnOnce(&[Expr]) -> Vec<Expr>,
) -> Graph {
    let outer = ARENA.take();
    let arguments: Vec<Expr> = (0..inputs).map(|i| Expr::new(Node::Input(i as u32))).collect();
    let named = parameters.iter().map(|(name, place)| ((*name).to_owned(), arguments[*place]));
    ARENA.with_borrow_mut(|arena| arena.parameters = named.collect());
    let outputs = formula(&arguments);
    let recorded = ARENA.replace(outer);
    prune(inputs, &recorded.nodes, &outputs)
}

/// Keeps the nodes that the outputs need, in order.
fn prune(inputs: usize, nodes: &[Node], outputs: &[Expr]) -> Graph {
    let mut needed = vec![false; nodes.len()];
    for output in outputs {
        needed[output.0 as usize] = true;
    }
    for i in (0..nodes.len()).rev() {
        if needed[i] {
            nodes[i].operands(|operand| needed[operand as usize] = true);
        }
    }
    let mut place = vec![0; nodes.len()];
    let mut kept = Vec::new();
    for (i, node) in nodes.iter().enumerate().filter(|(i, _)| needed[*i]) {
        place[i] = kept.len() as u32;
        kept.push(node.renumbered(|operand| place[operand as usize]));
    }
    let outputs = outputs.iter().map(|output| place[output.0 as usize]).collect();
    Graph { inputs, nodes: kept, outputs }
}

impl Node {
    /// Calls `see` with each operand.
    fn operands(self, mut see: impl FnMut(u32)) {
        self.renumbered(|operand| {
            see(operand);
            operand
        });
    }

    /// The node with its operands replaced.
    fn renumbered(self, mut new: impl FnMut(u32) -> u32) -> Self {
        match self {
            Self::Input(_) | Self::Literal(_) => self,
            Self::Add(a, b) => Self::Add(new(a), new(b)),
            Self::Sub(a, b) => Self::Sub(new(a), new(b)),
            Self::Mul(a, b) => Self::Mul(new(a), new(b)),
            Self::Div(a, b) => Self::Div(new(a), new(b)),
            Self::Neg(a) => Self::Neg(new(a)),
            Self::Abs(a) => Self::Abs(new(a)),
            Self::Sqrt(a) => Self::Sqrt(new(a)),
            Self::Floor(a) => Self::Floor(new(a)),
            Self::IfLt(a, b, yes, no) => Self::IfLt(new(a), new(b), new(yes), new(no)),
        }
    }
}

impl Graph {
    /// The outputs for `inputs`, in any instance of [`Real`].
    ///
    /// # Panics
    /// If the number of inputs is not the graph's.
    pub fn eval<R: Real>(&self, inputs: &[R]) -> Vec<R> {
        let mut values: Vec<R> = Vec::with_capacity(self.nodes.len());
        self.replay(inputs, &mut values);
        self.outputs.iter().map(|&i| values[i as usize]).collect()
    }

    /// The first output for `inputs`; `values` is room that calls may share.
    ///
    /// # Panics
    /// If the number of inputs is not the graph's, or there is no output.
    pub fn eval_first<R: Real>(&self, inputs: &[R], values: &mut Vec<R>) -> R {
        self.replay(inputs, values);
        values[self.outputs[0] as usize]
    }

    /// The values of all nodes for `inputs`.
    fn replay<R: Real>(&self, inputs: &[R], values: &mut Vec<R>) {
        assert_eq!(inputs.len(), self.inputs, "inputs of the graph");
        values.clear();
        for node in &self.nodes {
            let value = node.value(inputs, values);
            values.push(value);
        }
    }
}

impl Add for Expr {
    type Output = Self;
    fn add(self, rhs: Self) -> Self {
        Self::new(Node::Add(self.0, rhs.0))
    }
}

impl Sub for Expr {
    type Output = Self;
    fn sub(self, rhs: Self) -> Self {
        Self::new(Node::Sub(self.0, rhs.0))
    }
}

impl Mul for Expr {
    type Output = Self;
    fn mul(self, rhs: Self) -> Self {
        Self::new(Node::Mul(self.0, rhs.0))
    }
}

impl Div for Expr {
    type Output = Self;
    fn div(self, rhs: Self) -> Self {
        Self::new(Node::Div(self.0, rhs.0))
    }
}

impl Neg for Expr {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(Node::Neg(self.0))
    }
}

impl Real for Expr {
    fn lit(value: f32) -> Self {
        Self::new(Node::Literal(value.to_bits()))
    }
    fn parameter(name: &str, value: f32) -> Self {
        let named = ARENA.with_borrow(|arena| arena.parameters.get(name).copied());
        named.unwrap_or_else(|| Self::lit(value))
    }
    fn abs(self) -> Self {
        Self::new(Node::Abs(self.0))
    }
    fn sqrt(self) -> Self {
        Self::new(Node::Sqrt(self.0))
    }
    fn floor(self) -> Self {
        Self::new(Node::Floor(self.0))
    }
    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        Self::new(Node::IfLt(self.0, rhs.0, yes.0, no.0))
    }
}
