//! What a certificate stores of its deterministic part.

use serde::{Deserialize, Serialize};

use super::deterministic::Kind;
use crate::rollout::PairControl;

/// The deterministic certificate, `docs/method.md` section 13.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeterministicRecord {
    /// The certificate in words.
    pub statement: String,
    /// How perturbed trajectories are enclosed.
    pub kind: Kind,
    /// How they are driven.
    pub control: PairControl,
    /// Radius of the ball around each nominal start.
    #[serde(with = "crate::files::number")]
    pub radius: f64,
    /// Starts drawn from the box.
    pub starts: u64,
    /// Of which a rollout reaches the target safely: the others are not looked at.
    pub reached: u64,
    /// Of which every start in the ball is certified to.
    pub certified: u64,
    /// One minus the confidence of the interval below.
    #[serde(with = "crate::files::number")]
    pub beta: f64,
    /// Two-sided interval of the share of the box that is certified.
    #[serde(with = "crate::files::number")]
    pub share_interval: [f64; 2],
    /// Certified radii of some starts that a rollout reaches the target from.
    pub radii: RadiiRecord,
    /// Largest distance of the f32 rollouts from those starts to any state of the enclosure of the nominal.
    #[serde(with = "crate::files::number::or_infinite")]
    pub f32_distance: f64,
}

/// Certified radii, each rounded down by the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadiiRecord {
    /// Starts that they are of.
    pub starts: u64,
    /// The largest radius looked for.
    #[serde(with = "crate::files::number")]
    pub most: f64,
    /// Of all: a tenth of the starts has at most the first, half at most the second, nine tenths at most the third.
    #[serde(with = "crate::files::number")]
    pub quantiles: Vec<f64>,
}
