//! The bodies of a description, which pictures show.

use toml::Value;

use super::names::Scope;
use super::section::Section;
use super::written::{FormulaKind, Written};
use crate::error::Result;
use crate::system::Body;

/// Reads `[model.bodies]`: each at two states.
pub(super) fn bodies(section: Option<Section<'_>>, scope: &Scope) -> Result<Vec<Body>> {
    let Some(section) = section else { return Ok(Vec::new()) };
    let body = |(name, _): (&str, &Value)| {
        let entry = section.required(name, "{ at = [\"x\", \"y\"] }")?;
        entry.only(["at", "size", "joined"].into_iter())?;
        if let Some(key) = ["size", "joined"].into_iter().find(|key| entry.has(key)) {
            return Err(entry.refuse(key, "pictures do not show this yet; leave it out"));
        }
        let expected = "a list of two states, right and up";
        let missing = || entry.refuse("at", format!("missing; expected {expected}"));
        match entry.list("at", expected)?.ok_or_else(missing)? {
            [x, y] => Ok(Body {
                name: name.to_owned(),
                x: coordinate(&entry, x, scope)?,
                y: coordinate(&entry, y, scope)?,
            }),
            other => Err(entry.refuse("at", format!("expected {expected}, found {}", other.len()))),
        }
    };
    section.entries().map(body).collect()
}

/// The state that a coordinate of a body is.
fn coordinate(entry: &Section<'_>, value: &Value, scope: &Scope) -> Result<usize> {
    let written = Written::read(entry, "at", value, scope, FormulaKind::Picture)?;
    let state = written.formula.only_name().map(|place| place as usize);
    state.filter(|state| *state < scope.states).ok_or_else(|| {
        let problem = "a body at a formula cannot be shown yet; expected the name of a state";
        written.refuse(entry.origin, 0, problem)
    })
}
