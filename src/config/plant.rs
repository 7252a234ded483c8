//! From names to types: the system and the policy that a configuration names, for one generic job.

use std::path::{Path, PathBuf};

use super::section::{Config, FormulaSection, SystemSection};
use super::settings::positive_f32;
use crate::error::{Error, Result};
use crate::files::{RECORD_BYTES, read};
use crate::model;
use crate::policy::{Mlp, Policy};
use crate::rollout::Plant;
use crate::system::{Axis, BangBang, DoubleIntegrator, DroneRace, System};

/// Work on a plant of any system and policy.
pub trait Job {
    /// What comes of it.
    type Output;

    /// Does the work.
    ///
    /// # Errors
    /// Those of the work.
    fn run<S, P, const NX: usize, const NU: usize>(
        self,
        plant: Plant<'_, S, P>,
    ) -> Result<Self::Output>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>;
}

/// Work on any system.
pub trait SystemJob {
    /// What comes of it.
    type Output;

    /// Does the work.
    ///
    /// # Errors
    /// Those of the work.
    fn run<S, const NX: usize, const NU: usize>(self, system: &S) -> Result<Self::Output>
    where
        S: System<NX, NU>;
}

/// The policy that a configuration names: a formula, or a network and the bytes of its file.
#[derive(Clone, Debug)]
pub enum PolicySource {
    /// A formula.
    Formula(String),
    /// A network.
    Network {
        /// Where it was read.
        path: PathBuf,
        /// The file as it was read, for a copy that is sure to be the same.
        bytes: Vec<u8>,
        /// The network.
        network: Mlp,
    },
}

impl PolicySource {
    /// Reads the safetensors file at `path`.
    ///
    /// # Errors
    /// [`Error::File`] if it is missing, damaged, or has a weight that is not finite.
    pub fn read(path: PathBuf) -> Result<Self> {
        let bytes = read(&path, RECORD_BYTES).map_err(|e| Error::file(&path, e))?;
        let network = Mlp::from_bytes(&bytes).map_err(|problem| Error::file(&path, problem))?;
        Ok(Self::Network { path, bytes, network })
    }
}

impl Config {
    /// The policy; a file is sought relative to `folder`, where the configuration lies.
    ///
    /// # Errors
    /// Those of [`PolicySource::read`]; [`Error::Invalid`] without file and formula.
    pub fn policy_source(&self, folder: &Path) -> Result<PolicySource> {
        let missing = || self.placed(Error::invalid("policy", "neither `file` nor `formula`"));
        match (&self.policy.file, &self.policy.formula) {
            (Some(file), _) => PolicySource::read(folder.join(file)),
            (None, Some(FormulaSection::Name(name))) => Ok(PolicySource::Formula(name.clone())),
            (None, Some(FormulaSection::Controls(_))) => {
                Ok(PolicySource::Formula("formula".to_owned()))
            }
            (None, None) => Err(missing()),
        }
    }

    /// The plant: model and policy, checked against each other.
    ///
    /// # Errors
    /// Those of [`Config::with_plant`].
    pub fn plant(&self, policy: &PolicySource) -> Result<model::Plant> {
        self.built(policy).map_err(|error| self.placed(error))
    }

    fn built(&self, policy: &PolicySource) -> Result<model::Plant> {
        if let Some(model) = &self.model {
            return self.described_plant(model, policy);
        }
        let network = |axes: &[Axis], controls: usize, path: &Path, network: &Mlp| {
            let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            network.check_fits(&names, controls).map_err(|problem| Error::file(path, problem))?;
            Ok(network.clone())
        };
        match (self.any_system()?, policy) {
            (AnySystem::DroneRace(system), PolicySource::Formula(name)) => {
                Err(no_formula(&system, name, "none"))
            }
            (AnySystem::DoubleIntegrator(system), PolicySource::Formula(name)) => {
                if name != "bang-bang" {
                    return Err(no_formula(&system, name, "bang-bang"));
                }
                let acceleration = system.acceleration;
                Ok(model::Plant::of(system, BangBang { acceleration }))
            }
            (AnySystem::DroneRace(system), PolicySource::Network { path, network: mlp, .. }) => {
                Ok(model::Plant::of(system, network(&system.states(), 3, path, mlp)?))
            }
            (
                AnySystem::DoubleIntegrator(system),
                PolicySource::Network { path, network: mlp, .. },
            ) => Ok(model::Plant::of(system, network(&system.states(), 1, path, mlp)?)),
        }
    }

