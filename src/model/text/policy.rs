//! The policy of a description: formulas, or a network with what it sees and what comes of it.

use std::path::PathBuf;

use toml::Value;

use super::names::Scope;
use super::section::Section;
use super::written::{FormulaKind, Words, Written, one_each};
use crate::error::Result;

/// What makes the controls.
#[derive(Clone, Debug, PartialEq)]
pub enum Policy {
    /// A formula for each control.
    Formulas(Vec<Written>),
    /// A network.
    Network(NetworkPolicy),
}

/// A network with the formulas around it.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkPolicy {
    /// Its safetensors file.
    pub file: PathBuf,
    /// Its inputs; without them, the states in order.
    pub observe: Option<Vec<Written>>,
    /// A formula for each control; without them, the outputs in order.
    pub act: Option<Vec<Written>>,
}

/// Reads `[policy]`; none where it has neither `file` nor `formula`, and what stands around a network that
/// is to be trained is checked all the same.
pub(super) fn policy(
    section: &Section<'_>,
    controls: &[&str],
    scope: &Scope,
) -> Result<Option<Policy>> {
    section.only(["file", "formula", "observe", "act"].into_iter())?;
    match (section.text("file"), section.has("formula")) {
        (Ok(Some(_)) | Err(_), true) => Err(section.refuse_whole(
            "two definitions: `file` and `formula` are both given; keep one of them",
        )),
        (file, false) => {
            let file = file?;
            let policy = network(section, file.unwrap_or_default(), controls, scope)?;
            Ok(file.map(|_| Policy::Network(policy)))
        }
        (Ok(None), true) => {
            formulas(section, controls, scope).map(|formulas| Some(Policy::Formulas(formulas)))
        }
    }
}

fn formulas(section: &Section<'_>, controls: &[&str], scope: &Scope) -> Result<Vec<Written>> {
    if let Some(key) = ["observe", "act"].into_iter().find(|key| section.has(key)) {
        let problem = "belongs to a network; a formula sees the states and is the control";
        return Err(section.refuse(key, problem));
    }
    per_control(section, "formula", controls, scope, FormulaKind::Policy)
}

fn network(
    section: &Section<'_>,
    file: &str,
    controls: &[&str],
    scope: &Scope,
) -> Result<NetworkPolicy> {
    let act = if section.has("act") {
        Some(per_control(section, "act", controls, scope, FormulaKind::Act)?)
    } else {
        None
    };
    let file = section.origin.folder.join(file);
    Ok(NetworkPolicy { file, observe: observe(section, scope)?, act })
}

/// The formulas of the section `key`, one for each control.
fn per_control(
    section: &Section<'_>,
    key: &str,
    controls: &[&str],
    scope: &Scope,
    kind: FormulaKind,
) -> Result<Vec<Written>> {
    let inner = section.required(key, "a formula for each control")?;
    let words = Words { name: "control", formula: "formula for the control" };
    one_each(&inner, controls.iter().copied(), words, |key, value| {
        Written::read(&inner, key, value, scope, kind)
    })
}

fn observe(section: &Section<'_>, scope: &Scope) -> Result<Option<Vec<Written>>> {
    let expected = "a list of formulas, one for each input of the network";
    let Some(list) = section.list("observe", expected)? else { return Ok(None) };
    if list.is_empty() {
        return Err(section.refuse("observe", format!("expected {expected}, found none")));
    }
    let read = |(i, value): (usize, &Value)| {
        Written::read(section, &format!("observe[{i}]"), value, scope, FormulaKind::Policy)
    };
    list.iter().enumerate().map(read).collect::<Result<_>>().map(Some)
}
