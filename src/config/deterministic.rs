//! The section of the deterministic certificate.

use serde::{Deserialize, Serialize};

use super::section::Config;
use crate::error::{Error, Result};
use crate::rollout::PairControl;
use crate::scenario::deterministic::Kind;
use crate::scenario::deterministic_settings::DeterministicSettings;
use crate::scenario::limits::positive_f32;

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
    /// See [`Kind::Pieces`].
    Pieces,
    /// See [`Kind::Tube`].
    Tube,
    /// See [`Kind::Lipschitz`].
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

impl Config {
    /// The deterministic certificate, where there is to be one.
    pub(super) fn deterministic_settings(&self) -> Result<Option<DeterministicSettings>> {
        let DeterministicSection { starts, radii, beta, .. } = self.deterministic;
        let kind = match self.deterministic.kind {
            Enclosing::None => return Ok(None),
            Enclosing::Pieces => Kind::Pieces,
            Enclosing::Tube => Kind::Tube,
            Enclosing::Lipschitz => Kind::Lipschitz,
        };
        let radius = match self.deterministic.radius {
            Radius::Named(AsDeviation::Deviation) => self.deviation.radius,
            Radius::Given(radius) => radius,
        };
        let control = match self.deterministic.control {
            Driving::Deviation => self.deviation.control,
            Driving::Replay => PairControl::Replay,
            Driving::ClosedLoop => PairControl::ClosedLoop,
        };
        if kind == Kind::Pieces && control == PairControl::ClosedLoop {
            let problem = "`pieces` needs replayed controls; use `tube`, or `control = \"replay\"`";
            return Err(Error::invalid("deterministic.kind", problem));
        }
        let radius = positive_f32("deterministic.radius", radius)?;
        let settings = DeterministicSettings { kind, radius, control, starts, radii, beta };
        settings.check().map(|()| Some(settings))
    }
}
