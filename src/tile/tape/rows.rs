//! Rows for results: each keeps its own until its last use, then the row is free for another.

use super::place::{Place, Step};
use super::schedule::Scheduled;
use super::values::Value;

/// Operations whose operands and results have places.
#[derive(Debug)]
pub(super) struct Placed {
    /// The operations in order.
    pub(super) steps: Vec<Step>,
    /// How many rows of their own they need.
    pub(super) own: usize,
}

/// Finds places for the results of `order`; rows of its own are those from `first_own` on.
pub(super) fn placed(order: &[Scheduled], first_own: usize) -> Placed {
    let results = order.iter().map(|scheduled| scheduled.result + 1).max().unwrap_or(0);
    let mut rows = Rows { of: vec![None; results], free: Vec::new(), own: 0, first_own };
    let ends = last_uses(order, results);
    let mut steps = Vec::with_capacity(order.len());
    for (at, scheduled) in order.iter().enumerate() {
        let operation = scheduled.operation.map(|value| rows.place(value));
        // Operands go first: an operation reads each number before it writes there.
        for value in scheduled.operation.operands() {
            rows.release(*value, at, &ends);
        }
        let to = scheduled.to.unwrap_or_else(|| rows.take());
        rows.of[scheduled.result] = Some(to);
        steps.push(Step { operation, to });
    }
    Placed { steps, own: rows.own }
}

/// Where in `order` each result is used last; nowhere if its row is given: it stays there.
fn last_uses(order: &[Scheduled], results: usize) -> Vec<Option<usize>> {
    let mut ends = vec![None; results];
    for (at, scheduled) in order.iter().enumerate() {
        for value in scheduled.operation.operands() {
            if let Value::Result(i) = *value {
                ends[i] = Some(at);
            }
        }
    }
    let given = order.iter().filter(|scheduled| scheduled.to.is_some());
    given.for_each(|scheduled| ends[scheduled.result] = None);
    ends
}

/// Which rows are in use.
#[derive(Debug)]
struct Rows {
    /// The row of each result, once it is computed.
    of: Vec<Option<usize>>,
    /// Rows that are in no use any more; the one freed last is in the nearest cache.
    free: Vec<usize>,
    own: usize,
    first_own: usize,
}

impl Rows {
    /// The place of a value.
    fn place(&self, value: Value) -> Place {
        match value {
            Value::Number(bits) => Place::Number(f32::from_bits(bits)),
            Value::Row(row) => Place::Row(row),
            Value::Result(i) => Place::Row(self.of[i].expect("results come before their uses")),
        }
    }

    /// Frees the row of `value` if `at` is its last use.
    fn release(&mut self, value: Value, at: usize, ends: &[Option<usize>]) {
        if let Value::Result(i) = value
            && ends[i] == Some(at)
        {
            // Taken, as it may be an operand twice.
            self.free.extend(self.of[i].take());
        }
    }

    /// A row that is in no use.
    fn take(&mut self) -> usize {
        self.free.pop().unwrap_or_else(|| {
            self.own += 1;
            self.first_own + self.own - 1
        })
    }
}
