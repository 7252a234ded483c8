//! A margin as the smallest of pieces, each a sum of nodes of its graph.

use std::cell::Cell;

use super::affine::Affine;
use crate::formula::{Graph, Node};
use crate::real::bound::Interval;

/// Most pieces that a margin is taken apart into; a node that would give more stays whole.
const LIMIT: usize = 64;

/// Most nodes looked at for one margin: a graph whose nodes are shared has more ways through it than nodes.
const LOOKS: u32 = 1024;

/// A sum of nodes with factors, and a constant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    /// Node and its factor.
    pub(super) terms: Vec<(u32, Interval)>,
    /// What is added.
    pub(super) constant: Interval,
}

impl Piece {
    fn constant(value: Interval) -> Self {
        Self { terms: Vec::new(), constant: value }
    }

    fn whole(node: u32, factor: Interval) -> Self {
        Self { terms: vec![(node, factor)], constant: Interval::ZERO }
    }

    /// The sum of both, a node that both have once.
    fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        sum.constant = sum.constant + other.constant;
        for &(node, factor) in &other.terms {
            match sum.terms.iter_mut().find(|(known, _)| *known == node) {
                Some((_, known)) => *known = *known + factor,
                None => sum.terms.push((node, factor)),
            }
        }
        sum
    }
}

/// Whether each node of `graph` depends on an input below `states`.
pub(super) fn depends(graph: &Graph, states: usize) -> Vec<bool> {
    let mut depends: Vec<bool> = Vec::with_capacity(graph.nodes.len());
    for (i, node) in graph.nodes.iter().enumerate() {
        let mut any = matches!(*node, Node::Input(input) if (input as usize) < states);
        graph.operands(i as u32, |operand| any |= depends[operand as usize]);
        depends.push(any);
    }
    depends
}

/// A graph with what is known of its nodes at a step.
#[derive(Clone, Copy)]
pub(super) struct Nodes<'a> {
    pub(super) graph: &'a Graph,
    /// Whether a node depends on the state.
    pub(super) depends: &'a [bool],
    /// Values of the nodes; of those that do not depend on the state, at any state.
    pub(super) values: &'a [Affine],
}

impl Nodes<'_> {
    /// The number that `node` is at every state.
    pub(super) fn constant(&self, node: u32) -> Option<Interval> {
        let value = &self.values[node as usize];
        let fixed = !self.depends[node as usize] && value.known() && value.center.is_finite();
        fixed.then_some(value.range)
    }

    /// The operands of a minimum or a maximum, also where it is written as a branch.
    fn choice(&self, node: u32) -> Option<(Choice, [u32; 2])> {
        match self.graph.nodes[node as usize] {
            Node::Min(a, b) => Some((Choice::Min, [a, b])),
            Node::Max(a, b) => Some((Choice::Max, [a, b])),
            Node::IfLt(a, b, yes, no) if (yes, no) == (a, b) => Some((Choice::Min, [a, b])),
            Node::IfLt(a, b, yes, no) if (yes, no) == (b, a) => Some((Choice::Max, [a, b])),
            _ => None,
        }
    }

    /// Pieces whose smallest is `node` at every state.
    pub(super) fn pieces(&self, node: u32) -> Vec<Piece> {
        self.taken_apart(node, Interval::ONE, &Cell::new(LOOKS))
    }

    /// Pieces whose smallest is `factor` times `node`; where no looks are left, the node whole.
    fn taken_apart(&self, node: u32, factor: Interval, looks: &Cell<u32>) -> Vec<Piece> {
        if let Some(number) = self.constant(node) {
            return vec![Piece::constant(factor * number)];
        }
        let whole = || vec![Piece::whole(node, factor)];
        let rising = factor.low >= 0.0;
        looks.set(looks.get().saturating_sub(1));
        if looks.get() == 0 || !(rising || factor.high <= 0.0) {
            return whole();
        }
        let pieces = match (self.graph.nodes[node as usize], self.choice(node)) {
            (_, Some((Choice::Min, both))) if rising => self.either(both, [factor; 2], looks),
            // A factor below 0 makes the smaller of the two from the larger.
            (_, Some((Choice::Max, both))) if !rising => self.either(both, [factor; 2], looks),
            (Node::Abs(a), _) if !rising => self.either([a; 2], [factor, -factor], looks),
            (Node::Add(a, b), _) => self.sum([a, b], [factor; 2], looks),
            (Node::Sub(a, b), _) => self.sum([a, b], [factor, -factor], looks),
            (Node::Neg(a), _) => self.taken_apart(a, -factor, looks),
            (Node::Mul(a, b), _) => match [a, b].map(|node| self.constant(node)) {
                [Some(number), _] => self.taken_apart(b, factor * number, looks),
                [_, Some(number)] => self.taken_apart(a, factor * number, looks),
                _ => whole(),
            },
            (Node::Div(a, b), _) => match self.constant(b).filter(|b| !b.contains(0.0)) {
                Some(number) => self.taken_apart(a, factor * number.reciprocal(), looks),
                None => whole(),
            },
            _ => whole(),
        };
        if pieces.len() > LIMIT { whole() } else { pieces }
    }

    /// The pieces of both.
    fn either(&self, nodes: [u32; 2], factors: [Interval; 2], looks: &Cell<u32>) -> Vec<Piece> {
        let [mut pieces, more] = [0, 1].map(|i| self.taken_apart(nodes[i], factors[i], looks));
        pieces.extend(more);
        pieces
    }

    /// The sums of a piece of one and a piece of the other.
    fn sum(&self, nodes: [u32; 2], factors: [Interval; 2], looks: &Cell<u32>) -> Vec<Piece> {
        let [one, other] = [0, 1].map(|i| self.taken_apart(nodes[i], factors[i], looks));
        one.iter().flat_map(|a| other.iter().map(|b| a.plus(b))).collect()
    }
}

