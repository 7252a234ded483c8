//! Configurations of a plant that is given as text: defaults that follow from its states, the plant
//! with its policy.

use std::path::Path;

use toml::{Table, Value};

use super::plant::PolicySource;
use super::profile;
use super::section::{Config, PolicySection, Profile};
use super::sources::UNNAMED;
use crate::error::{Error, Result};
use crate::files::NETWORK_COPIES;
use crate::model::Plant;
use crate::model::text::{Description, MOST_NETWORKS, NetworkFile, Origin, read_table};

/// The sections that describe a plant.
const SECTIONS: [&str; 2] = ["model", "policy"];

/// Name of the copy of the network number `i`, from 0, that formulas of a model call.
///
/// # Panics
/// Beyond [`crate::model::text::MOST_NETWORKS`].
pub fn copy_name(i: usize) -> &'static str {
    NETWORK_COPIES[i]
}

// Every network has a name for its copy.
const _: () = assert!(NETWORK_COPIES.len() == MOST_NETWORKS);

/// Whether `given` describes its plant itself.
pub(super) fn is_described(given: &Table) -> bool {
    given.contains_key("model")
}

/// The defaults of `profile` for the plant that `given` describes, with the description itself.
///
/// # Errors
/// [`Error::Invalid`] naming what is wrong with the description, by the file `origin` with its text.
pub(super) fn defaults(profile: Profile, given: &Table, origin: Origin) -> Result<Table> {
    if given.contains_key("system") {
        let problem = "both `model` and `system` are given; keep one of them";
        return Err(Error::invalid(origin.name, problem));
    }
    let description = read_table(&sections(given), &origin)?;
    let axes: Vec<_> = description.states.iter().map(|state| state.axis.clone()).collect();
    let config = profile::described(profile, &axes);
    let refused =
        |e: toml::ser::Error| Error::invalid(format!("{}: defaults", origin.name), e.to_string());
    let mut table = Table::try_from(config).map_err(refused)?;
    // Their keys are those of the description, which knows which of them are right.
    table.extend(sections(given));
    Ok(table)
}

/// The keys that a setting may have below `model`: those of the file, and those of its time.
pub(super) fn settable(file: &Table) -> Table {
    let mut valid = sections(file);
    if let Some(Value::Table(model)) = valid.get_mut("model") {
        let time = model.entry("time").or_insert_with(|| Value::Table(Table::new()));
        if let Value::Table(time) = time {
            for key in ["period", "integrator", "substeps"] {
                time.entry(key).or_insert(Value::Integer(0));
            }
        }
    }
    valid
}

/// The sections of `given` that describe a plant.
fn sections(given: &Table) -> Table {
    let of = |key: &str| Some((key.to_owned(), given.get(key)?.clone()));
    SECTIONS.into_iter().filter_map(of).collect()
}

impl Config {
    /// The networks that formulas call, beside the file of `origin`.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the formula whose network cannot be read or does not fit.
    pub(super) fn networks_beside(&self, origin: &Origin) -> Result<Vec<NetworkFile>> {
        match &self.model {
            Some(model) => self
                .description(model, &self.policy, origin)?
                .networks(|_, name| origin.folder.join(name)),
            None => Ok(Vec::new()),
        }
    }

    /// The same configuration with the networks that its formulas call, copies of which lie in `folder`:
    /// that of number `i` as [`copy_name`] says, whatever the formulas call it.
    ///
    /// # Errors
    /// Those of the description; [`Error::Invalid`] naming the formula whose copy cannot be read or does
    /// not fit.
    pub fn with_copies(mut self, folder: &Path) -> Result<Self> {
        if let Some(model) = &self.model {
            let origin = Origin::new(UNNAMED, folder);
            let description = self.description(model, &self.policy, &origin)?;
            self.networks = description.networks(|i, _| folder.join(copy_name(i)))?;
        }
        Ok(self)
    }

    /// The names of the disturbances that a model as text has.
    pub fn disturbances(&self) -> Vec<&str> {
        let section = self.model.as_ref().and_then(|model| model.get("disturbances"));
        let section = section.and_then(Value::as_table).into_iter();
        section.flat_map(|section| section.keys().map(String::as_str)).collect()
    }

    /// The description in the sections `model` and `policy`.
    pub(super) fn description(
        &self,
        model: &Table,
        policy: &PolicySection,
        origin: &Origin,
    ) -> Result<Description> {
        let refused = |e: toml::ser::Error| Error::invalid("policy", e.to_string());
        let mut table = Table::from_iter([("model".to_owned(), Value::Table(model.clone()))]);
        // Plans and training do without a policy.
        if *policy != PolicySection::default() {
            let policy = Table::try_from(policy).map_err(refused)?;
            table.insert("policy".to_owned(), Value::Table(policy));
        }
        read_table(&table, origin)
    }

    /// The plant that the section `model` describes, with the policy.
    ///
    /// # Errors
    /// Those of the description, and [`Error::File`] for a network of the wrong shape.
    pub(super) fn described_plant(&self, model: &Table, policy: &PolicySource) -> Result<Plant> {
        let (section, folder, network) = match policy {
            PolicySource::Network { path, network, .. } => {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let section = PolicySection { file: Some(name), ..self.policy.clone() };
                (section, path.parent().unwrap_or(Path::new("")), Some(network.clone()))
            }
            PolicySource::Formula(_) => (self.policy.clone(), Path::new(""), None),
        };
        let described = self.description(model, &section, &Origin::new(UNNAMED, folder))?;
        let described = described.with_networks(self.networks.clone());
        let controller = match network {
            Some(network) => described.controller_of(network)?,
            None => described.controller()?,
        };
        Ok(Plant::new(described.model()?, controller))
    }
}
