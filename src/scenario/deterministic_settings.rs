//! What a deterministic certificate is asked for.

use serde::{Deserialize, Serialize};

use super::deterministic::Kind;
use crate::rollout::PairControl;

/// The deterministic certificate, section 13.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeterministicSettings {
    /// How perturbed trajectories are enclosed.
    pub kind: Kind,
    /// Radius of the ball around each nominal start.
    pub radius: f32,
    /// How perturbed trajectories are driven.
    pub control: PairControl,
    /// Starts drawn from the box for the certified share.
    pub starts: u64,
    /// Starts among them, at most, whose certified radius is looked for.
    pub radii: u64,
    /// One minus the confidence of the interval of the share.
    pub beta: f64,
}
