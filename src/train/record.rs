//! What training stores of itself: plain records, written as `train.json`.

use serde::{Deserialize, Serialize};

use super::settings::Method;
use crate::backend::Event;
use crate::files::{Column, Table};
use crate::scenario::record::Provenance;

/// Version of the layout of [`TrainRecord`].
pub const TRAIN_SCHEMA: u32 = 1;

/// A run of training: everything in `train.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainRecord {
    /// [`TRAIN_SCHEMA`].
    pub schema: u32,
    /// Where it came from.
    pub origin: Origin,
    /// Iterations asked for.
    pub total: u64,
    /// Whether training ended early, for want of a better score.
    pub stopped_early: bool,
    /// Iterations after which the best score was reached: the networks are those of that moment.
    pub best: u64,
    /// What the scores are, the one that decides first.
    pub scores: Vec<String>,
    /// The run, score by score.
    pub curve: Vec<CurvePoint>,
    /// The networks.
    pub networks: Vec<NetworkRecord>,
    /// The section of a model as text that uses the policy, in TOML; none for other plants and networks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<String>,
    /// What has to be said beside the scores.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// What failed on the adapter and was worked around.
    #[serde(default)]
    pub events: Vec<Event>,
}

impl TrainRecord {
    /// The curve, one row per score.
    pub fn table(&self) -> Table {
        let curve = &self.curve;
        let mut table = Table::default();
        let iterations = curve.iter().map(|point| point.iteration).collect();
        table.add("iteration", Column::Count(iterations));
        table.add("loss", Column::Float(curve.iter().map(|point| point.loss).collect()));
        for (i, name) in self.scores.iter().enumerate() {
            let scores = curve.iter().map(|point| point.scores.get(i).copied()).collect();
            table.add(name, Column::Float(scores));
        }
        table
    }
}

/// Everything that a run depends on: equal origins give equal networks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// What was trained, and how.
    pub method: Method,
    /// Configuration, seed, physics and device. Its policy is the one that a value is of, or the
    /// untrained one that training began with.
    pub provenance: Provenance,
}

/// One score of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvePoint {
    /// Iterations done.
    pub iteration: u64,
    /// Mean loss since the score before; none before the first iteration.
    #[serde(with = "crate::files::number", default)]
    pub loss: Option<f64>,
    /// The scores on the held-out starts; larger is better.
    #[serde(with = "crate::files::number")]
    pub scores: Vec<f64>,
}

/// A network that was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkRecord {
    /// Its file, in the same folder.
    pub file: String,
    /// SHA-256 of its parameters.
    pub sha256: String,
    /// Neurons per layer, inputs first.
    pub widths: Vec<usize>,
}
