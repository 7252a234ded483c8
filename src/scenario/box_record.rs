//! What a certificate says of the whole box.

use serde::{Deserialize, Serialize};

use super::claim::Claim;
use super::counterexamples::{FailingPair, FailingStart};
use crate::system::Parameter;

/// How the starts of the whole box fare, and the worst of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxRecord {
    /// Failure of a start of the box; its risk asked for is `global.box_risk`.
    pub claim: Claim,
    /// The certified set beside the whole box, in words.
    pub verdict: String,
    /// Starts drawn from the box: the nominal starts of the conditional sample.
    pub draws: u64,
    /// Those that fail under the policy.
    pub failures: u64,
    /// Those of them that fail for a state that is not finite.
    pub non_finite: u64,
    /// Two-sided interval of the probability that a start fails.
    #[serde(with = "crate::files::number")]
    pub risk_interval: [f64; 2],
    /// Measures run again in f64.
    pub f64_reruns: u64,
    /// The parameters of the model that all of this is about.
    pub parameters: Vec<Parameter>,
    /// The worst failing starts, by measure and index.
    pub starts: Vec<FailingStart>,
    /// The worst failing pairs whose nominal start is certified, by measure and index.
    pub pairs: Vec<FailingPair>,
}
