//! The section `[system]`: a system by its name, one that is carried or one of a program of one's own.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::studies::{SYSTEMS, SystemSection};

/// A system by its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, try_from = "Table")]
pub enum NamedSystem {
    /// One that the program carries.
    Carried(SystemSection),
    /// One of a [`super::Registry`].
    Registered(RegisteredSection),
}

/// A system of a [`super::Registry`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegisteredSection {
    /// Its name there.
    pub name: String,
    /// What it is made of.
    #[serde(flatten)]
    pub numbers: BTreeMap<String, f64>,
}

impl TryFrom<Table> for NamedSystem {
    type Error = String;

    fn try_from(mut table: Table) -> Result<Self, String> {
        let name = match table.get("name") {
            Some(Value::String(name)) => name.clone(),
            _ => return Err("system.name: expected the name of a system".to_owned()),
        };
        if SYSTEMS.contains(&name.as_str()) {
            let section = SystemSection::deserialize(Value::Table(table));
            return section.map(Self::Carried).map_err(|e| format!("system: {}", e.message()));
        }
        table.remove("name");
        let numbers = numbers(&table)?;
        Ok(Self::Registered(RegisteredSection { name, numbers }))
    }
}

/// The numbers of `[system]` beside the name.
pub(super) fn numbers(table: &Table) -> Result<BTreeMap<String, f64>, String> {
    let number = |(key, value): (&String, &Value)| {
        let number = match value {
            Value::Float(number) => Some(*number),
            // Whole numbers that f64 has not are none that a plant is made of.
            Value::Integer(number) => Some(*number as f64),
            _ => None,
        };
        let finite = number.filter(|number| number.is_finite());
        let finite = finite
            .ok_or_else(|| format!("system.{key}: expected a finite number, found {value}"))?;
        Ok((key.clone(), finite))
    };
    table.iter().filter(|(key, _)| *key != "name").map(number).collect()
}
