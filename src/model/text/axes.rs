//! States, controls and parameters of a description.

use super::names::Scope;
use super::section::Section;
use crate::error::Result;
use crate::formula::text::shown;
use crate::system::{Axis, Parameter};

/// Most states of a model.
pub const MOST_STATES: usize = 64;
/// Most controls of a model.
pub const MOST_CONTROLS: usize = 16;
/// Most parameters of a model.
pub const MOST_PARAMETERS: usize = 256;

/// A state of a description.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Name, unit and default box.
    pub axis: Axis,
    /// What differences of it are.
    pub topology: Topology,
}

/// Whether a state comes back to where it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// A number of its own.
    Line,
    /// An angle in radians, the same after a turn.
    Circle,
}

/// Reads `[model.states]`.
pub(super) fn states(section: &Section<'_>, scope: &mut Scope) -> Result<Vec<State>> {
    let keys = keys(section, "states", 1..=MOST_STATES)?;
    let read = |key: &str| {
        scope.declare(section, key, "a state")?;
        let entry = section.required(key, "{ unit = \"m\", box = [-1.0, 1.0] }")?;
        entry.only(["unit", "box", "angle"].into_iter())?;
        let missing = || entry.refuse("box", "missing; expected the interval of starts");
        let [low, high] = entry.interval("box")?.ok_or_else(missing)?;
        if !(low.is_finite() && high.is_finite()) {
            let written = entry.written("box");
            let problem = format!("{written} is not finite as f32: starts are drawn from it");
            return Err(entry.refuse("box", problem));
        }
        let topology = match entry.flag("angle")? {
            Some(true) => Topology::Circle,
            _ => Topology::Line,
        };
        Ok(State { axis: Axis::new(key, unit(&entry)?, low, high), topology })
    };
    let states: Vec<State> = keys.into_iter().map(read).collect::<Result<_>>()?;
    scope.states = states.len();
    Ok(states)
}

/// Reads `[model.controls]`.
pub(super) fn controls(section: &Section<'_>, scope: &mut Scope) -> Result<Vec<Axis>> {
    let keys = keys(section, "controls", 1..=MOST_CONTROLS)?;
    let read = |key: &str| {
        scope.declare(section, key, "a control")?;
        let entry = section.required(key, "{ unit = \"N\", bounds = [-1.0, 1.0] }")?;
        entry.only(["unit", "bounds"].into_iter())?;
        let missing = || {
            let open = "missing; expected an interval, [-inf, inf] where there is no bound";
            entry.refuse("bounds", open)
        };
        let [low, high] = entry.interval("bounds")?.ok_or_else(missing)?;
        if low == f32::INFINITY || high == f32::NEG_INFINITY {
            let written = entry.written("bounds");
            return Err(entry.refuse("bounds", format!("{written} holds no finite number")));
        }
        Ok(Axis::new(key, unit(&entry)?, low, high))
    };
    let controls: Vec<Axis> = keys.into_iter().map(read).collect::<Result<_>>()?;
    scope.controls = controls.len();
    Ok(controls)
}

/// Reads `[model.parameters]`.
pub(super) fn parameters(
    section: Option<Section<'_>>,
    scope: &mut Scope,
) -> Result<Vec<Parameter>> {
    let Some(section) = section else { return Ok(Vec::new()) };
    let keys = keys(&section, "parameters", 0..=MOST_PARAMETERS)?;
    let read = |key: &str| {
        scope.declare(&section, key, "a parameter")?;
        let entry = section.required(key, "{ unit = \"kg\", value = 1.0 }")?;
        if entry.has("draw") {
            let problem = "parameters that are drawn do not work yet; give a `value`";
            return Err(entry.refuse("draw", problem));
        }
        entry.only(["unit", "value"].into_iter())?;
        let missing = || entry.refuse("value", "missing; expected a number");
        let value = entry.number("value")?.ok_or_else(missing)?;
        if !value.is_finite() {
            let written = entry.written("value");
            return Err(entry.refuse("value", format!("{written} is not a finite number as f32")));
        }
        Ok(Parameter::new(key, unit(&entry)?, value))
    };
    let parameters: Vec<Parameter> = keys.into_iter().map(read).collect::<Result<_>>()?;
    scope.parameters = parameters.len();
    Ok(parameters)
}

/// The unit, a label that nothing is computed from.
fn unit<'a>(entry: &Section<'a>) -> Result<&'a str> {
    let unit = entry.text("unit")?.unwrap_or_default();
    if unit.chars().count() > 32 || unit.contains(char::is_control) {
        let problem = format!("`{}`; expected a label of at most 32 characters", shown(unit));
        return Err(entry.refuse("unit", problem));
    }
    Ok(unit)
}

/// The keys of `section`, as many as `allowed`.
fn keys<'a>(
    section: &Section<'a>,
    what: &str,
    allowed: std::ops::RangeInclusive<usize>,
) -> Result<Vec<&'a str>> {
    let keys: Vec<&str> = section.entries().map(|(key, _)| key).collect();
    if !allowed.contains(&keys.len()) {
        let (least, most) = (allowed.start(), allowed.end());
        let problem = format!("{} {what}, expected {least} to {most}", keys.len());
        return Err(section.refuse_whole(problem));
    }
    Ok(keys)
}
