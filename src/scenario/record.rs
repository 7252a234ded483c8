//! What a certificate prints and stores: plain records, written as `certificate.json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use super::attempt::AttemptRecord;
use super::box_record::BoxRecord;
pub use super::claim::Claim;
pub use super::constant_record::{Assumption, ConstantRecord, ConstantsRecord, VisitedRecord};
pub use super::deterministic_record::{DeterministicRecord, RadiiRecord};
use super::drawn_record::DrawnRecord;
use super::drops_record::{CalibrationRecord, DropsRecord, SequenceRecord, ShareRecord};
pub use super::enclosed_record::EnclosedRecord;
pub use super::growth_plan::{Around, UpwardRecord};
pub use super::sequential_record::SequentialRecord;
use super::settings::{BoundarySearch, DeviationSource, Joint};
use crate::backend::Event;
use crate::model::Task;
use crate::rollout::PairControl;
pub(crate) use crate::rounding::as_written as decimal;
use crate::rounding::upper;
use crate::system::{Axis, Body};

/// Version of the layout of [`Record`].
pub const SCHEMA: u32 = 3;
/// The oldest version that is read. Its physics were hashed with parameters as literals, which no
/// text of today gives again.
pub const OLDEST_SCHEMA: u32 = 1;
/// The oldest version whose physics and policies were hashed as they are today.
pub(crate) const HASHED_ALIKE: u32 = 2;

/// A margin as a record has it: the largest number stands for infinity, as it does in a measure.
pub(crate) fn finite_margin(margin: f32) -> f32 {
    margin.clamp(f32::MIN, f32::MAX)
}

/// A stored certificate: everything in `certificate.json`.
///
/// A number that JSON has no word for stands between quotes: `"inf"`, `"-inf"`, `"nan"`. Older
/// documents have `null` for an open bound and for a margin that is NaN, which are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// [`SCHEMA`].
    pub schema: u32,
    /// SHA-256 of every other field by its path, as in `global.claim.epsilon`; none before the
    /// record is stored.
    pub digests: BTreeMap<String, String>,
    /// Whether every claim that was asked for was obtained.
    pub holds: bool,
    /// The claims in words, one sentence or two each.
    pub statements: Vec<String>,
    /// Who computed what from which input.
    pub provenance: Provenance,
    /// The system.
    pub system: SystemRecord,
    /// Steps T.
    pub horizon: u32,
    /// Discount per step.
    #[serde(with = "crate::files::number")]
    pub gamma: f64,
    /// The Lipschitz constants.
    pub constants: ConstantsRecord,
    /// The deviation bound.
    pub deviation: DeviationRecord,
    /// The certified set.
    pub global: GlobalRecord,
    /// The whole box, certified or not; older records say nothing of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub whole_box: Option<BoxRecord>,
    /// The bound on margin drops, where these tighten the margins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drops: Option<DropsRecord>,
    /// The sequence of sets that the certified one was chosen from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceRecord>,
    /// The calibration of the score.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationRecord>,
    /// That the certified set rests on an enclosure, where it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enclosed: Option<EnclosedRecord>,
    /// The deterministic certificate, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deterministic: Option<DeterministicRecord>,
    /// The state that slice and growth start from.
    pub state: StateRecord,
    /// The slice through that state.
    pub slice: SliceRecord,
    /// Local growth.
    pub growth: GrowthRecord,
    /// The sequential claim, where one was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequential: Option<SequentialRecord>,
    /// The numbered attempt; none of a certificate that counts as the only one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attempt: Option<AttemptRecord>,
    /// What of beta was spent on which claim.
    pub ledger: Vec<Spending>,
    /// Sum of the ledger: all claims hold together with confidence one minus this.
    #[serde(with = "crate::files::number")]
    pub beta_total: f64,
    /// A few rollouts, for the picture.
    pub picture: PictureRecord,
    /// What failed on the adapter and was worked around, in order; empty where all of it ran on the
    /// device of the provenance as planned.
    #[serde(default)]
    pub events: Vec<Event>,
    /// Wall time and threads: the only part that a second run may change.
    pub timing: Timing,
}

impl Record {
    /// That the risk which was looked for in the certified set was not obtained, as the headlines add it; none
    /// where it was, or where it was asked for and is among the claims.
    pub fn looked_for(&self) -> Option<String> {
        let missed = self.sequence.as_ref().and_then(SequenceRecord::missed)?;
        if !self.holds || self.global.accepted == 0 {
            return None;
        }
        let (missed, risk) = (upper(missed), upper(self.global.claim.certified_risk));
        Some(format!("a risk of {missed} was looked for in the certified set: obtained is {risk}"))
    }

    /// The claims, in the order of the method.
    pub fn claims(&self) -> Vec<&Claim> {
        let drops = self.drops.iter().map(|drops| &drops.claim);
        let calibration = self.calibration.iter().map(|calibration| &calibration.claim);
        let first = [&self.deviation.claim, &self.global.claim].into_iter();
        let whole_box = self.whole_box.iter().map(|found| &found.claim);
        let sequential = self.sequential.iter().map(|asked| &asked.claim);
        let sets = first.chain(whole_box).chain(drops).chain(calibration);
        sets.chain(&self.growth.claim).chain(sequential).collect()
    }

