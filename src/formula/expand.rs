//! Graphs in the primitives: functions as the polynomials that every scalar computes.

use super::node::Node;
use super::recorder::{Graph, operators, primitives, push, push_call, recorded};
use crate::real::Real;

impl Graph {
    /// The same formula with its functions as polynomials: sums, differences, products, quotients,
    /// signs, absolute values, roots, floors and choices are left, and networks as they are.
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
            let mut values = Vec::with_capacity(self.nodes.len());
            self.replay_with(&inputs, &mut values, |network, arguments| {
                let arguments: Vec<u32> = arguments.iter().map(|argument| argument.0).collect();
                push_call(network, &arguments).into_iter().map(Primitive).collect()
            });
            self.outputs.iter().map(|i| values[*i as usize].0).collect()
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

operators!(Primitive);

impl Real for Primitive {
    primitives!();
}
