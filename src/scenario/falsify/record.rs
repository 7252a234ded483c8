//! What a search for failures came to.

use serde::Serialize;

use crate::scenario::counterexamples::{FailingPair, FailingStart};

/// What a search for failures tried, and found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FalsifyRecord {
    /// Whether a start fails.
    pub found: bool,
    /// Rollouts that were allowed.
    pub budget: u64,
    /// Rollouts that were made.
    pub rollouts: u64,
    /// Seed of every draw.
    pub seed: u64,
    /// Steps T.
    pub horizon: u32,
    /// Discount per step.
    #[serde(with = "crate::files::number")]
    pub gamma: f32,
    /// Uniform draws of the region at the beginning; of pairs those whose nominal start is certified.
    pub uniform: u64,
    /// Those of them that fail.
    pub uniform_failures: u64,
    /// Clouds of starts that were followed.
    pub restarts: u64,
    /// Batches of rollouts.
    pub rounds: u64,
    /// The start with the smallest measure.
    pub best: Option<BestStart>,
    /// The starts that had the smallest measure when they were tried, in their order.
    pub improvements: Vec<Improvement>,
    /// Starts that fail on the backend and in f64.
    pub failures: u64,
    /// Starts that fail on the backend and not in f64.
    pub unconfirmed: u64,
    /// The worst of those that fail.
    pub starts: Vec<FailingStart>,
    /// The worst of the pairs that fail, where pairs were looked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<FailingPair>,
}

/// A start with a smaller measure than all before it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Improvement {
    /// The number of its rollout.
    pub index: u64,
    /// Its measure.
    #[serde(with = "crate::files::number")]
    pub measure: f64,
}

/// The start with the smallest measure that a search saw.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BestStart {
    /// The number of its rollout.
    pub index: u64,
    /// The start.
    #[serde(with = "crate::files::number")]
    pub x: Vec<f32>,
    /// Its measure; of f64 where it fails on the backend.
    #[serde(with = "crate::files::number")]
    pub measure: f64,
}
