//! What a sequential claim is asked for, and what is stored of it.

use serde::{Deserialize, Serialize};

use super::claim::Claim;

/// Whose starts a sequential claim is about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SequentialOf {
    /// Nobody's: no such claim is asked for.
    #[default]
    None,
    /// Perturbed starts whose nominal start, uniform in the box, is certified.
    Set,
    /// Starts that are uniform in the box.
    Box,
    /// Starts that are uniform in a ball around the state, in the coordinates that growth varies.
    Ball,
}

/// A claim whose starts are looked at one after the other, `docs/method.md` section 8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequentialSettings {
    /// Whose starts.
    pub of: SequentialOf,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Most draws, of the box for `Set`.
    pub most: u64,
    /// Radius of the ball, for `Ball`.
    pub radius: f32,
    /// Natural logarithm of the product of the e-values of *all* earlier attempts at this claim, those
    /// that failed too; 0 without any.
    pub carried: f64,
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SequentialOutcome {
    /// The evidence reached `1 / beta`: the claim holds.
    Certified,
    /// The starts say that the risk is too large.
    Hopeless,
    /// The draws came to their end first.
    Undecided,
}

/// The evidence after some starts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvidencePoint {
    /// Starts so far.
    pub starts: u64,
    /// Of which failed.
    pub failures: u64,
    /// Natural logarithm of the e-process.
    #[serde(with = "crate::files::number")]
    pub log_e: f64,
}

/// A sequential claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SequentialRecord {
    /// Whose starts.
    pub of: SequentialOf,
    /// The claim; its risk is 1 where it was not obtained.
    pub claim: Claim,
    /// What came of it.
    pub outcome: SequentialOutcome,
    /// Draws until then, those outside of the certified set too.
    pub draws: u64,
    /// Natural logarithm of the e-process at the end, with what was carried over: the e-value of this
    /// attempt and all before it.
    #[serde(with = "crate::files::number")]
    pub log_e: f64,
    /// What it had to reach.
    #[serde(with = "crate::files::number")]
    pub log_needed: f64,
    /// Natural logarithm of the evidence that the risk is too large.
    #[serde(with = "crate::files::number")]
    pub log_against: f64,
    /// What was carried over from earlier attempts.
    #[serde(with = "crate::files::number")]
    pub carried: f64,
    /// The process, every start at first, then some 32 points for each doubling.
    pub process: Vec<EvidencePoint>,
}
