//! From names to a plant: the system and the policy that a configuration names.

use std::path::{Path, PathBuf};

use super::named_system::NamedSystem;
use super::registry::Registered;
use super::section::{Config, FormulaSection};
use crate::error::{Error, Result};
use crate::files::{RECORD_BYTES, read};
use crate::model::{Controller, Model, Plant};
use crate::policy::Mlp;
use crate::studies::BuiltIn;

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
    /// Those of [`PolicySource::read`], of a model with the key that names the file, as
    /// [`Error::Invalid`]; [`Error::Invalid`] without file and formula.
    pub fn policy_source(&self, folder: &Path) -> Result<PolicySource> {
        let missing = || {
            let problem = "no policy; give `file`, a safetensors file, or `formula`; `reachcast train` \
                           makes the file";
            self.placed(Error::invalid("policy", problem))
        };
        match (&self.policy.file, &self.policy.formula) {
            (Some(file), _) => PolicySource::read(folder.join(file)).map_err(|e| self.of_key(e)),
            (None, Some(FormulaSection::Name(name))) => Ok(PolicySource::Formula(name.clone())),
            (None, Some(FormulaSection::Controls(_))) => {
                Ok(PolicySource::Formula("formula".to_owned()))
            }
            (None, None) => Err(missing()),
        }
    }

    /// What is wrong with the file of the policy, for a model at the key that names it.
    fn of_key(&self, error: Error) -> Error {
        match error {
            Error::File { path, problem } if self.model.is_some() => {
                let problem = format!("{}: {problem}", path.display());
                self.placed(Error::invalid("policy.file", problem))
            }
            other => other,
        }
    }

    /// The plant: model and policy, checked against each other.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a parameter out of range or a formula that the system does not
    /// have, [`Error::File`] for a network of the wrong shape, and those of a description.
    pub fn plant(&self, policy: &PolicySource) -> Result<Plant> {
        self.built(policy).map_err(|error| self.placed(error))
    }

    fn built(&self, policy: &PolicySource) -> Result<Plant> {
        if let Some(model) = &self.model {
            return self.described_plant(model, policy);
        }
        match policy {
            PolicySource::Formula(name) => match self.registered()? {
                Some(plant) => plant.under_formula(name),
                None => self.built_in()?.under_formula(name),
            },
            PolicySource::Network { path, network, .. } => {
                let model = self.plain_model()?;
                let controller = Controller::network_of(&model, network.clone());
                let controller = controller.map_err(|problem| Error::file(path, problem))?;
                Ok(Plant::new(model, controller))
            }
        }
    }

    /// The plant of the registry, where the configuration names one.
    pub(super) fn registered(&self) -> Result<Option<Registered>> {
        match &self.system {
            Some(NamedSystem::Registered(section)) => {
                let made = self.registry.make(&section.name, &section.numbers)?;
                Ok(Some(made.plant))
            }
            _ => Ok(None),
        }
    }

    /// The model by itself, its parameters checked.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a parameter out of range, and those of a description.
    pub fn plain_model(&self) -> Result<Model> {
        if let Some(model) = self.described_model() {
            return model.map_err(|error| self.placed(error));
        }
        match self.registered()? {
            Some(plant) => Ok(Model::clone(plant.model())),
            None => self.built_in().map(|system| system.model()),
        }
    }

    /// The system, its parameters checked.
    pub(crate) fn built_in(&self) -> Result<BuiltIn> {
        let carried = || {
            let problem = "works for the systems that the program carries, not yet for a model; \
                           `certify`, `rollout`, `train`, `query` and `check` do, and `sweep --of certificate`";
            Error::invalid("this command", problem)
        };
        match &self.system {
            Some(NamedSystem::Carried(system)) => system.checked(),
            _ => Err(carried()),
        }
    }
}

/// Refuses the network of `path` if it does not fit the model.
pub(crate) fn check_network(model: &Model, path: &Path, network: &Mlp) -> Result<()> {
    let names: Vec<&str> = model.states.iter().map(|axis| axis.name.as_str()).collect();
    let fits = network.check_fits(&names, model.controls.len());
    fits.map_err(|problem| Error::file(path, problem))
}