/// Which of two.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Choice {
    Min,
    Max,
}

#[cfg(test)]
mod tests {
    use super::super::affine::Symbols;
    use super::super::evaluate::values;
    use super::*;
    use crate::formula::{Expr, record};
    use crate::real::Real;

    /// A margin that is doubled again and again has more ways through it than could be walked.
    #[test]
    fn shared_nodes_end_after_some_looks() {
        let graph = record(1, |x| vec![(0..200).fold(x[0], |sum, _| sum + sum)]);
        let values = values(&graph, &[Affine::constant(0.5)], &mut Symbols::default());
        let nodes = Nodes { graph: &graph, depends: &depends(&graph, 1), values: &values };
        assert_eq!(nodes.pieces(graph.outputs[0]).len(), 1);
    }

    /// The smallest piece is the formula, at many states.
    #[test]
    fn the_smallest_piece_is_the_formula() {
        let graph = record(3, |x| {
            let two = Expr::lit(2.0);
            let inner = x[0].min(x[1] - x[2]).min(-x[2].abs());
            vec![two * (inner - (x[0] * x[1]).max(x[2])) / Expr::lit(-0.5) * Expr::lit(-1.0)]
        });
        let known = depends(&graph, 3);
        for i in 0..200 {
            let x = [0, 1, 2].map(|j| f64::from((i * (7 + 4 * j) + j) % 19) / 9.0 - 1.0);
            let inputs = x.map(Affine::constant);
            let values = values(&graph, &inputs, &mut Symbols::default());
            let nodes = Nodes { graph: &graph, depends: &known, values: &values };
            let pieces = nodes.pieces(graph.outputs[0]);
            assert_eq!(pieces.len(), 8, "{pieces:?}");
            let value = |piece: &Piece| {
                let start = piece.constant.low;
                piece.terms.iter().fold(start, |sum, (node, factor)| {
                    sum + factor.low * values[*node as usize].center
                })
            };
            let least = pieces.iter().map(value).fold(f64::INFINITY, f64::min);
            let truth = graph.eval(&x)[0];
            assert!((least - truth).abs() < 1e-12, "{x:?}: {least} {truth}");
        }
    }
}