    /// Builds the system, checks the policy against it, and runs `job` on both.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a parameter out of range or a formula that the system does not
    /// have, [`Error::File`] for a network of the wrong shape, and those of the job.
    pub fn with_plant<J: Job>(&self, policy: &PolicySource, job: J) -> Result<J::Output> {
        match (self.any_system()?, policy) {
            (AnySystem::DroneRace(system), PolicySource::Formula(name)) => {
                Err(no_formula(&system, name, "none"))
            }
            (AnySystem::DoubleIntegrator(system), PolicySource::Formula(name)) => {
                if name != "bang-bang" {
                    return Err(no_formula(&system, name, "bang-bang"));
                }
                let policy = &BangBang { acceleration: system.acceleration };
                job.run(Plant { system: &system, policy })
            }
            (AnySystem::DroneRace(system), PolicySource::Network { path, network, .. }) => {
                with_network(&system, path, network, job)
            }
            (AnySystem::DoubleIntegrator(system), PolicySource::Network { path, network, .. }) => {
                with_network(&system, path, network, job)
            }
        }
    }

    /// Builds the system and runs `job` on it.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a parameter out of range, and those of the job.
    pub fn with_system<J: SystemJob>(&self, job: J) -> Result<J::Output> {
        match self.any_system()? {
            AnySystem::DroneRace(system) => job.run(&system),
            AnySystem::DoubleIntegrator(system) => job.run(&system),
        }
    }

    /// The drone race and its policy, a network.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another system, a formula or a parameter out of range,
    /// [`Error::File`] for a network of the wrong shape.
    pub fn race_plant<'a>(&self, policy: &'a PolicySource) -> Result<(DroneRace, &'a Mlp)> {
        let AnySystem::DroneRace(system) = self.any_system()? else {
            return Err(Error::invalid("system.name", "only `drone-race` has races"));
        };
        match policy {
            PolicySource::Formula(name) => Err(no_formula(&system, name, "none")),
            PolicySource::Network { path, network, .. } => {
                check_network(&system, path, network)?;
                Ok((system, network))
            }
        }
    }

    /// The system, its parameters checked.
    fn any_system(&self) -> Result<AnySystem> {
        let carried = || {
            let problem = "works for the systems that the program carries, not yet for a model; \
                           `certify`, `rollout`, `query` and `check` do, and `sweep --of certificate`";
            Error::invalid("this command", problem)
        };
        let number = |key: &str, value: f64| positive_f32(&format!("system.{key}"), value);
        Ok(match self.system.clone().ok_or_else(carried)? {
            SystemSection::DroneRace { cone, ego_gain, opponent_gain, speed_limit } => {
                AnySystem::DroneRace(DroneRace {
                    ego_gain: number("ego_gain", ego_gain)?,
                    opponent_gain: number("opponent_gain", opponent_gain)?,
                    cone,
                    speed_limit,
                })
            }
            SystemSection::DoubleIntegrator { target, corridor, acceleration } => {
                AnySystem::DoubleIntegrator(DoubleIntegrator {
                    target: number("target", target)?,
                    corridor: number("corridor", corridor)?,
                    acceleration: number("acceleration", acceleration)?,
                })
            }
        })
    }
}

/// Any of the systems that a configuration can ask for.
enum AnySystem {
    DroneRace(DroneRace),
    DoubleIntegrator(DoubleIntegrator),
}

/// The refusal of the formula `name`.
fn no_formula<S, const NX: usize, const NU: usize>(system: &S, name: &str, has: &str) -> Error
where
    S: System<NX, NU>,
{
    let system = system.name();
    let problem = format!("`{name}` is unknown; formulas of {system}: {has}, or give a `file`");
    Error::invalid("policy.formula", problem)
}

/// Runs `job` with a network that fits the system.
fn with_network<J: Job, S, const NX: usize, const NU: usize>(
    system: &S,
    path: &Path,
    network: &Mlp,
    job: J,
) -> Result<J::Output>
where
    S: System<NX, NU>,
{
    check_network(system, path, network)?;
    job.run(Plant { system, policy: network })
}

/// Refuses the network of `path` if it does not fit the system.
fn check_network<S, const NX: usize, const NU: usize>(
    system: &S,
    path: &Path,
    network: &Mlp,
) -> Result<()>
where
    S: System<NX, NU>,
{
    let states = system.states();
    let names = states.each_ref().map(|axis| axis.name.as_str());
    network.check_fits(&names, NU).map_err(|problem| Error::file(path, problem))
}
