//! Pairs: a result that a single operation needs is computed in the loop of that operation.

use super::operation::{Binary, Kind, Operation, Side};
use super::values::{Value, Values};

/// Makes pairs of `values`; what went into one is needed by nothing.
pub(super) fn pair_up(values: &mut Values) {
    let uses = values.uses();
    for i in 0..values.operations.len() {
        if uses[i] > 0
            && let Some(pair) = pair(&values.operations, &uses, i)
        {
            values.operations[i] = pair;
        }
    }
}

/// The operation `i` as a pair, if it can be one.
fn pair(operations: &[Operation<Value>], uses: &[usize], i: usize) -> Option<Operation<Value>> {
    let Kind::Binary(f) = operations[i].kind else { return None };
    let &[left, right] = operations[i].operands() else { return None };
    let single = |value| match value {
        Value::Result(j) if uses[j] == 1 => first(&operations[j]),
        _ => None,
    };
    // The later of two: less lies between it and its use.
    let (side, other, (first, [a, b])) = match (single(right), single(left)) {
        (Some(first), _) => (Side::Right, left, first),
        (None, Some(first)) => (Side::Left, right, first),
        (None, None) => return None,
    };
    Some(Operation::new(Kind::Pair(first, f.then(side)?), &[a, b, other]))
}

/// Function and operands of an operation that can be the first of a pair.
fn first(operation: &Operation<Value>) -> Option<(Binary, [Value; 2])> {
    match (operation.kind, operation.operands()) {
        (Kind::Binary(Binary::Div), _) => None,
        (Kind::Binary(f), &[a, b]) => Some((f, [a, b])),
        _ => None,
    }
}
