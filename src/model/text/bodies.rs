//! The bodies of a description, which pictures show.

use toml::Value;

use super::names::Scope;
use super::section::{Section, unknown};
use super::written::{FormulaKind, Written};
use crate::error::Result;
use crate::system::Body;

/// The bodies of a description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bodies {
    /// Those at two states, right and up.
    pub at_states: Vec<Body>,
    /// All of them, where one is at formulas, has a size or is joined to another; else none.
    pub placed: Vec<WrittenBody>,
}

/// A body as it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenBody {
    /// Name.
    pub name: String,
    /// Where it stands, right and up.
    pub at: [Written; 2],
    /// How wide it is, in the unit of its place.
    pub size: Option<f32>,
    /// The body that a line joins it to, by its number.
    pub joined: Option<usize>,
}

/// Reads `[model.bodies]`.
pub(super) fn bodies(section: Option<Section<'_>>, scope: &Scope) -> Result<Bodies> {
    let Some(section) = section else { return Ok(Bodies::default()) };
    let names: Vec<&str> = section.entries().map(|(name, _)| name).collect();
    let read = |name: &&str| body(&section, name, &names, scope);
    let all = names.iter().map(read).collect::<Result<Vec<_>>>()?;
    let plain: Vec<Option<Body>> = all.iter().map(|body| body.at_states(scope)).collect();
    let simple = |(body, plain): (&WrittenBody, &Option<Body>)| {
        plain.is_some() && body.size.is_none() && body.joined.is_none()
    };
    let placed = if all.iter().zip(&plain).all(simple) { Vec::new() } else { all };
    Ok(Bodies { at_states: plain.into_iter().flatten().collect(), placed })
}

/// The body `name`, one of `names`.
fn body(section: &Section<'_>, name: &str, names: &[&str], scope: &Scope) -> Result<WrittenBody> {
    let entry = section.required(name, "{ at = [\"x\", \"y\"] }")?;
    entry.only(["at", "size", "joined"].into_iter())?;
    Ok(WrittenBody {
        name: name.to_owned(),
        at: place(&entry, scope)?,
        size: size(&entry)?,
        joined: joined(&entry, name, names)?,
    })
}

fn place(entry: &Section<'_>, scope: &Scope) -> Result<[Written; 2]> {
    let expected = "a list of two formulas, right and up";
    let missing = || entry.refuse("at", format!("missing; expected {expected}"));
    let read = |value: &Value| Written::read(entry, "at", value, scope, FormulaKind::Picture);
    match entry.list("at", expected)?.ok_or_else(missing)? {
        [x, y] => Ok([read(x)?, read(y)?]),
        other => Err(entry.refuse("at", format!("expected {expected}, found {}", other.len()))),
    }
}

fn size(entry: &Section<'_>) -> Result<Option<f32>> {
    let size = entry.number("size")?;
    if size.is_some_and(|size| !(size.is_finite() && size > 0.0)) {
        let written = entry.written("size");
        return Err(entry.refuse("size", format!("{written}; expected a finite number above 0")));
    }
    Ok(size)
}

/// The number of the body that `name` is joined to.
fn joined(entry: &Section<'_>, name: &str, names: &[&str]) -> Result<Option<usize>> {
    let Some(other) = entry.text("joined")? else { return Ok(None) };
    let others = names.iter().copied().filter(|known| *known != name);
    match names.iter().position(|known| *known == other && other != name) {
        Some(number) => Ok(Some(number)),
        None => Err(entry.refuse("joined", unknown("other body", other, others))),
    }
}

impl WrittenBody {
    /// The body at two states, if it is at two.
    fn at_states(&self, scope: &Scope) -> Option<Body> {
        let state = |written: &Written| {
            let place = written.formula.only_name()? as usize;
            (place < scope.states).then_some(place)
        };
        let [x, y] = &self.at;
        Some(Body { name: self.name.clone(), x: state(x)?, y: state(y)? })
    }
}
