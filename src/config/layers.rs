//! The layers of a configuration: the file, what is set over it, and which of them is to blame.

use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use super::counts;
use super::registry::Registry;
use super::section::{Config, Profile};
use super::sources::{Layer, Sources};
use super::{keys, model, registered};
use crate::error::{Error, Result};
use crate::model::text::Origin;
use crate::studies;

/// What a configuration is made of, but for the defaults.
pub(super) struct Layers {
    /// The file.
    pub(super) file: Layer,
    /// Its text, where there is one.
    pub(super) text: Option<String>,
    /// What is set over it, in order.
    pub(super) sets: Vec<Layer>,
    /// Profile instead of the file's.
    pub(super) profile: Option<Profile>,
    /// Plants that it may name beside the carried ones.
    pub(super) registry: Registry,
}

impl Layers {
    /// The configuration that all layers make.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the layer that is to blame: a setting without which the others are
    /// right, else the file.
    pub(super) fn config(&self) -> Result<Config> {
        let mut config = self.merged(|_| true, &self.file.0).map_err(|error| {
            let culprit = (0..self.sets.len()).rev().find(|&one| {
                let others = self.merged(|set| set != one, "");
                others.is_ok() && self.merged(|set| set <= one, "").is_err()
            });
            let named = |one: usize| self.merged(|_| true, &self.sets[one].0).err();
            culprit.and_then(named).unwrap_or(error)
        })?;
        let has = |table: &Table, section: &str| {
            table.get(section).is_some_and(|keys| keys.get("scenarios").is_some())
        };
        let standing = |section: &str| match self.sets.iter().any(|(_, set)| has(set, section)) {
            true => None,
            false if has(&self.file.1, section) => self.merged(|_| false, "").ok(),
            false => self.plain().ok(),
        };
        counts::follow(&mut config, standing("deviation"), standing("growth"));
        Ok(config)
    }

    /// The configuration of the file and of the sets whose numbers are `taken`; errors blame `origin`.
    fn merged(&self, taken: impl Fn(usize) -> bool, origin: &str) -> Result<Config> {
        let mut given = self.given(&taken);
        self.name_profile(&mut given);
        // Of a setting, the file does not know the line.
        let text = self.text.as_deref().filter(|_| origin == self.file.0);
        self.check_model_keys(&taken)?;
        let mut merged = self.defaults(&given, origin, text)?;
        let mut valid = keys::with_optional(&merged);
        keys::check_known(&valid, &self.file.1, &self.file.0)?;
        if model::is_described(&self.file.1) {
            valid.extend(model::settable(&self.file.1));
        }
        for (_, (name, set)) in self.sets.iter().enumerate().filter(|(number, _)| taken(*number)) {
            keys::check_known(&valid, set, name)?;
        }
        keys::overlay(&mut merged, given);
        for section in ["race", "train", "plan"] {
            let checked = merged.get(section).map(|keys| keys::check_finite(section, keys));
            checked.unwrap_or(Ok(())).map_err(|error| self.placed(error, origin))?;
        }
        // Without a source text, the message ends with a line that names the key.
        let wrong_kind = |e: toml::de::Error| {
            Error::invalid(origin, e.to_string().trim_end().replace('\n', " "))
        };
        merged.try_into().map_err(wrong_kind)
    }

    /// Refuses keys of a described model that are set and that the file does not have, before the description is
    /// read with them.
    fn check_model_keys(&self, taken: &impl Fn(usize) -> bool) -> Result<()> {
        if !model::is_described(&self.file.1) {
            return Ok(());
        }
        let of_model = |table: &Table| {
            let section = table.get("model").cloned();
            Table::from_iter(section.map(|section| ("model".to_owned(), section)))
        };
        let valid = of_model(&model::settable(&self.file.1));
        let mut sets = self.sets.iter().enumerate().filter(|(number, _)| taken(*number));
        sets.try_for_each(|(_, (name, set))| keys::check_known(&valid, &of_model(set), name))
    }

