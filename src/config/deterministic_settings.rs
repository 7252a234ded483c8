//! From keys to numbers: the deterministic certificate as a configuration asks for it.

use super::deterministic::{AsDeviation, DeterministicSection, Driving, Enclosing, Radius};
use super::section::Config;
use crate::error::{Error, Result};
use crate::rollout::PairControl;
use crate::scenario::deterministic::Kind;
use crate::scenario::deterministic_settings::DeterministicSettings;
use crate::scenario::limits::positive_f32;

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
