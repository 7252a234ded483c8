//! Pairs: a result that a single operation needs is computed in the loop of that operation.

use super::operation::{Binary, Kind, Operation, Pair};
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
    let Kind::Binary(second) = operations[i].kind else { return None };
    let &[left, right] = operations[i].operands() else { return None };
    let single = |value| match value {
        Value::Result(j) if uses[j] == 1 => Some(&operations[j]),
        _ => None,
    };
    // The one on the right first: it is the later one, and less lies between it and its use.
    let of_right = single(right).and_then(|first| joined(first, left, second, Pair::with_right));
    of_right.or_else(|| joined(single(left)?, right, second, Pair::with_left))
}

/// The pair of the function `first` and of `second`, which has another operand, if `join` has one.
fn joined(
    first: &Operation<Value>,
    other: Value,
    second: Binary,
    join: fn(Binary, Binary) -> Option<Pair>,
) -> Option<Operation<Value>> {
    let (Kind::Binary(f), &[a, b]) = (first.kind, first.operands()) else { return None };
    Some(Operation::new(Kind::Pair(join(f, second)?), &[a, b, other]))
}
