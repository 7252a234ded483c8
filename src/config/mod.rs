//! Configuration: a TOML file over the defaults of its profile, and overrides over both.

mod costs;
mod counts;
mod deterministic;
mod deterministic_settings;
mod drop_settings;
mod drops;
mod enclosed;
mod formula_name;
mod keys;
mod layers;
mod learning;
mod model;
mod named_system;
mod open;
mod plan;
mod plant;
pub(crate) mod profile;
mod registered;
mod registry;
mod section;
mod sequential;
mod settings;
mod sources;
#[cfg(test)]
mod tests;
pub(crate) mod train;
mod unused;
mod value;

pub use crate::studies::SystemSection;
pub use deterministic::{AsDeviation, DeterministicSection, Driving, Enclosing, Radius};
pub use drops::{CalibrationSection, Count, DropsSection, TighteningSource};
pub use model::copy_name;
pub use named_system::{NamedSystem, RegisteredSection};
pub use plant::PolicySource;
pub use registry::{Numbers, Registered, Registry};
pub use section::{
    BoxSection, Config, ConstantsSection, DeviationSection, FormulaSection, GlobalSection,
    GrowthSection, PolicySection, Profile, RolloutSection, SliceAxisSection, SliceSection,
    StateSection,
};
pub use sequential::SequentialSection;
pub use value::{Constant, Coordinates, Named};

pub(crate) use formula_name::no_formula;
pub(crate) use plant::check_network;

use std::path::Path;

use serde::Deserialize;
use toml::Table;

use crate::error::{Error, Result};
use crate::files::{CONFIG_BYTES, read_text};
use crate::model::text::Origin;
use layers::Layers;
use unused::ProfileOf;

/// What the command line lays over a configuration file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Profile whose defaults count, instead of the file's.
    pub profile: Option<Profile>,
    /// Seed instead of the file's.
    pub seed: Option<u64>,
    /// `section.key=value` each; the value in TOML, or else a string.
    pub set: Vec<String>,
    /// Plants that it may name beside the carried ones.
    pub registry: Registry,
}

impl Config {
    /// Reads `path`, fills in the defaults of its profile and lays `overrides` over it.
    ///
    /// # Errors
    /// [`Error::File`] if the file is missing or no TOML, [`Error::Invalid`] naming the key that
    /// is unknown, with the nearest valid one, or that has a value of the wrong kind, in the
    /// sections `race` and `train` a number that is not finite, or a key that nothing reads.
    pub fn load(path: &Path, overrides: &Overrides) -> Result<Self> {
        let text = read_text(path, CONFIG_BYTES).map_err(|e| Error::file(path, e))?;
        let table = toml::from_str(&text).map_err(|e| Error::file(path, e))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_layers(table, Some(text), &path.display().to_string(), folder, overrides)
    }

    /// The configuration of the TOML document `table`, which errors call `origin`.
    ///
    /// # Errors
    /// [`Error::Invalid`], as for [`Config::load`].
    pub fn from_table(table: Table, origin: &str, overrides: &Overrides) -> Result<Self> {
        Self::from_layers(table, None, origin, Path::new(""), overrides)
    }

    /// The configuration of the document `table` in `folder`, whose text makes errors name lines.
    fn from_layers(
        table: Table,
        text: Option<String>,
        origin: &str,
        folder: &Path,
        overrides: &Overrides,
    ) -> Result<Self> {
        let sets = overrides.set.iter().map(|text| {
            keys::parse_assignment(text).map(|assignment| (format!("--set {text}"), assignment))
        });
        let sets = sets.collect::<Result<Vec<_>>>()?;
        let file = (origin.to_owned(), table);
        let place = text.iter().fold(Origin::new(origin, folder), |at, text| at.with_text(text));
        let registry = overrides.registry.clone();
        let layers = Layers { file, text, sets, profile: overrides.profile, registry };
        let mut config = layers.config()?;
        config.registry = overrides.registry.clone();
        config.networks = config.networks_beside(&place)?;
        config.seed = overrides.seed.unwrap_or(config.seed);
        // What is about to be trained is not there yet, and a model may be given before its policy.
        let checked = config.policy.check(layers.trains() || config.model.is_some());
        config.sources = layers.sources();
        let profile = ProfileOf::of(overrides.profile, &overrides.set);
        let checked = checked.and_then(|()| unused::check(&config, &config.sources, profile));
        checked.map_err(|error| config.placed(error))?;
        Ok(config)
    }

    /// `error` with the file and the line, or the setting, that the key it names was written in.
    #[must_use]
    pub fn placed(&self, error: Error) -> Error {
        self.sources.placed(error)
    }

    /// The configuration as a certificate or a race stores it, every default filled in, without the
    /// sections `train` and `plan`, which they do not depend on.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a value has no JSON form.
    pub fn to_json(&self) -> Result<serde_json::Value> {
        stored(Self { train: None, plan: None, ..self.clone() })
    }

    /// The configuration as training stores it, every default filled in, without the sections `race` and
    /// `plan`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a value has no JSON form.
    pub fn to_train_json(&self) -> Result<serde_json::Value> {
        stored(Self { study: None, plan: None, ..self.clone() })
    }

    /// The configuration that a certificate stores, of a plant that is carried or given as text.
    ///
    /// # Errors
    /// [`Error::Refused`] if it is not complete, not of this version, or of a plant of another program.
    pub fn from_json(value: &serde_json::Value) -> Result<Self> {
        Self::from_json_of(value, &Registry::default())
    }

    /// The same where the plant may be one of `registry`.
    ///
    /// # Errors
    /// Those of [`Config::from_json`].
    pub fn from_json_of(value: &serde_json::Value, registry: &Registry) -> Result<Self> {
        let refused = |e: &dyn std::fmt::Display| Error::Refused(format!("provenance.config: {e}"));
        unknown_plant(value, registry).map_or(Ok(()), Err)?;
        let mut value = value.clone();
        open::of_nulls(&mut value);
        let mut config = Self::deserialize(&value).map_err(|e| refused(&e))?;
        config.model.iter_mut().for_each(open::of_words);
        config.registry = registry.clone();
        config.policy.check(config.train.is_some()).map_err(|e| refused(&e))?;
        Ok(config)
    }
}

/// The refusal of what is no configuration of a system that this program knows.
fn unknown_plant(value: &serde_json::Value, registry: &Registry) -> Option<Error> {
    let known = registry.all_names();
    let system = value.pointer("/system/name").and_then(serde_json::Value::as_str);
    if value.get("model").is_some_and(serde_json::Value::is_object)
        || system.is_some_and(|name| known.contains(&name))
    {
        return None;
    }
    let plant = match (system, value) {
        (Some(name), _) => format!("the system `{name}`"),
        (None, serde_json::Value::String(words)) => format!("`{words}`"),
        (None, _) => "a system without a name".to_owned(),
    };
    Some(Error::Refused(format!(
        "the certificate is of {plant}, which another program defines; this one knows {}. Its numbers \
         can be read, and the program that made it can check it (`reachcast::scenario::check`)",
        known.join(" and ")
    )))
}

/// A configuration as JSON.
fn stored(mut config: Config) -> Result<serde_json::Value> {
    config.model.iter_mut().for_each(open::to_words);
    // By way of the text, in which an f32 is the shortest decimal that stands for it.
    let text = serde_json::to_string(&config);
    text.and_then(|text| serde_json::from_str(&text))
        .map_err(|e| Error::invalid("configuration", e.to_string()))
}
