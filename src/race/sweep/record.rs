//! What a sweep stores: its axes, and what each point came to.

use serde::{Deserialize, Serialize};

use crate::backend::{Event, add_events};
use crate::race::judge::Judge;
use crate::race::record::{JudgedRecord, StartsRecord};
use crate::scenario::record::{GrowthOutcome, Provenance};

/// Version of the layout of [`SweepRecord`].
pub const SWEEP_SCHEMA: u32 = 1;

/// A sweep: everything in `sweep.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepRecord {
    /// [`SWEEP_SCHEMA`].
    pub schema: u32,
    /// Who computed what from which input; the configuration is the one that every point starts
    /// from.
    pub provenance: Provenance,
    /// The starts of the races; none for a sweep of certificates.
    pub starts: Option<StartsRecord>,
    /// The noise seeds of the races; none for a sweep of certificates.
    pub noise_seeds: Vec<u64>,
    /// The judge of the profile, whose rates the figures show; none for a sweep of certificates.
    pub judge: Option<Judge>,
    /// What varies, the last axis fastest.
    pub axes: Vec<AxisRecord>,
    /// Number of points of the grid; fewer are stored while the sweep is under way.
    pub total: u64,
    /// The points that are done, in the order of the grid.
    pub points: Vec<PointRecord>,
    /// What has to be said beside the figures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl SweepRecord {
    /// What failed on the adapter and was worked around, each once.
    pub fn events(&self) -> Vec<Event> {
        let mut all = Vec::new();
        self.points.iter().for_each(|point| add_events(&mut all, point.events.iter().cloned()));
        all
    }
}

/// One parameter and the values that it takes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisRecord {
    /// Its name: that of its column.
    pub name: String,
    /// The values, as they were given.
    pub values: Vec<String>,
}

/// One point of the grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointRecord {
    /// SHA-256 over everything that the result depends on.
    pub sha256: String,
    /// One value for each axis, in their order.
    pub values: Vec<String>,
    /// What came of it.
    pub result: PointResult,
    /// What failed on the adapter and was worked around until the point was done.
    pub events: Vec<Event>,
}

/// What came of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "of", rename_all = "kebab-case")]
pub enum PointResult {
    /// Races of one controller.
    Race(RacePoint),
    /// A certificate.
    Certificate(CertificatePoint),
}

/// The races of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RacePoint {
    /// Races flown, over all noise seeds.
    pub races: u64,
    /// Success and failure classes under each judge.
    pub judged: Vec<JudgedRecord>,
    /// Mean over control steps of `1 / sum w^2` of the last improvement of a plan, from 1 to K;
    /// none without plans.
    #[serde(with = "crate::files::number", default)]
    pub effective_samples: Option<f64>,
    /// Mean over control steps of the smallest cost that a sample of the last improvement achieved;
    /// none without plans. Costs of different horizons or cost keys do not compare.
    #[serde(with = "crate::files::number", default)]
    pub best_cost: Option<f64>,
    /// Samples of all plans whose cost was not finite: their weight was 0.
    pub non_finite_samples: u64,
    /// Compute time of a control step of one race that flies alone.
    pub latency: LatencyRecord,
    /// Mean share of a race in the wall time of a step of its batch, s.
    #[serde(with = "crate::files::number")]
    pub batch_seconds: f64,
}

/// Compute time of a control step of one race that flies alone, on all threads of the backend.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatencyRecord {
    /// Control steps timed, after one that warmed up.
    pub steps: u64,
    /// Half of the steps stay below, s.
    #[serde(with = "crate::files::number")]
    pub median_seconds: f64,
    /// 95 % of the steps stay below, s.
    #[serde(with = "crate::files::number")]
    pub p95_seconds: f64,
    /// 99 % of the steps stay below, s.
    #[serde(with = "crate::files::number")]
    pub p99_seconds: f64,
}

/// The certificate of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CertificatePoint {
    /// Pairs N of the deviation bound.
    pub deviation_scenarios: u64,
    /// Risk that the deviation bound is certified at.
    #[serde(with = "crate::files::number")]
    pub deviation_risk: f64,
    /// Largest deviation bound over the steps: what the margins lose, before the constants.
    #[serde(with = "crate::files::number")]
    pub deviation_bound: f64,
    /// Draws from the box.
    pub draws: u64,
    /// Draws with `V_check > 0`.
    pub accepted: u64,
    /// Two-sided interval of the certified set's share of the box.
    #[serde(with = "crate::files::number")]
    pub share_interval: [f64; 2],
    /// Two-sided interval of its volume, in the coordinates that vary.
    #[serde(with = "crate::files::number")]
    pub volume_interval: [f64; 2],
    /// Risk that a perturbed rollout from the certified set fails.
    #[serde(with = "crate::files::number")]
    pub conditional_risk: f64,
    /// Starts N of each round of growth.
    pub growth_scenarios: u64,
    /// What came of growth.
    pub growth: GrowthOutcome,
    /// Rounds of growth.
    pub rounds: u64,
    /// Radius of the verified ball; 0 if none was.
    #[serde(with = "crate::files::number")]
    pub radius: f64,
    /// Whether every claim that was asked for was obtained.
    pub holds: bool,
    /// All claims hold together with confidence one minus this.
    #[serde(with = "crate::files::number")]
    pub beta_total: f64,
    /// Wall time, s.
    #[serde(with = "crate::files::number")]
    pub seconds: f64,
}
