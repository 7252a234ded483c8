//! What an attempt at a call may ask of an adapter, and what it asked.

use std::cell::Cell;

use super::compose::WORKGROUP;

/// Iterations that one invocation may spend, all its loops summed.
///
/// Mesa's lavapipe stops every invocation after 65,535 iterations without an error, its results
/// wrong; no other limit is known to be lower.
pub(super) const MAX_TRIPS: u64 = 60_000;

/// Columns are a multiple of this, so that workgroups are whole.
pub(super) const COLUMN_UNIT: u64 = WORKGROUP as u64;
/// Most columns of a chunk under a formula: enough threads for any GPU.
pub(super) const FORMULA_COLUMNS: u64 = 1 << 18;

/// Most operations of one submission, as counted from formulas and networks.
///
/// Some systems reset a device after 2 s. This takes half a second at 34 GFLOP/s, which a small
/// integrated GPU reaches, and on a large one still many times what a submission costs.
pub(super) const WORK_FLOPS: u64 = 1 << 34;

/// What a chunk may ask of an adapter; halved where the adapter fails at it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Limit {
    /// Columns of a chunk.
    pub(super) columns: u64,
    /// Operations of a submission.
    pub(super) flops: u64,
}

impl Default for Limit {
    fn default() -> Self {
        Self { columns: FORMULA_COLUMNS, flops: WORK_FLOPS }
    }
}

impl Limit {
    /// Half of it, after a chunk of `columns` columns; `None` if that was the smallest there is.
    pub(super) fn half(self, columns: u64) -> Option<Self> {
        let columns = columns / 2 / COLUMN_UNIT * COLUMN_UNIT;
        (columns > 0).then_some(Self { columns, flops: self.flops / 2 })
    }

    /// How many pieces of `each` operations a submission takes, at least one.
    pub(super) fn pieces(self, each: u64) -> u64 {
        (self.flops / each.max(1)).max(1)
    }
}

/// An attempt at the rest of a call on an adapter.
pub(super) struct Attempt {
    /// What a chunk may ask of the adapter.
    pub(super) limit: Limit,
    /// Columns of a chunk, once they are planned.
    pub(super) columns: Cell<u64>,
}

impl Attempt {
    /// An attempt within `limit`.
    pub(super) fn new(limit: Limit) -> Self {
        Self { limit, columns: Cell::new(limit.columns) }
    }
}
