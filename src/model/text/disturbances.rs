//! The disturbances of a description: bounded numbers that the dynamics may use.

use super::names::Scope;
use super::section::Section;
use crate::error::Result;

/// Most disturbances of a model.
pub const MOST_DISTURBANCES: usize = 16;

/// What a disturbance needs a distribution for.
const DRAWN: [&str; 2] = ["draw", "hold"];

/// A number that acts at every step: 0 in every rollout but the training of a policy against it.
#[derive(Clone, Debug, PartialEq)]
pub struct Disturbance {
    /// Name in formulas.
    pub name: String,
    /// The largest size that it has, above 0.
    pub bound: f32,
}

/// Reads `[model.disturbances]`.
pub(super) fn disturbances(
    section: Option<Section<'_>>,
    scope: &mut Scope,
) -> Result<Vec<Disturbance>> {
    let Some(section) = section else { return Ok(Vec::new()) };
    let count = section.entries().count();
    if count > MOST_DISTURBANCES {
        let problem = format!("{count} disturbances, at most {MOST_DISTURBANCES} are allowed");
        return Err(section.refuse_whole(problem));
    }
    section.entries().map(|(name, _)| disturbance(&section, name, scope)).collect()
}

fn disturbance(section: &Section<'_>, name: &str, scope: &mut Scope) -> Result<Disturbance> {
    scope.declare_disturbance(section, name)?;
    let entry = section.required(name, "{ bound = 0.3 }")?;
    if let Some(key) = DRAWN.into_iter().find(|key| entry.has(key)) {
        let problem = "disturbances that are drawn do not work yet; give a `bound`";
        return Err(entry.refuse(key, problem));
    }
    entry.only(["unit", "bound"].into_iter())?;
    entry.text("unit")?;
    let missing = || entry.refuse("bound", "missing; expected the largest size, above 0");
    let bound = entry.number("bound")?.ok_or_else(missing)?;
    if !(bound.is_finite() && bound > 0.0) {
        let written = entry.written("bound");
        return Err(entry.refuse("bound", format!("{written}; expected a finite number above 0")));
    }
    Ok(Disturbance { name: name.to_owned(), bound })
}
