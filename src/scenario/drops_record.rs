//! What margin drops, the sequence of levels and the calibration of the score leave in a record.

use serde::{Deserialize, Serialize};

use super::bound::interval;
use super::claim::Claim;
use crate::rollout::drops::Shapes;

/// The bound on margin drops, `docs/method.md` section 3: pairs lose at most `level` times the shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DropsRecord {
    /// The claim; its failures are the pairs discarded.
    pub claim: Claim,
    /// Pairs of the pilot that fixed the shapes.
    pub pilot: u64,
    /// `rho_t`, what the target margin is measured in, `[T + 1]`.
    #[serde(with = "crate::files::number")]
    pub target_shape: Vec<f64>,
    /// `kappa_t`, what the constraint margin is measured in, `[T + 1]`.
    #[serde(with = "crate::files::number")]
    pub constraint_shape: Vec<f64>,
    /// Lambda: no pair that was not discarded drops by more; never below 0.
    #[serde(with = "crate::files::number")]
    pub level: f64,
    /// The largest of all pairs, the discarded ones included; minus infinity where no step of any counts.
    #[serde(with = "crate::files::number")]
    pub largest: f64,
    /// Step and margin that the largest pair has it at.
    pub widest: Option<WidestRecord>,
    /// Pairs of which a perturbed state was not finite before the nominal rollout failed.
    pub non_finite: u64,
    /// How much of the box is certified at `level`, from fresh starts.
    pub share: ShareRecord,
    /// How many of the first fresh starts constants times the deviation bound would certify; none where
    /// there are no constants.
    pub by_constants: Option<SeenRecord>,
}

/// A count without a claim, for comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenRecord {
    /// Starts drawn from the box.
    pub draws: u64,
    /// Of which lie in the set, by signs in f32.
    pub inside: u64,
}

impl DropsRecord {
    /// The shapes.
    pub fn shapes(&self) -> Shapes {
        Shapes { target: self.target_shape.clone(), constraint: self.constraint_shape.clone() }
    }
}

/// Where a drop was largest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WidestRecord {
    /// The pair, by index.
    pub pair: u64,
    /// The step.
    pub step: u64,
    /// `target` or `constraint`.
    pub margin: String,
}

/// The share of the box that a set has, from fresh starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShareRecord {
    /// Starts drawn from the box.
    pub draws: u64,
    /// Of which lie in the set.
    pub inside: u64,
    /// Two-sided interval of the share.
    #[serde(with = "crate::files::number")]
    pub interval: [f64; 2],
}

impl ShareRecord {
    /// The share that `inside` of `draws` starts support.
    pub(super) fn new(inside: u64, draws: u64, beta: f64) -> Self {
        let (low, high) = interval(inside, draws, beta);
        Self { draws, inside, interval: [low, high] }
    }

    /// The share as a point.
    pub fn point(&self) -> f64 {
        self.inside as f64 / self.draws.max(1) as f64
    }
}

/// The sequence of sets from strict to lax, `docs/method.md` section 4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SequenceRecord {
    /// Conditional risk asked for; none where the one set is reported with the risk obtained.
    #[serde(with = "crate::files::number", default)]
    pub risk: Option<f64>,
    /// Starts of the pilot that fixed the levels.
    pub pilot: u64,
    /// Draws that the strictest set is to hold.
    pub start: Option<u64>,
    /// Draws that the risk asked for needs if none fails.
    pub required: Option<u64>,
    /// What came of it.
    pub outcome: SequenceOutcome,
    /// The levels, strict to lax, as fixed by the pilot; counts of those that were tested.
    pub levels: Vec<LevelRecord>,
    /// Which of them is the certified set.
    pub chosen: usize,
}

impl SequenceRecord {
    /// The level of the certified set; an edited record may have none.
    pub fn level(&self) -> Option<f64> {
        self.levels.get(self.chosen).map(|level| level.level)
    }

    /// The risk of the certified set that was asked or looked for, where it was not obtained.
    pub fn missed(&self) -> Option<f64> {
        self.risk.filter(|_| self.outcome != SequenceOutcome::Accepted)
    }
}

/// What came of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SequenceOutcome {
    /// The risk asked for was obtained, at the last level that was accepted.
    Accepted,
    /// The strictest level was refused: it is reported with the risk obtained.
    Refused,
    /// Too few draws for a sequence, or no risk asked for: one set, with the risk obtained.
    Single,
}

impl SequenceOutcome {
    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::Refused => "refused",
            Self::Single => "one set",
        }
    }
}

/// One level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LevelRecord {
    /// The set: starts with a score above it.
    #[serde(with = "crate::files::number")]
    pub level: f64,
    /// Draws in the set; none where the sequence had stopped.
    pub accepted: Option<u64>,
    /// Of which the perturbed rollout failed.
    pub failures: Option<u64>,
    /// Upper bound on the conditional risk.
    #[serde(with = "crate::files::number", default)]
    pub risk: Option<f64>,
}

/// Calibration of the reach-avoid measure, `docs/method.md` section 4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationRecord {
    /// The joint claim; its failures are the failing pairs discarded.
    pub claim: Claim,
    /// Alpha: the set is the starts with a reach-avoid measure above it; never below 0.
    #[serde(with = "crate::files::number")]
    pub level: f64,
    /// Pairs of which the perturbed rollout failed.
    pub failing: u64,
    /// How much of the box the set has, from fresh starts.
    pub share: ShareRecord,
}
