//! A graph as operations over values: constants folded, minima found, what is not needed left out.

use std::collections::HashMap;

use super::operation::{Binary, Kind, Operation, Unary, Whole};
use super::place::Source;
use crate::formula::{Graph, Node};
use crate::real::Real;

/// Where an operand comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Value {
    /// A number that is known when the tape is made, by its bits.
    Number(u32),
    /// A row that is given.
    Row(usize),
    /// What the operation of that index computes.
    Result(usize),
}

/// Operations in an order of evaluation, and where the outputs come from.
#[derive(Debug, Default)]
pub(super) struct Values {
    /// The operations, no two of them equal.
    pub(super) operations: Vec<Operation<Value>>,
    /// One for each output of the graphs.
    pub(super) outputs: Vec<Value>,
    /// The index of each operation.
    known: HashMap<Operation<Value>, usize>,
}

impl Values {
    /// The operations of `graphs`, whose inputs are at `sources`.
    ///
    /// # Panics
    /// If there are not as many sources as inputs.
    pub(super) fn new(graphs: &[&Graph], sources: &[Source]) -> Self {
        let mut all = Self::default();
        for graph in graphs {
            assert_eq!(sources.len(), graph.inputs, "sources of a tape");
            let mut values: Vec<Value> = Vec::with_capacity(graph.nodes.len());
            for node in &graph.nodes {
                values.push(all.node(*node, &values, sources));
            }
            all.outputs.extend(graph.outputs.iter().map(|&i| values[i as usize]));
        }
        all
    }

    /// The value of a node, of those of earlier nodes.
    fn node(&mut self, node: Node, values: &[Value], sources: &[Source]) -> Value {
        match node {
            Node::Input(i) => self.source(sources[i as usize]),
            Node::Literal(bits) => Value::Number(bits),
            node => self.value(&operation(node).map(|i| values[i as usize])),
        }
    }

    /// The value of an input.
    fn source(&mut self, source: Source) -> Value {
        match source {
            Source::Row(row) => Value::Row(row),
            Source::Number(number) => Value::Number(number.to_bits()),
            Source::Multiple { row, of } => {
                let operands = [Value::Row(row), Value::Number(of.to_bits())];
                self.value(&Operation::new(Kind::Binary(Binary::Mul), &operands))
            }
        }
    }

    /// The value of `operation`: a number or an operand where that is known, else a result.
    fn value(&mut self, operation: &Operation<Value>) -> Value {
        if let Some(known) = known(operation) {
            return known;
        }
        let (operation, next) = (cheaper(operation), self.operations.len());
        let index = *self.known.entry(operation.clone()).or_insert(next);
        if index == next {
            self.operations.push(operation);
        }
        Value::Result(index)
    }

    /// How often each result is an operand of an operation that is needed, or an output; 0 for
    /// what nothing needs.
    pub(super) fn uses(&self) -> Vec<usize> {
        let mut uses = vec![0; self.operations.len()];
        self.outputs.iter().for_each(|&value| count(&mut uses, value));
        for (i, operation) in self.operations.iter().enumerate().rev() {
            if uses[i] > 0 {
                operation.operands().iter().for_each(|&value| count(&mut uses, value));
            }
        }
        uses
    }
}

/// Counts a use of `value`, if it is a result.
fn count(uses: &mut [usize], value: Value) {
    if let Value::Result(i) = value {
        uses[i] += 1;
    }
}

/// The number that a value is, if it is one.
fn number(value: Value) -> Option<f32> {
    match value {
        Value::Number(bits) => Some(f32::from_bits(bits)),
        Value::Row(_) | Value::Result(_) => None,
    }
}

/// What an operation of numbers gives, or a choice between numbers.
fn known(operation: &Operation<Value>) -> Option<Value> {
    let numbers = operation.map(number);
    let known = |operands: &[Option<f32>]| operands.iter().all(Option::is_some);
    if known(numbers.operands()) {
        let numbers = numbers.map(Option::unwrap_or_default);
        return Some(Value::Number(numbers.value().to_bits()));
    }
    match (operation.kind, numbers.operands(), operation.operands()) {
        (Kind::Select, &[Some(a), Some(b), ..], &[_, _, yes, no]) => Some(chosen(a, b, yes, no)),
        (Kind::SelectLt, &[Some(a), Some(b), ..], &[_, _, yes, no]) => {
            Some(if a < b { yes } else { no })
        }
        _ => None,
    }
}

