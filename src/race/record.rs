//! What an experiment stores: the record that `results.json` holds and the report reads.
//!
//! Nothing in it depends on the machine's speed, so an interrupted experiment that is resumed
//! gives the same record; compute times are stored apart, in `timing.json` and the logs.

use serde::{Deserialize, Serialize};

use super::judge::{FailureClass, Judge};
use crate::backend::Event;
use crate::scenario::drops_record::{DropsRecord, SequenceRecord};
use crate::scenario::record::{ConstantsRecord, DeviationRecord, Provenance};

/// Version of the record's form.
pub const RACE_SCHEMA: u32 = 1;

/// A whole experiment: every controller on the same starts, under every judge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RaceRecord {
    /// Version of this form, [`RACE_SCHEMA`].
    pub schema: u32,
    /// Who computed what from which input.
    pub provenance: Provenance,
    /// SHA-256 of the value network, where one is used.
    pub value_sha256: Option<String>,
    /// SHA-256 of the disturbance network, where one is used.
    pub disturbance_sha256: Option<String>,
    /// SHA-256 of the policy of `ppo-cbf`, where it ran.
    pub ppo_sha256: Option<String>,
    /// What V_check was computed with, where a controller asked for certificates.
    pub bounds: Option<BoundsRecord>,
    /// Longest race, control steps.
    pub steps: u32,
    /// Duration of a control step, s.
    #[serde(with = "crate::files::number")]
    pub step_seconds: f64,
    /// The starts.
    pub starts: StartsRecord,
    /// The noise seeds; each controller ran all starts once with each.
    pub noise_seeds: Vec<u64>,
    /// The controllers that ran, in the order asked for.
    pub controllers: Vec<ControllerRecord>,
    /// The controllers that were asked for and could not run.
    pub absent: Vec<AbsentRecord>,
    /// One race step by step, for the picture.
    pub picture: Option<PictureRecord>,
    /// What failed on the adapter and was worked around.
    pub events: Vec<Event>,
    /// What has to be said beside the figures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// What V_check was computed with; the same for all controllers and races.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoundsRecord {
    /// Lipschitz constants of the margins.
    pub constants: ConstantsRecord,
    /// The deviation bound and its claim.
    pub deviation: DeviationRecord,
    /// The bound on margin drops, where these tighten the margins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drops: Option<DropsRecord>,
    /// The sequence of sets that tier 1 was chosen from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceRecord>,
    /// Measures this close to zero were run again in f64.
    #[serde(with = "crate::files::number")]
    pub band: f64,
}

/// Where the starts come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartsRecord {
    /// In words: the file, or the box and the seed.
    pub source: String,
    /// How many.
    pub count: u64,
    /// SHA-256 over the starts as little-endian f32, in order.
    pub sha256: String,
    /// Per judge: starts that do not violate it before anyone moves, which no controller exceeds.
    pub ceilings: Vec<CeilingRecord>,
}

/// Most races that can succeed under a judge.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CeilingRecord {
    /// The judge.
    pub judge: Judge,
    /// Starts that are safe at t = 0.
    pub safe: u64,
}

/// A controller that could not run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AbsentRecord {
    /// Its name.
    pub name: String,
    /// Why not, and what to do about it.
    pub reason: String,
}

/// One controller over all starts and noise seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerRecord {
    /// Its name on the command line.
    pub name: String,
    /// What it is, in a sentence.
    pub description: String,
    /// Its verdicts under each judge.
    pub judged: Vec<JudgedRecord>,
    /// Means over the successes under the judge of the profile; none without success.
    pub metrics: Option<MetricsRecord>,
    /// For the controllers with tiers.
    pub tiers: Option<TierRecord>,
    /// For the controllers with a filter.
    pub filter: Option<FilterRecord>,
    /// Samples of all plans whose cost was not finite: their weight was 0.
    pub non_finite_samples: u64,
}

/// The verdicts of one judge on one controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JudgedRecord {
    /// The judge.
    pub judge: Judge,
    /// Successes with each noise seed, in the order of the seeds, each out of all starts.
    pub successes: Vec<u64>,
    /// Mean success rate over the seeds.
    #[serde(with = "crate::files::number")]
    pub rate: f64,
    /// 95 % interval (Clopper-Pearson) of the run with the first seed, as the published ones are.
    #[serde(with = "crate::files::number")]
    pub interval: [f64; 2],
    /// Standard deviation of the rate between seeds; none for one seed.
    #[serde(with = "crate::files::number", default)]
    pub spread: Option<f64>,
    /// How the others failed, summed over seeds; every class, also those without failures.
    pub failures: Vec<FailureRecord>,
    /// What the study published for this controller under this judge.
    pub published: Option<PublishedRecord>,
    /// Paired comparison with the hybrid controller on the same starts; none for itself.
    pub against_hybrid: Option<PairedRecord>,
}

/// How often a controller failed in one way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailureRecord {
    /// The way.
    pub class: FailureClass,
    /// How often, over all seeds.
    pub count: u64,
}

/// A published success rate with its 95 % interval, shares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PublishedRecord {
    /// Share of 500 races.
    #[serde(with = "crate::files::number")]
    pub rate: f64,
    /// Clopper-Pearson.
    #[serde(with = "crate::files::number")]
    pub interval: [f64; 2],
}

