//! The task of a description, and the bodies that pictures show.

use toml::Value;

use super::names::Scope;
use super::section::{Section, unknown};
use super::written::{FormulaKind, Written};
use crate::error::Result;
use crate::system::Body;

/// Kinds of tasks; all but the first are refused by name.
const KINDS: [&str; 5] = ["reach-avoid", "avoid", "reach", "reach-stay", "at-end"];
/// Keys of tasks that are refused by name.
const LATER: [&str; 4] = ["by", "from", "to", "between"];

/// The two margins of a reach-avoid task.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Positive inside the target set.
    pub target: Written,
    /// Positive where safe.
    pub constraint: Written,
}

/// Reads `[model.task]`.
pub(super) fn task(section: &Section<'_>, scope: &Scope) -> Result<Task> {
    section.only(["kind", "target", "constraint"].into_iter().chain(LATER))?;
    kind(section)?;
    if let Some(key) = LATER.into_iter().find(|key| section.has(key)) {
        return Err(section.refuse(key, "this part of a task does not work yet; leave it out"));
    }
    let margin = |key: &str| {
        let value = section.entries().find(|(name, _)| *name == key);
        let (_, value) = value.ok_or_else(|| {
            section.refuse(
                key,
                "missing; expected a margin, a formula that is positive where it holds",
            )
        })?;
        Written::read(section, key, value, scope, FormulaKind::Task)
    };
    Ok(Task { target: margin("target")?, constraint: margin("constraint")? })
}

fn kind(section: &Section<'_>) -> Result<()> {
    let missing = || section.refuse("kind", "missing; expected \"reach-avoid\"");
    let kind = section.text("kind")?.ok_or_else(missing)?;
    if kind == KINDS[0] {
        return Ok(());
    }
    let problem = if KINDS.contains(&kind) {
        format!("tasks of the kind \"{kind}\" do not work yet; expected \"reach-avoid\"")
    } else {
        unknown("kind of task", kind, KINDS.into_iter())
    };
    Err(section.refuse("kind", problem))
}

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