/// What a choice between `yes` and `no` gives, as [`Real::if_lt`] would choose.
fn chosen(a: f32, b: f32, yes: Value, no: Value) -> Value {
    match a.if_lt(b, 1.0, 0.0) {
        1.0 => yes,
        0.0 => no,
        neither => Value::Number(neither.to_bits()),
    }
}

/// The same bits for less: a product for a quotient by a power of two; a number on the right where
/// the side makes no difference, for which there are loops.
fn cheaper(operation: &Operation<Value>) -> Operation<Value> {
    match (operation.kind, operation.operands()) {
        (Kind::Binary(Binary::Div), &[a, b]) if number(b).is_some_and(is_power_of_two) => {
            let inverse = number(b).map_or(b, |b| Value::Number(b.recip().to_bits()));
            Operation::new(Kind::Binary(Binary::Mul), &[a, inverse])
        }
        (Kind::Binary(f), &[a @ Value::Number(_), b]) if f.commutes() => {
            Operation::new(Kind::Binary(f), &[b, a])
        }
        _ => operation.clone(),
    }
}

/// Whether a number and its reciprocal are normal powers of two: then quotient and product are
/// roundings of the same real number.
fn is_power_of_two(number: f32) -> bool {
    let power = |x: f32| x.is_normal() && x.to_bits().trailing_zeros() >= f32::MANTISSA_DIGITS - 1;
    power(number) && power(number.recip())
}

/// The operation that a node is, of the nodes that are its operands: the one place that knows
/// every kind of node.
fn operation(node: Node) -> Operation<u32> {
    let unary = |f, a| Operation::new(Kind::Unary(f), &[a]);
    let binary = |f, a, b| Operation::new(Kind::Binary(f), &[a, b]);
    let whole = |f, a| Operation::new(Kind::Whole(f), &[a]);
    match node {
        Node::Input(_) | Node::Literal(_) => unreachable!("values, not operations"),
        Node::Said(..) => unreachable!("a tape is a part of a formula without networks"),
        Node::Add(a, b) => binary(Binary::Add, a, b),
        Node::Sub(a, b) => binary(Binary::Sub, a, b),
        Node::Mul(a, b) => binary(Binary::Mul, a, b),
        Node::Div(a, b) => binary(Binary::Div, a, b),
        Node::Neg(a) => unary(Unary::Neg, a),
        Node::Abs(a) => unary(Unary::Abs, a),
        Node::Sqrt(a) => unary(Unary::Sqrt, a),
        Node::Floor(a) => unary(Unary::Floor, a),
        // As `Real::min` and `Real::max` are written: one instruction each.
        Node::IfLt(a, b, yes, no) if (yes, no) == (a, b) => binary(Binary::Min, a, b),
        Node::IfLt(a, b, yes, no) if (yes, no) == (b, a) => binary(Binary::Max, b, a),
        Node::IfLt(a, b, yes, no) => Operation::new(Kind::Select, &[a, b, yes, no]),
        Node::SelectLt(a, b, yes, no) => Operation::new(Kind::SelectLt, &[a, b, yes, no]),
        Node::Min(a, b) => binary(Binary::Min, a, b),
        Node::Max(a, b) => binary(Binary::Max, a, b),
        Node::Clamp(a, low, high) => Operation::new(Kind::Clamp, &[a, low, high]),
        Node::Hypot(a, b) => binary(Binary::Hypot, a, b),
        Node::Atan2(a, b) => binary(Binary::Atan2, a, b),
        Node::Sign(a) => whole(Whole::Sign, a),
        Node::Apply(function, a) => whole(Whole::Apply(function), a),
        Node::Powi(a, exponent) => whole(Whole::Powi(exponent), a),
        Node::Powf(a, bits) => whole(Whole::Powf(bits), a),
    }
}