/// A paired comparison of two controllers on the same starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairedRecord {
    /// Starts, with the first noise seed, where this one alone succeeded.
    pub only_this: u64,
    /// Starts, with the first noise seed, where the other one alone succeeded.
    pub only_other: u64,
    /// Two-sided exact p-value of McNemar's test on these two counts.
    #[serde(with = "crate::files::number")]
    pub p_value: f64,
    /// Difference of the mean rates, this one less the other, over all seeds.
    #[serde(with = "crate::files::number")]
    pub difference: f64,
    /// 95 % interval of the difference: normal, over starts, seeds averaged within each start.
    #[serde(with = "crate::files::number")]
    pub interval: [f64; 2],
}

/// Means over the successful races.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetricsRecord {
    /// The judge that says what a success is.
    pub judge: Judge,
    /// Number of races averaged.
    pub races: u64,
    /// Time to the gate, s.
    #[serde(with = "crate::files::number")]
    pub time_seconds: f64,
    /// Length of the ego's path, m.
    #[serde(with = "crate::files::number")]
    pub path_m: f64,
    /// Mean jerk, m/s^3.
    #[serde(with = "crate::files::number")]
    pub jerk: f64,
    /// Mean acceleration, m/s^2.
    #[serde(with = "crate::files::number")]
    pub acceleration: f64,
    /// Mean over races of the smallest distance of the two drones, m.
    #[serde(with = "crate::files::number")]
    pub separation_m: f64,
    /// Smallest distance in any of them, m.
    #[serde(with = "crate::files::number")]
    pub least_separation_m: f64,
}

/// Tiers and certificates of a hierarchical controller.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TierRecord {
    /// Per control step, races in tier 0, 1, 2, 3, and races that are over, summed over seeds.
    pub occupancy: Vec<[u64; 5]>,
    /// Share of all control steps flown in each tier.
    #[serde(with = "crate::files::number")]
    pub shares: [f64; 4],
    /// Calls of local growth.
    pub growth_calls: u64,
    /// Calls that ended with a verified ball.
    pub growth_verified: u64,
    /// Control steps at which the ledger allowed no call.
    pub growth_refused: u64,
    /// Rounds of growth, over all calls.
    pub growth_rounds: u64,
    /// Starts rolled out by growth that were run again in f64.
    pub f64_reruns: u64,
    /// Beta spent on the deviation bound, once for all races; for each step where the steps were
    /// bounded separately.
    #[serde(with = "crate::files::number")]
    pub beta_deviation: f64,
    /// Beta of one call of growth; 0 where none is made.
    #[serde(with = "crate::files::number")]
    pub beta_call: f64,
    /// Most that a single race spent, the deviation bound included.
    #[serde(with = "crate::files::number")]
    pub beta_race: f64,
    /// Sum over all races and calls of this controller, the deviation bound once: by the union bound
    /// all its claims hold together with at least one minus this; above 1 it says nothing.
    #[serde(with = "crate::files::number")]
    pub beta_total: f64,
}

/// What the control barrier filter did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FilterRecord {
    /// Control steps at which it was asked.
    pub calls: u64,
    /// Steps at which it changed the control by more than 1e-6.
    pub active: u64,
    /// Steps at which the slack was positive (above 1e-6): the barrier could not be kept.
    pub relaxed: u64,
    /// Steps at which the solver reported an inaccurate solution.
    pub inaccurate: u64,
    /// Steps at which the solver reported infeasibility or failed; the nominal control was flown.
    pub failed: u64,
}

/// One race, step by step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureRecord {
    /// Name of the controller.
    pub controller: String,
    /// Number of the start.
    pub start: u64,
    /// The noise seed.
    pub noise_seed: u64,
    /// Verdict under each judge; none for a success.
    pub verdicts: Vec<(Judge, Option<FailureClass>)>,
    /// Columns of the slices, ego x, m.
    #[serde(with = "crate::files::number")]
    pub slice_x: Vec<f32>,
    /// Rows of the slices, ego y, m.
    #[serde(with = "crate::files::number")]
    pub slice_y: Vec<f32>,
    /// One frame per control step, then one for the last state.
    pub frames: Vec<FrameRecord>,
}

/// One moment of a race.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Control step.
    pub step: u32,
    /// State, in state order.
    #[serde(with = "crate::files::number")]
    pub x: Vec<f32>,
    /// Control applied; none in the last frame.
    #[serde(with = "crate::files::number", default)]
    pub u: Option<Vec<f32>>,
    /// Tier; none in the last frame and for controllers without tiers.
    pub tier: Option<u8>,
    /// `V_check` of the state.
    #[serde(with = "crate::files::number", default)]
    pub check_margin: Option<f32>,
    /// Certified cells of the slice through the state, `[rows, columns]`; none where not computed.
    pub certified: Option<Vec<bool>>,
    /// Ball of local growth in the x-y plane; none where growth was not asked.
    pub ball: Option<FrameBall>,
    /// Point that the recovery steers toward, x and y, m.
    #[serde(with = "crate::files::number", default)]
    pub recovery: Option<[f32; 2]>,
    /// Sampled plans: x and y of the ego over the planning horizon, m.
    #[serde(with = "crate::files::number")]
    pub fan: Vec<Vec<[f32; 2]>>,
}

/// The ball of local growth, projected.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameBall {
    /// Ego x and y of the centre, m.
    #[serde(with = "crate::files::number")]
    pub center: [f32; 2],
    /// Last radius tried, m.
    #[serde(with = "crate::files::number")]
    pub radius: f32,
    /// Whether it passed clean.
    pub verified: bool,
    /// Rounds taken.
    pub rounds: u32,
}
