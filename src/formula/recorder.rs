//! The recorder: a scalar whose operations build an expression graph.

use std::cell::RefCell;
use std::collections::HashMap;

use std::sync::Arc;

use super::call::{Call, Scalar};
use super::node::{Function, Node};
use crate::policy::Mlp;
use crate::real::Real;

/// A recorded formula: nodes in order of evaluation, and which of them are the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// Number of inputs.
    pub inputs: usize,
    /// The operations; each refers to earlier ones only.
    pub nodes: Vec<Node>,
    /// Indices of the outputs.
    pub outputs: Vec<u32>,
    /// The networks that it calls; the arguments of each come before its outputs.
    pub calls: Vec<Call>,
}

/// A graph under construction.
#[derive(Default)]
struct Arena {
    nodes: Vec<Node>,
    /// The index of each node.
    known: HashMap<Node, u32>,
    /// The inputs that formulas ask for by name.
    parameters: HashMap<String, Expr>,
    calls: Vec<Call>,
}

thread_local! {
    /// The graph under construction.
    static ARENA: RefCell<Arena> = RefCell::default();
}

/// Adds a node to the recording in progress on this thread, if it is not there yet.
pub(super) fn push(node: Node) -> u32 {
    ARENA.with_borrow_mut(|Arena { nodes, known, .. }| {
        let next = nodes.len() as u32;
        let index = *known.entry(node).or_insert(next);
        if index == next {
            nodes.push(node);
        }
        index
    })
}

/// The outputs of `network` at `arguments` as nodes of the recording in progress on this thread: those
/// of an equal call, if there was one.
pub(super) fn push_call(network: &Arc<Mlp>, arguments: &[u32]) -> Vec<u32> {
    let call = ARENA.with_borrow_mut(|Arena { calls, .. }| {
        let known = calls.iter().position(|call| call.is(network, arguments));
        known.unwrap_or_else(|| {
            calls.push(Call { network: Arc::clone(network), arguments: arguments.to_vec() });
            calls.len() - 1
        })
    });
    let outputs = network.widths().last().copied().unwrap_or(0);
    (0..outputs).map(|output| push(Node::Said(call as u32, output as u32))).collect()
}

/// A number of the recording in progress on this thread; its functions stay whole.
#[derive(Clone, Copy, Debug)]
pub struct Expr(u32);

impl Expr {
    fn new(node: Node) -> Self {
        Self(push(node))
    }

    fn apply(self, function: Function) -> Self {
        Self::new(Node::Apply(function, self.0))
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
    recorded(inputs, |places| {
        let arguments: Vec<Expr> = places.iter().map(|place| Expr(*place)).collect();
        let named = parameters.iter().map(|(name, place)| ((*name).to_owned(), arguments[*place]));
        ARENA.with_borrow_mut(|arena| arena.parameters = named.collect());
        formula(&arguments).into_iter().map(|output| output.0).collect()
    })
}

/// The graph of what `formula` pushes, from the indices of the inputs to those of the outputs.
pub(super) fn recorded(inputs: usize, formula: impl FnOnce(&[u32]) -> Vec<u32>) -> Graph {
    let outer = ARENA.take();
    let arguments: Vec<u32> = (0..inputs).map(|i| push(Node::Input(i as u32))).collect();
    let outputs = formula(&arguments);
    let recorded = ARENA.replace(outer);
    let Arena { nodes, calls, .. } = recorded;
    Graph { inputs, nodes, outputs, calls }.pruned()
}

impl Graph {
    /// The nodes and calls that the outputs need, in order.
    pub(super) fn pruned(&self) -> Self {
        let needed = self.needed();
        let mut place = vec![0; self.nodes.len()];
        let mut number = vec![None; self.calls.len()];
        let (mut nodes, mut calls) = (Vec::new(), Vec::new());
        for (i, node) in self.nodes.iter().enumerate().filter(|(i, _)| needed[*i]) {
            place[i] = nodes.len() as u32;
            nodes.push(match *node {
                Node::Said(call, output) => {
                    let known = number[call as usize].get_or_insert_with(|| {
                        calls.push(self.calls[call as usize].renumbered(&place));
                        (calls.len() - 1) as u32
                    });
                    Node::Said(*known, output)
                }
                node => node.renumbered(|operand| place[operand as usize]),
            });
        }
        let outputs = self.outputs.iter().map(|output| place[*output as usize]).collect();
        Self { inputs: self.inputs, nodes, outputs, calls }
    }

