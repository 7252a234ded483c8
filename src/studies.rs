//! The plants and studies that come with the program: the one file outside of a study that names it.

use serde::{Deserialize, Serialize};

use crate::config::{Config, Profile, no_formula, profile};
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::race::system::{Cone, DroneRace};
use crate::scenario::limits::positive_f32;
use crate::system::{BangBang, DoubleIntegrator};

pub(crate) use crate::race::bench::export::export;
pub(crate) use crate::race::bench::workload::work;
pub(crate) use crate::race::command::StudyCommand;
pub use crate::race::settings::RaceSettings as StudySettings;

/// Names of the systems that a configuration can ask for.
pub(crate) const SYSTEMS: [&str; 2] = ["drone-race", "double-integrator"];

/// The defaults of `profile` for the system `name`, without a policy; none if it is unknown.
pub(crate) fn defaults(profile: Profile, name: &str) -> Option<Config> {
    match name {
        "drone-race" => Some(crate::race::defaults::config(profile)),
        "double-integrator" => Some(profile::double_integrator(profile)),
        _ => None,
    }
}

/// The system and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "name", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SystemSection {
    /// [`DroneRace`].
    DroneRace {
        /// Form of the collision cone.
        cone: Cone,
        /// Acceleration of the ego at full control, m/s^2.
        ego_gain: f64,
        /// Factor on the opponent's feedback.
        opponent_gain: f64,
        /// Whether the constraint keeps the ego below 1 m/s.
        speed_limit: bool,
    },
    /// [`DoubleIntegrator`].
    DoubleIntegrator {
        /// Half width of the target interval, m.
        target: f64,
        /// Half width of the constraint interval, m.
        corridor: f64,
        /// Bound on the acceleration, m/s^2.
        acceleration: f64,
    },
}

impl SystemSection {
    /// The system, its parameters checked.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a parameter out of range.
    pub(crate) fn checked(&self) -> Result<BuiltIn> {
        let number = |key: &str, value: f64| positive_f32(&format!("system.{key}"), value);
        Ok(match *self {
            Self::DroneRace { cone, ego_gain, opponent_gain, speed_limit } => {
                BuiltIn::DroneRace(DroneRace {
                    ego_gain: number("ego_gain", ego_gain)?,
                    opponent_gain: number("opponent_gain", opponent_gain)?,
                    cone,
                    speed_limit,
                })
            }
            Self::DoubleIntegrator { target, corridor, acceleration } => {
                BuiltIn::DoubleIntegrator(DoubleIntegrator {
                    target: number("target", target)?,
                    corridor: number("corridor", corridor)?,
                    acceleration: number("acceleration", acceleration)?,
                })
            }
        })
    }
}

/// Any of the systems that a configuration can ask for.
pub(crate) enum BuiltIn {
    /// Two drones and a gate.
    DroneRace(DroneRace),
    /// A unit mass on a line.
    DoubleIntegrator(DoubleIntegrator),
}

impl BuiltIn {
    /// The system as data.
    pub(crate) fn model(&self) -> Model {
        match self {
            Self::DroneRace(system) => Model::of(*system),
            Self::DoubleIntegrator(system) => Model::of(*system),
        }
    }

    /// The system under its formula `name`.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a formula that the system does not have.
    pub(crate) fn under_formula(&self, name: &str) -> Result<Plant> {
        match self {
            Self::DoubleIntegrator(system) if name == "bang-bang" => {
                let policy = BangBang { acceleration: system.acceleration };
                Ok(Plant::of(*system, policy))
            }
            Self::DoubleIntegrator(_) => Err(no_formula(&self.model().name, name, "bang-bang")),
            Self::DroneRace(_) => Err(no_formula(&self.model().name, name, "none")),
        }
    }
}
