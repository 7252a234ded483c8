//! Where the numbers of a tape are, before it is laid out and after.

use super::operation::Operation;

/// Where an input of a formula is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Source {
    /// In that row.
    Row(usize),
    /// The same number for all trajectories.
    Number(f32),
    /// A row, each number times another.
    Multiple {
        /// The row.
        row: usize,
        /// The factor.
        of: f32,
    },
}

/// Where an operand is when the tape runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// In that row.
    Row(usize),
    /// The same number for all trajectories.
    Number(f32),
}

/// An operation and the row that it writes.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub(super) operation: Operation<Place>,
    pub(super) to: usize,
}
