//! What a search for failures came to.

use serde::Serialize;

use crate::scenario::counterexamples::FailingStart;

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
    /// Uniform draws of the region at the beginning.
    pub uniform: u64,
    /// Those of them that fail.
    pub uniform_failures: u64,
    /// Clouds of starts that were followed.
    pub restarts: u64,
    /// Batches of rollouts.
    pub rounds: u64,
    /// The start with the smallest measure.
    pub best: Option<BestStart>,
    /// Starts that fail on the backend and in f64.
    pub failures: u64,
    /// Starts that fail on the backend and not in f64.
    pub unconfirmed: u64,
    /// The worst of those that fail.
    pub starts: Vec<FailingStart>,
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