    /// Whether nothing speaks against the Lipschitz constants, where the certified set rests on them:
    /// margin drops and enclosures rest on none.
    pub fn constants_stand(&self) -> bool {
        self.drops.is_some() || self.enclosed.is_some() || self.constants.stand()
    }
}

/// Who computed what from which input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of this crate.
    pub version: String,
    /// Seed of every stream.
    pub seed: u64,
    /// Name of the generator.
    pub generator: String,
    /// The configuration with every default filled in.
    pub config: serde_json::Value,
    /// Policy in words.
    pub policy: String,
    /// SHA-256 of the policy: of the network's parameters, or of the formula's recorded text.
    pub policy_sha256: String,
    /// SHA-256 of the recorded physics as WGSL text.
    pub physics_sha256: String,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Processor or adapter.
    pub device: String,
    /// How an adapter ran networks, in words; none without a network, on the CPU, and in older records.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub networks: Option<String>,
}

/// Names and default boxes of a system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SystemRecord {
    /// Name.
    pub name: String,
    /// States in order, with the box of nominal starts that was used.
    pub states: Vec<Axis>,
    /// Controls.
    pub controls: Vec<Axis>,
    /// What a picture shows.
    pub bodies: Vec<Body>,
    /// What a rollout has to do; nothing is said of reach-avoid without a window.
    #[serde(default, skip_serializing_if = "Task::is_plain")]
    pub task: Task,
    /// Points inside each period that are looked at; nothing is said where there is none.
    #[serde(default, skip_serializing_if = "is_none_between")]
    pub between: u32,
}

/// Whether samples alone are looked at.
fn is_none_between(between: &u32) -> bool {
    *between == 0
}

/// The deviation bound, `docs/method.md` section 3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviationRecord {
    /// The claim.
    pub claim: Claim,
    /// Radius of the ball around each nominal start.
    #[serde(with = "crate::files::number")]
    pub radius: f64,
    /// How perturbed rollouts were driven.
    pub control: PairControl,
    /// How the steps hold together.
    pub joint: Joint,
    /// Which bound tightens the margins.
    pub source: DeviationSource,
    /// Bound used at each step, `[T + 1]`.
    #[serde(with = "crate::files::number")]
    pub bound: Vec<f64>,
    /// Largest distance seen at each step, `[T + 1]`.
    #[serde(with = "crate::files::number")]
    pub largest: Vec<f64>,
    /// Exact supremum at each step for a system linear in its state, `[T + 1]`.
    #[serde(with = "crate::files::number", default)]
    pub exact: Option<Vec<f64>>,
    /// Pairs of the pilot; 0 where no shape was fixed.
    pub pilot: u64,
    /// The one scalar of the fixed shape.
    #[serde(with = "crate::files::number", default)]
    pub scale: Option<f64>,
    /// Support scenarios of the bound.
    pub support: u64,
    /// A posteriori risk from their number (wait and judge).
    #[serde(with = "crate::files::number")]
    pub posterior_risk: f64,
    /// Pairs of which a state was not finite.
    pub non_finite: u64,
}

/// The certified set over the box, sections 4 and 8.3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlobalRecord {
    /// Conditional failure inside the certified set.
    pub claim: Claim,
    /// Pairs drawn from the box.
    pub draws: u64,
    /// Nominal starts with `V_check > 0`.
    pub accepted: u64,
    /// Two-sided interval of `P(V_global)`.
    #[serde(with = "crate::files::number")]
    pub share_interval: [f64; 2],
    /// Volume of the box in the coordinates that vary.
    #[serde(with = "crate::files::number")]
    pub box_volume: f64,
    /// Two-sided interval of the volume of `V_global`.
    #[serde(with = "crate::files::number")]
    pub volume_interval: [f64; 2],
    /// Draws whose own reach-avoid measure (perturbed start) is positive.
    pub reached: u64,
    /// Perturbed rollouts that failed for a state that is not finite.
    pub non_finite: u64,
    /// Measured f32 error of the measure: sample maximum against f64.
    #[serde(with = "crate::files::number")]
    pub f32_error: f64,
    /// Pairs among those whose measure in f64 is that of another rollout; unknown before schema 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f32_apart: Option<u64>,
    /// Measures within this distance of zero were run again in f64.
    #[serde(with = "crate::files::number")]
    pub band: f64,
    /// Pairs that were run again in f64: those, and all whose nominal start is certified.
    pub f64_reruns: u64,
    /// The fresh starts that the share is from, where the set was chosen among several; else it is from
    /// the draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub share: Option<ShareRecord>,
}