    /// `error` about a key, by the layer `origin`, with the line where that is the file.
    fn placed(&self, error: Error, origin: &str) -> Error {
        let Error::Invalid { place, problem } = error else { return error };
        let file = Origin::new(origin, Path::new(""));
        let text = self.text.iter().filter(|_| origin == self.file.0);
        let file = text.fold(file, |file, text| file.with_text(text));
        Error::Invalid { place: format!("{}: {place}", file.place(&place)), problem }
    }

    /// The file with the sets over it whose numbers are `taken`.
    fn given(&self, taken: &impl Fn(usize) -> bool) -> Table {
        let mut given = self.file.1.clone();
        let sets = self.sets.iter().enumerate().filter(|(number, _)| taken(*number));
        sets.for_each(|(_, (_, set))| keys::overlay(&mut given, set.clone()));
        given
    }

    /// The defaults of the profile and the system in question.
    fn plain(&self) -> Result<Config> {
        let mut given = self.given(&|_| true);
        self.name_profile(&mut given);
        let plain = self.defaults(&given, &self.file.0, self.text.as_deref())?;
        plain.try_into().map_err(|e| Error::invalid("defaults", format!("{e}")))
    }

    /// Puts the profile that counts into `given`.
    fn name_profile(&self, given: &mut Table) {
        if let Some(profile) = self.profile {
            given.insert("profile".to_owned(), profile.name().into());
        }
    }

    /// Where the values of the configuration were written.
    pub(super) fn sources(self) -> Sources {
        let (name, given) = self.file;
        let file = Origin::new(&name, Path::new(""));
        let file = self.text.iter().fold(file, |file, text| file.with_text(text));
        Sources { file: Some(file), given, sets: self.sets }
    }

    /// Whether the file or a set has the section `train`.
    pub(super) fn trains(&self) -> bool {
        self.given(&|_| true).contains_key("train")
    }

    /// The defaults of the profile and the system that the table `given` names.
    fn defaults(&self, given: &Table, origin: &str, text: Option<&str>) -> Result<Table> {
        let profile = profile(given, origin)?;
        if model::is_described(given) {
            let place = Origin::new(origin, Path::new(""));
            let place = text.map_or(place.clone(), |text| place.with_text(text));
            return model::defaults(profile, given, place);
        }
        let name = given.get("system").and_then(|system| system.get("name"));
        let word = name.and_then(Value::as_str);
        if let Some(name) = word.filter(|name| self.registry.has(name)) {
            return registered::defaults(&self.registry, profile, name, given, origin);
        }
        let config = word.and_then(|name| studies::defaults(profile, name)).ok_or_else(|| {
            let found = name.map_or("missing".to_owned(), |name| format!("{name} is unknown"));
            let systems = self.registry.all_names().join("\" or \"");
            let expected = format!("expected \"{systems}\", or a section `model` (docs/models.md)");
            refused(origin, "system.name", format!("{found}; {expected}"))
        })?;
        Table::try_from(config).map_err(|e| refused(origin, "defaults", e.to_string()))
    }
}

/// The refusal of a key of the layer `origin`.
fn refused(origin: &str, key: &str, problem: String) -> Error {
    Error::invalid(format!("{origin}: {key}"), problem)
}

/// The profile that `given` names; refuses a section of the system that is none.
fn profile(given: &Table, origin: &str) -> Result<Profile> {
    if let Some(section) = given.get("system").filter(|section| !section.is_table()) {
        let problem = format!("{section} is no section; give a section [system] with a `name`");
        return Err(refused(origin, "system", problem));
    }
    match given.get("profile").cloned() {
        Some(other) if !other.is_str() => {
            let problem =
                format!("{other} is no text; expected \"paper\", \"study\" or \"rigorous\"");
            Err(refused(origin, "profile", problem))
        }
        Some(name) => Profile::deserialize(name)
            .map_err(|e| refused(origin, "profile", e.message().to_owned())),
        None => Ok(Profile::default()),
    }
}
