//! Configurations of a plant of a registry: defaults that follow from its states, its numbers as keys.

use toml::{Table, Value};

use super::named_system::{NamedSystem, RegisteredSection, numbers};
use super::profile;
use super::registry::Registry;
use super::section::Profile;
use crate::error::{Error, Result};

/// The defaults of `profile` for the plant `name` of `registry`, made of the numbers in `given`.
///
/// # Errors
/// [`Error::Invalid`] naming the key of the layer `origin` that is no number, and those of what makes the plant.
pub(super) fn defaults(
    registry: &Registry,
    profile: Profile,
    name: &str,
    given: &Table,
    origin: &str,
) -> Result<Table> {
    let refused = |problem: String| Error::invalid(origin, problem);
    let empty = Table::new();
    let section = given.get("system").and_then(Value::as_table).unwrap_or(&empty);
    let made = registry.make(name, &numbers(section).map_err(refused)?)?;
    let mut config = profile::described(profile, &made.plant.model().states);
    let section = RegisteredSection { name: name.to_owned(), numbers: made.numbers };
    config.system = Some(NamedSystem::Registered(section));
    Table::try_from(config).map_err(|e| refused(format!("defaults: {e}")))
}
