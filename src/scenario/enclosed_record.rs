//! What a certificate stores of a certified set that rests on no sample.

use serde::{Deserialize, Serialize};

use super::deterministic::Kind;
use crate::rollout::PairControl;
use crate::rounding::{lower, upper};

/// That the certified set is deterministic, and of which perturbations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnclosedRecord {
    /// What is claimed of the set, in words.
    pub statement: String,
    /// How perturbed trajectories are enclosed.
    pub kind: Kind,
    /// How they are driven.
    pub control: PairControl,
    /// Radius of the ball around each state of the set.
    #[serde(with = "crate::files::number")]
    pub radius: f64,
}

impl EnclosedRecord {
    /// The record of an enclosure whose starts do `deed`: *reaches the target safely*.
    pub(super) fn new(kind: Kind, control: PairControl, radius: f64, deed: &str) -> Self {
        let record = Self { statement: String::new(), kind, control, radius };
        Self { statement: record.sentence(deed), ..record }
    }

    /// What is claimed of the set.
    fn sentence(&self, deed: &str) -> String {
        format!(
            "The certified set is deterministic: every start within {} of a state of it {deed} {}, {}. No \
             risk, no confidence and no Lipschitz constant: it holds in real arithmetic with the f32 \
             parameters of model and policy; f32 rollouts round.",
            lower(self.radius),
            self.driven(),
            self.how()
        )
    }

    /// The set in a few words.
    pub fn short(&self) -> String {
        format!(
            "every start within {} of it succeeds {}, {} (no sample, no risk)",
            lower(self.radius),
            self.driven(),
            self.how()
        )
    }

    fn driven(&self) -> &'static str {
        match self.control {
            PairControl::Replay => "under the controls of the nominal start",
            PairControl::ClosedLoop => "under the policy in feedback",
        }
    }

    fn how(&self) -> &'static str {
        match self.kind {
            Kind::Pieces => "enclosed piece by piece (`pieces`)",
            Kind::Tube => "enclosed in a tube (`tube`)",
            Kind::Lipschitz => "enclosed by Lipschitz constants of the steps (`lipschitz`)",
        }
    }

    /// Why no start is certified, and what may help.
    pub(super) fn reasons(&self) -> Vec<String> {
        let feedback = match (self.kind, self.control) {
            (Kind::Pieces, _) => ", `global.tightening = \"drops\"`, which bounds a risk instead",
            (_, PairControl::Replay) => {
                ", `pieces` where the plant is linear, `drops`, which bounds a risk instead"
            }
            (_, PairControl::ClosedLoop) => {
                ", `deviation.control = \"replay\"`, `drops`, which bounds a risk instead"
            }
        };
        vec![format!(
            "No start is certified: around none of those that were drawn is the whole ball of radius {} shown \
             to succeed, {}. What may help: a smaller perturbation (`deviation.radius`){feedback}.",
            upper(self.radius),
            self.how()
        )]
    }
}