/// The state that slice and growth start from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateRecord {
    /// The state.
    #[serde(with = "crate::files::number")]
    pub x: Vec<f32>,
    /// 0 in the target, 1 globally certified, 2 in the verified ball, 3 otherwise.
    pub tier: u8,
    /// `V_check` there.
    #[serde(with = "crate::files::number::or_nan")]
    pub check_margin: f64,
    /// Target margin there.
    #[serde(with = "crate::files::number::or_nan")]
    pub target_margin: f64,
    /// Constraint margin there.
    #[serde(with = "crate::files::number::or_nan")]
    pub constraint_margin: f64,
}

/// `V_check` over two coordinates, the others frozen at the state; also `slice.npy`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SliceRecord {
    /// Across the columns.
    pub x: SliceAxisRecord,
    /// Along the rows.
    pub y: SliceAxisRecord,
    /// `V_check`, row by row: `[y.values.len(), x.values.len()]`.
    #[serde(with = "crate::files::number::or_nan")]
    pub check_margin: Vec<f32>,
    /// Target margin of each cell's state, same shape.
    #[serde(with = "crate::files::number::or_nan")]
    pub target_margin: Vec<f32>,
    /// Constraint margin of each cell's state, same shape.
    #[serde(with = "crate::files::number::or_nan")]
    pub constraint_margin: Vec<f32>,
}

/// One axis of the slice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SliceAxisRecord {
    /// Index of the state.
    pub state: usize,
    /// Values, ascending.
    #[serde(with = "crate::files::number")]
    pub values: Vec<f32>,
}

/// Local growth, section 5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrowthRecord {
    /// What came of it.
    pub outcome: GrowthOutcome,
    /// Where the centre was looked for.
    pub boundary: BoundarySearch,
    /// Whose boundary the centre lies on.
    #[serde(default, skip_serializing_if = "Around::is_set")]
    pub around: Around,
    /// The boundary point closest to the state.
    #[serde(with = "crate::files::number", default)]
    pub center: Option<Vec<f32>>,
    /// Its distance from the state in the coordinates that vary.
    #[serde(with = "crate::files::number", default)]
    pub distance: Option<f64>,
    /// Radius of the verified set; 0 if none was.
    #[serde(with = "crate::files::number")]
    pub radius: f64,
    /// Volume of the verified ball in the coordinates that vary.
    #[serde(with = "crate::files::number")]
    pub volume: f64,
    /// Whether each coordinate varies.
    pub varies: Vec<bool>,
    /// The rounds.
    pub rounds: Vec<RoundRecord>,
    /// The claim, where a ball was verified.
    pub claim: Option<Claim>,
    /// Some starts of the last round, at most 400, for the picture.
    pub samples: Vec<SampleRecord>,
    /// What growth upward fixed beforehand; none of Algorithm 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upward: Option<UpwardRecord>,
}

/// What came of local growth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GrowthOutcome {
    /// A round without failure: the ball is verified.
    Verified,
    /// All rounds had failures: never a certificate.
    Exhausted,
    /// No boundary of the certified set was found, so there was nothing to grow from.
    NoBoundary,
}

impl GrowthOutcome {
    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Verified => "verified",
            Self::Exhausted => "exhausted",
            Self::NoBoundary => "no-boundary",
        }
    }
}

/// One round of growth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoundRecord {
    /// Radius tried.
    #[serde(with = "crate::files::number")]
    pub radius: f64,
    /// Starts drawn.
    pub scenarios: u64,
    /// Of which failed.
    pub failures: u64,
    /// Distance of the nearest failure from the centre.
    #[serde(with = "crate::files::number", default)]
    pub nearest_failure: Option<f64>,
    /// Failures for a state that is not finite.
    pub non_finite: u64,
    /// Measures run again in f64.
    pub f64_reruns: u64,
}

/// A start and whether it reached the target safely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleRecord {
    /// The start.
    #[serde(with = "crate::files::number")]
    pub x: Vec<f32>,
    /// Whether its measure is positive.
    pub success: bool,
}

/// One line of the beta ledger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spending {
    /// The claim.
    pub claim: String,
    /// Which call, round or step.
    pub item: String,
    /// What it spent.
    #[serde(with = "crate::files::number")]
    pub beta: f64,
}

/// A few rollouts from the state's neighbourhood.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PictureRecord {
    /// Each: the states x_0..=x_T, `[T + 1, NX]`, up to one that is not finite, and whether it succeeded.
    pub rollouts: Vec<RolloutRecord>,
    /// What else is drawn, of a model as text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawn: Option<DrawnRecord>,
}

/// One rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutRecord {
    /// States, `[T + 1, NX]`; fewer where one is not finite, which ends them.
    #[serde(with = "crate::files::number")]
    pub states: Vec<Vec<f32>>,
    /// Whether the measure is positive.
    pub success: bool,
}

/// Wall time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// All of it, seconds.
    #[serde(with = "crate::files::number")]
    pub wall_seconds: f64,
    /// Threads used.
    pub threads: usize,
    /// Rollouts done.
    pub rollouts: u64,
}
