//! Graphs in the primitives: functions as the polynomials that every scalar computes.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::node::Node;
use super::record::{Graph, push, recorded};
use crate::real::Real;

impl Graph {
    /// The same formula with its functions as polynomials: sums, differences, products, quotients,
    /// signs, absolute values, roots, floors and choices are left.
    ///
    /// Its bits are those of the whole graph in f32 and in lanes. This is what WGSL is printed of, what
    /// operations are counted of, and what training differentiates.
    ///
    /// ```
    /// use reachcast::formula::{Node, record};
    /// use reachcast::real::Real;
    /// let whole = record(1, |x| vec![x[0].exp()]);
    /// assert_eq!(whole.nodes.len(), 2);
    /// let expanded = whole.expanded();
    /// assert!(!expanded.nodes.iter().any(|node| matches!(node, Node::Apply(..))));
    /// assert_eq!(expanded.eval(&[0.3_f32]), whole.eval(&[0.3_f32]));
    /// ```
    pub fn expanded(&self) -> Self {
        recorded(self.inputs, |places| {
            let inputs: Vec<Primitive> = places.iter().map(|place| Primitive(*place)).collect();
            self.eval(&inputs).into_iter().map(|output| output.0).collect()
        })
    }
}

/// A number of the recording in progress whose functions are what [`Real`] makes of primitives.
#[derive(Clone, Copy, Debug)]
struct Primitive(u32);

impl Primitive {
    fn new(node: Node) -> Self {
        Self(push(node))
    }
}

macro_rules! operators {
    ($($trait:ident, $method:ident;)*) => {
        $(
            impl $trait for Primitive {
                type Output = Self;
                fn $method(self, rhs: Self) -> Self {
                    Self::new(Node::$trait(self.0, rhs.0))
                }
            }
        )*
    };
}
operators! {
    Add, add;
    Sub, sub;
    Mul, mul;
    Div, div;
}

impl Neg for Primitive {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(Node::Neg(self.0))
    }
}

impl Real for Primitive {
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
}
