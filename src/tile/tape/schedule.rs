//! The order of a tape: a row that is written has been read by all that need what it held.

use std::collections::{BTreeSet, HashMap};

use super::operation::{Kind, Operation};
use super::values::{Value, Values};

/// An operation in its place of the order.
#[derive(Debug)]
pub(super) struct Scheduled {
    /// What is computed.
    pub(super) operation: Operation<Value>,
    /// Index of the result.
    pub(super) result: usize,
    /// The row that it is written to, if one is given.
    pub(super) to: Option<usize>,
}

/// Orders the operations of `values`, whose outputs go to the rows `outputs`.
///
/// Each comes as soon as what it needs is there, earlier ones first. Where outputs wait for each
/// other, as two states that change places, one of them is computed apart and copied.
pub(super) fn scheduled(values: Values, outputs: &[usize]) -> Vec<Scheduled> {
    let mut work = Work::new(values, outputs);
    loop {
        if let Some(i) = work.ready.pop_first() {
            work.place(i);
        } else if let Some(i) = work.blocked.pop_first() {
            work.compute_apart(i);
        } else {
            return work.order;
        }
    }
}

/// The operations that are not in order yet.
#[derive(Debug, Default)]
struct Work {
    operations: Vec<Operation<Value>>,
    /// The row that each operation writes to, if one is given.
    to: Vec<Option<usize>>,
    /// The operation that writes to a row.
    writers: HashMap<usize, usize>,
    /// The operations that each result is an operand of, as often as it is.
    users: Vec<Vec<usize>>,
    /// Operands that each operation waits for.
    operands: Vec<usize>,
    /// Other operations that each waits for, as they read what its row holds.
    readers: Vec<usize>,
    /// Those that wait for nothing.
    ready: BTreeSet<usize>,
    /// Those that wait for readers alone.
    blocked: BTreeSet<usize>,
    order: Vec<Scheduled>,
}

impl Work {
    fn new(values: Values, outputs: &[usize]) -> Self {
        let mut needed: Vec<bool> = values.uses().iter().map(|&uses| uses > 0).collect();
        let mut work = Self { to: vec![None; needed.len()], ..Self::default() };
        work.operations = values.operations;
        for (&row, &value) in outputs.iter().zip(&values.outputs) {
            work.write(row, value);
        }
        needed.resize(work.operations.len(), true);
        work.count(&needed);
        (0..needed.len()).filter(|&i| needed[i]).for_each(|i| work.sort(i));
        work
    }

    /// Says that `value` goes to `row`: what computes it writes there, or a copy does.
    fn write(&mut self, row: usize, value: Value) {
        let writer = match value {
            Value::Row(from) if from == row => return,
            Value::Result(i) if self.to[i].is_none() => i,
            _ => self.copy(value),
        };
        self.to[writer] = Some(row);
        self.writers.insert(row, writer);
    }

    /// Adds a copy of `value`; returns its index.
    fn copy(&mut self, value: Value) -> usize {
        self.operations.push(Operation::new(Kind::Copy, &[value]));
        self.to.push(None);
        self.operations.len() - 1
    }

    /// Counts what each operation that is needed waits for.
    fn count(&mut self, needed: &[bool]) {
        let count = needed.len();
        self.users = vec![Vec::new(); count];
        self.operands = vec![0; count];
        self.readers = vec![0; count];
        for i in (0..count).filter(|&i| needed[i]) {
            for value in self.operations[i].operands() {
                if let Value::Result(operand) = *value {
                    self.users[operand].push(i);
                    self.operands[i] += 1;
                }
            }
            for writer in self.writers_of_read(i) {
                self.readers[writer] += 1;
            }
        }
    }

    /// The other operations that write to rows that operation `i` reads, each once.
    fn writers_of_read(&self, i: usize) -> BTreeSet<usize> {
        let read = self.operations[i].operands().iter().filter_map(|value| match value {
            Value::Row(row) => self.writers.get(row).copied(),
            Value::Number(_) | Value::Result(_) => None,
        });
        read.filter(|&writer| writer != i).collect()
    }

    /// Notes what operation `i` waits for.
    fn sort(&mut self, i: usize) {
        self.blocked.remove(&i);
        match (self.operands[i], self.readers[i]) {
            (0, 0) => self.ready.insert(i),
            (0, _) => self.blocked.insert(i),
            _ => false,
        };
    }

    /// Puts operation `i` next in order.
    fn place(&mut self, i: usize) {
        for writer in self.writers_of_read(i) {
            self.readers[writer] -= 1;
            self.sort(writer);
        }
        for user in std::mem::take(&mut self.users[i]) {
            self.operands[user] -= 1;
            self.sort(user);
        }
        let operation = self.operations[i].clone();
        self.order.push(Scheduled { operation, result: i, to: self.to[i] });
    }

    /// Has a copy write the row of operation `i`, which then waits for no readers.
    fn compute_apart(&mut self, i: usize) {
        let copy = self.copy(Value::Result(i));
        if let Some(row) = self.to[i].take() {
            self.to[copy] = Some(row);
            self.writers.insert(row, copy);
        }
        let reads_it = self.writers_of_read(i).contains(&copy);
        let others = std::mem::take(&mut self.readers[i]);
        self.users.push(Vec::new());
        self.users[i].push(copy);
        self.operands.push(1);
        self.readers.push(others + usize::from(reads_it));
        self.sort(i);
    }
}
