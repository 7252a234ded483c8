//! Keys of the deterministic certificate.

use serde::{Deserialize, Serialize};

/// What is certified without samples, and how much work goes into it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeterministicSection {
    /// How perturbed trajectories are enclosed, if at all.
    pub kind: Enclosing,
    /// Radius of the ball around each nominal start.
    pub radius: Radius,
    /// How perturbed trajectories are driven.
    pub control: Driving,
    /// Starts drawn from the box for the certified share.
    pub starts: u64,
    /// Starts among them, at most, whose certified radius is looked for.
    pub radii: u64,
    /// One minus the confidence of the interval of the share.
    pub beta: f64,
}

impl Default for DeterministicSection {
    fn default() -> Self {
        Self {
            kind: Enclosing::None,
            radius: Radius::Named(AsDeviation::Deviation),
            control: Driving::Deviation,
            starts: 4000,
            radii: 100,
            beta: 1e-3,
        }
    }
}

/// How perturbed trajectories are enclosed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Enclosing {
    /// Not at all: nothing is certified without samples.
    None,
    /// See [`crate::scenario::deterministic::Kind::Pieces`].
    Pieces,
    /// See [`crate::scenario::deterministic::Kind::Tube`].
    Tube,
    /// See [`crate::scenario::deterministic::Kind::Lipschitz`].
    Lipschitz,
}

/// The radius: that of the deviation bound, or given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a radius or \"deviation\"")]
pub enum Radius {
    /// `"deviation"`.
    Named(AsDeviation),
    /// A number.
    Given(f64),
}

/// The word that stands for what the deviation bound has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AsDeviation {
    /// As the deviation bound has it.
    Deviation,
}

/// How perturbed trajectories are driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Driving {
    /// As those of the deviation bound.
    Deviation,
    /// By the controls of the nominal rollout.
    Replay,
    /// By the policy in feedback.
    ClosedLoop,
}
