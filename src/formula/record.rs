//! The recorder: a scalar whose operations build an expression graph.

use std::cell::RefCell;
use std::collections::HashMap;

use super::node::{Function, Node};
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
    prune(inputs, &recorded.nodes, &outputs)
}

/// Keeps the nodes that the outputs need, in order.
fn prune(inputs: usize, nodes: &[Node], outputs: &[u32]) -> Graph {
    let mut needed = vec![false; nodes.len()];
    for output in outputs {
        needed[*output as usize] = true;
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
    let outputs = outputs.iter().map(|output| place[*output as usize]).collect();
    Graph { inputs, nodes: kept, outputs }
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

/// The operators of a recorded number, and in its `impl Real` the operations that the expanded graph
/// keeps: the same nodes whatever becomes of the functions.
macro_rules! operators {
    ($number:ident) => {
        $crate::formula::record::operators! { $number: Add add, Sub sub, Mul mul, Div div }

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
