//! Lower bounds of a margin over a set of states.

use std::cell::LazyCell;

use super::affine::{Affine, Symbols};
use super::convex::{self, Duals};
use super::evaluate;
use super::flow::at_state;
use super::piece::{Nodes, Piece, depends};
use super::state::Set;
use crate::formula::{Graph, Node};
use crate::model::{Model, Moment};
use crate::real::bound::Interval;

/// A margin with what is known of it at every step.
#[derive(Clone, Debug)]
pub(super) struct Margin<'a> {
    model: &'a Model,
    graph: &'a Graph,
    depends: Vec<bool>,
    /// Its pieces, where no formula reads the time.
    pieces: Option<Vec<Piece>>,
}

impl<'a> Margin<'a> {
    /// The margin that `graph` is of `model`.
    pub(super) fn new(model: &'a Model, graph: &'a Graph) -> Self {
        let depends = depends(graph, model.states.len());
        let mut margin = Self { model, graph, depends, pieces: None };
        if model.is_stationary() {
            let anywhere = Set::ball(&vec![0.0; model.states.len()], 0.0);
            let values = margin.values(&anywhere, 0.into());
            margin.pieces = Some(margin.nodes(&values).pieces(graph.outputs[0]));
        }
        margin
    }

    fn values(&self, set: &Set, at: Moment) -> Vec<Affine> {
        let inputs = at_state(self.model, &set.forms, at);
        let mut symbols: Symbols = set.symbols;
        evaluate::values(self.graph, &inputs, &mut symbols)
    }

    fn nodes<'b>(&'b self, values: &'b [Affine]) -> Nodes<'b> {
        Nodes { graph: self.graph, depends: &self.depends, values }
    }

    /// A number that the margin is nowhere below over `set`, at a moment: of two bounds the better, that of the
    /// formula as a whole and, where that leaves the sign open, that of the lowest of its pieces. Minus infinity
    /// where the margin may be no number.
    pub(super) fn below(&self, set: &Set, at: Moment) -> f64 {
        let values = self.values(set, at);
        let whole = &values[self.graph.outputs[0] as usize];
        if !whole.known() {
            return f64::NEG_INFINITY;
        }
        if whole.range.low > 0.0 {
            return whole.range.low;
        }
        let nodes = self.nodes(&values);
        let pieces = match &self.pieces {
            Some(pieces) => pieces,
            None => &nodes.pieces(self.graph.outputs[0]),
        };
        whole.range.low.max(self.lowest(nodes, pieces, set))
    }

    /// The bound of the lowest of `pieces`.
    fn lowest(&self, nodes: Nodes<'_>, pieces: &[Piece], set: &Set) -> f64 {
        let centers = || set.forms.iter().map(|form| form.center).collect::<Vec<f64>>();
        let duals = LazyCell::new(|| Duals::new(nodes, &centers()));
        let bound = |piece: &Piece| {
            let sum = sum(nodes, piece);
            if sum > 0.0 || !self.bends(piece) {
                return sum;
            }
            convex::below(piece, &duals, &set.forms).map_or(sum, |tangent| tangent.max(sum))
        };
        pieces.iter().map(bound).fold(f64::INFINITY, f64::min)
    }

    /// Whether a piece has more in it than states, whose sums are exact as they are.
    fn bends(&self, piece: &Piece) -> bool {
        let straight = |node: u32| matches!(self.graph.nodes[node as usize], Node::Input(_));
        piece.terms.iter().any(|(node, _)| !straight(*node))
    }
}

/// A lower bound of a piece from the forms of its nodes.
fn sum(nodes: Nodes<'_>, piece: &Piece) -> f64 {
    let mut least = piece.constant;
    let mut terms = Vec::with_capacity(piece.terms.len());
    for (node, factor) in &piece.terms {
        let form = &nodes.values[*node as usize];
        let middle = (0.5 * factor.low + 0.5 * factor.high).clamp(f64::MIN, f64::MAX);
        let away = *factor - Interval::point(middle);
        least = least + away * form.range;
        terms.push((middle, form));
    }
    (least + Affine::combination(&terms, 0.0).range).low
}