    /// Whether an output needs each node.
    fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.nodes.len()];
        self.outputs.iter().for_each(|output| needed[*output as usize] = true);
        for i in (0..self.nodes.len()).rev() {
            if needed[i] {
                self.operands(i as u32, |operand| needed[operand as usize] = true);
            }
        }
        needed
    }

    /// Calls `see` with all that a node is computed from, the arguments of a network included.
    pub(crate) fn operands(&self, node: u32, see: impl FnMut(u32)) {
        match self.nodes[node as usize] {
            Node::Said(call, _) => {
                self.calls[call as usize].arguments.iter().copied().for_each(see);
            }
            node => node.operands(see),
        }
    }

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
        self.replay_with(inputs, values, |network, arguments| network.forward(arguments));
    }

    /// The same where `call` gives the outputs of a network at its arguments.
    pub(super) fn replay_with<R: Real>(
        &self,
        inputs: &[R],
        values: &mut Vec<R>,
        call: impl Fn(&Arc<Mlp>, &[R]) -> Vec<R>,
    ) {
        assert_eq!(inputs.len(), self.inputs, "inputs of the graph");
        values.clear();
        let mut said: Vec<Option<Vec<R>>> = vec![None; self.calls.len()];
        for node in &self.nodes {
            let value = match *node {
                Node::Said(number, output) => {
                    let Call { network, arguments } = &self.calls[number as usize];
                    let said = said[number as usize].get_or_insert_with(|| {
                        let at = |i: &u32| values[*i as usize];
                        call(network, &arguments.iter().map(at).collect::<Vec<_>>())
                    });
                    said[output as usize]
                }
                node => node.value(inputs, values),
            };
            values.push(value);
        }
    }
}

/// The operators of a recorded number, and in its `impl Real` the operations that the expanded graph
/// keeps: the same nodes whatever becomes of the functions.
macro_rules! operators {
    ($number:ident) => {
        $crate::formula::recorder::operators! { $number: Add add, Sub sub, Mul mul, Div div }

        impl std::ops::Neg for $number {
            type Output = Self;
            fn neg(self) -> Self {
                Self::new(Node::Neg(self.0))
            }
        }
    };
    ($number:ident: $($trait:ident $method:ident),*) => {
        $(
            impl std::ops::$trait for $number {
                type Output = Self;
                fn $method(self, rhs: Self) -> Self {
                    Self::new(Node::$trait(self.0, rhs.0))
                }
            }
        )*
    };
}
pub(super) use operators;

/// See [`operators`].
macro_rules! primitives {
    () => {
        fn lit(value: f32) -> Self {
            Self::new(Node::Literal(value.to_bits()))
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
        fn sign(self) -> Self {
            Self::new(Node::Sign(self.0))
        }
        fn min(self, rhs: Self) -> Self {
            Self::new(Node::Min(self.0, rhs.0))
        }
        fn max(self, rhs: Self) -> Self {
            Self::new(Node::Max(self.0, rhs.0))
        }
        fn clamp(self, low: Self, high: Self) -> Self {
            Self::new(Node::Clamp(self.0, low.0, high.0))
        }
        fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
            Self::new(Node::IfLt(self.0, rhs.0, yes.0, no.0))
        }
        fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
            Self::new(Node::SelectLt(self.0, rhs.0, yes.0, no.0))
        }
    };
}
pub(super) use primitives;

operators!(Expr);

impl Scalar for Expr {
    fn call(network: &Arc<Mlp>, inputs: &[Self]) -> Vec<Self> {
        let arguments: Vec<u32> = inputs.iter().map(|input| input.0).collect();
        push_call(network, &arguments).into_iter().map(Self).collect()
    }
}

impl Real for Expr {
    primitives!();
    fn parameter(name: &str, value: f32) -> Self {
        let named = ARENA.with_borrow(|arena| arena.parameters.get(name).copied());
        named.unwrap_or_else(|| Self::lit(value))
    }
    fn hypot(self, rhs: Self) -> Self {
        Self::new(Node::Hypot(self.0, rhs.0))
    }
    fn powi(self, exponent: i32) -> Self {
        Self::new(Node::Powi(self.0, exponent))
    }
    fn powf(self, exponent: f32) -> Self {
        Self::new(Node::Powf(self.0, exponent.to_bits()))
    }
    fn sin(self) -> Self {
        self.apply(Function::Sin)
    }
    fn cos(self) -> Self {
        self.apply(Function::Cos)
    }
    fn principal_sin_cos(self) -> [Self; 2] {
        [self.apply(Function::PrincipalSin), self.apply(Function::PrincipalCos)]
    }
    fn tan(self) -> Self {
        self.apply(Function::Tan)
    }
    fn asin(self) -> Self {
        self.apply(Function::Asin)
    }
    fn acos(self) -> Self {
        self.apply(Function::Acos)
    }
    fn atan(self) -> Self {
        self.apply(Function::Atan)
    }
    fn atan2(self, x: Self) -> Self {
        Self::new(Node::Atan2(self.0, x.0))
    }
    fn wrap(self) -> Self {
        self.apply(Function::Wrap)
    }
    fn exp(self) -> Self {
        self.apply(Function::Exp)
    }
    fn ln(self) -> Self {
        self.apply(Function::Ln)
    }
    fn tanh(self) -> Self {
        self.apply(Function::Tanh)
    }
    fn sigmoid(self) -> Self {
        self.apply(Function::Sigmoid)
    }
    fn exp_negative(self) -> Self {
        self.apply(Function::ExpNegative)
    }
    fn ln_unit(self) -> Self {
        self.apply(Function::LnUnit)
    }
}
