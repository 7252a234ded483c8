//! From names to types: the system and the policy that a configuration names, for one generic work.

use std::path::{Path, PathBuf};

use super::section::{Config, FormulaSection};
use crate::error::{Error, Result};
use crate::model;
use crate::policy::{Mlp, Policy};
use crate::rollout::Plant;
use crate::studies::BuiltIn;
use crate::system::System;

/// Work on a plant of any system and policy.
pub trait PlantWork {
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
        S: System<NX, NU> + Clone + Send + Sync + 'static,
        P: Policy<NX, NU> + Clone + Send + Sync + 'static;
}

/// Work on any system.
pub trait SystemWork {
    /// What comes of it.
    type Output;

    /// Does the work.
    ///
    /// # Errors
    /// Those of the work.
    fn run<S, const NX: usize, const NU: usize>(self, system: &S) -> Result<Self::Output>
    where
        S: System<NX, NU> + Clone + Send + Sync + 'static;
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
        let bytes = std::fs::read(&path).map_err(|e| Error::file(&path, e))?;
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
        match (&self.policy.file, &self.policy.formula) {
            (Some(file), _) => PolicySource::read(folder.join(file)),
            (None, Some(FormulaSection::Name(name))) => Ok(PolicySource::Formula(name.clone())),
            (None, Some(FormulaSection::Controls(_))) => {
                Ok(PolicySource::Formula("formula".to_owned()))
            }
            (None, None) => Err(Error::invalid("policy", "neither `file` nor `formula`")),
        }
    }

    /// The plant: model and policy, checked against each other.
    ///
    /// # Errors
    /// Those of [`Config::with_plant`].
    pub fn plant(&self, policy: &PolicySource) -> Result<model::Plant> {
        if let Some(model) = &self.model {
            return self.described_plant(model, policy);
        }
        self.with_plant(policy, AsModel)
    }

    /// Builds the system, checks the policy against it, and does `work` on both.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a parameter out of range or a formula that the system does not
    /// have, [`Error::File`] for a network of the wrong shape, and those of the work.
    pub fn with_plant<W: PlantWork>(&self, policy: &PolicySource, work: W) -> Result<W::Output> {
        let system = self.built_in()?;
        match policy {
            PolicySource::Formula(name) => system.with_formula(name, work),
            PolicySource::Network { path, network, .. } => {
                system.with_system(UnderNetwork { path, network, work })
            }
        }
    }

    /// Builds the system and does `work` on it.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a parameter out of range, and those of the work.
    pub fn with_system<W: SystemWork>(&self, work: W) -> Result<W::Output> {
        self.built_in()?.with_system(work)
    }

    /// The system, its parameters checked.
    pub(crate) fn built_in(&self) -> Result<BuiltIn> {
        let carried = || {
            let problem = "works for the systems that the program carries, not yet for a model; \
                           `certify`, `rollout`, `query` and `check` do, and `sweep --of certificate`";
            Error::invalid("this command", problem)
        };
        self.system.as_ref().ok_or_else(carried)?.checked()
    }
}

/// Makes a plant of plain data.
struct AsModel;

impl PlantWork for AsModel {
    type Output = model::Plant;

    fn run<S, P, const NX: usize, const NU: usize>(
        self,
        plant: Plant<'_, S, P>,
    ) -> Result<model::Plant>
    where
        S: System<NX, NU> + Clone + Send + Sync + 'static,
        P: Policy<NX, NU> + Clone + Send + Sync + 'static,
    {
        Ok(model::Plant::of(plant.system.clone(), plant.policy.clone()))
    }
}

/// Work on a system under the network of `path`, once it fits.
struct UnderNetwork<'a, W> {
    path: &'a Path,
    network: &'a Mlp,
    work: W,
}

impl<W: PlantWork> SystemWork for UnderNetwork<'_, W> {
    type Output = W::Output;

    fn run<S, const NX: usize, const NU: usize>(self, system: &S) -> Result<W::Output>
    where
        S: System<NX, NU> + Clone + Send + Sync + 'static,
    {
        check_network(system, self.path, self.network)?;
        self.work.run(Plant { system, policy: self.network })
    }
}

/// The refusal of the formula `name`.
pub(crate) fn no_formula<S, const NX: usize, const NU: usize>(
    system: &S,
    name: &str,
    has: &str,
) -> Error
where
    S: System<NX, NU>,
{
    let system = system.name();
    let problem = format!("`{name}` is unknown; formulas of {system}: {has}, or give a `file`");
    Error::invalid("policy.formula", problem)
}

/// Refuses the network of `path` if it does not fit the system.
pub(crate) fn check_network<S, const NX: usize, const NU: usize>(
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
