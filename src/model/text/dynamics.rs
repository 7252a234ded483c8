//! The dynamics of a description: next values or derivatives, and the time between steps.

use super::names::Scope;
use super::section::{Section, unknown};
use super::written::{FormulaKind, Words, Written, one_each};
use crate::error::Result;

/// How the state moves on.
#[derive(Clone, Debug, PartialEq)]
pub enum Dynamics {
    /// Each state's next value.
    Next(Vec<Written>),
    /// Each state's derivative with respect to seconds, and how it is integrated.
    Flow(Vec<Written>, Integration),
}

/// How derivatives become steps: with the control held over a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Integration {
    /// Seconds of a step.
    pub period: f32,
    /// The rule.
    pub integrator: Integrator,
    /// Equal parts of a period, each integrated by the rule.
    pub substeps: u32,
}

/// A rule of integration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// Explicit Euler: one evaluation.
    Euler,
    /// The classical rule of Runge and Kutta of order 4: four evaluations.
    Rk4,
}

/// What `[model.time]` says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Time {
    pub(super) period: Option<f32>,
    integrator: Option<Integrator>,
    substeps: Option<u32>,
}

/// Reads `[model.time]`.
pub(super) fn time(section: Option<&Section<'_>>) -> Result<Time> {
    let Some(section) = section else { return Ok(Time::default()) };
    section.only(["period", "integrator", "substeps"].into_iter())?;
    let period = section.number("period")?;
    if let Some(period) = period.filter(|period| !(period.is_finite() && *period > 0.0)) {
        let problem = format!("{period}; expected a number of seconds above 0");
        return Err(section.refuse("period", problem));
    }
    Ok(Time { period, integrator: integrator(section)?, substeps: substeps(section)? })
}

fn integrator(section: &Section<'_>) -> Result<Option<Integrator>> {
    match section.text("integrator")? {
        None => Ok(None),
        Some("euler") => Ok(Some(Integrator::Euler)),
        Some("rk4") => Ok(Some(Integrator::Rk4)),
        Some(other) => {
            let problem = unknown("integrator", other, ["euler", "rk4"].into_iter());
            Err(section.refuse("integrator", problem))
        }
    }
}

fn substeps(section: &Section<'_>) -> Result<Option<u32>> {
    let Some(count) = section.whole("substeps")? else { return Ok(None) };
    let whole = u32::try_from(count).ok().filter(|count| *count > 0);
    let refused = || section.refuse("substeps", format!("{count}; expected 1 or more"));
    whole.map(Some).ok_or_else(refused)
}

/// Reads `[model.next]` or `[model.flow]`.
pub(super) fn dynamics(
    model: &Section<'_>,
    states: &[&str],
    time: Time,
    scope: &Scope,
) -> Result<Dynamics> {
    match (model.section("next")?, model.section("flow")?) {
        (Some(next), None) => {
            refuse_integration(model, time)?;
            formulas(&next, states, "next value of", scope).map(Dynamics::Next)
        }
        (None, Some(flow)) => {
            let integration = integration(model, time)?;
            let formulas = formulas(&flow, states, "derivative of", scope)?;
            Ok(Dynamics::Flow(formulas, integration))
        }
        (Some(_), Some(_)) => {
            let problem = "two definitions: `next` and `flow` are both given; keep one of them";
            Err(model.refuse("next", problem))
        }
        (None, None) => Err(model.refuse_whole(
            "no dynamics; expected a section `model.flow`, the derivative of each state, or \
             `model.next`, its next value",
        )),
    }
}

fn formulas(
    section: &Section<'_>,
    states: &[&str],
    formula: &'static str,
    scope: &Scope,
) -> Result<Vec<Written>> {
    let words = Words { name: "state", formula };
    one_each(section, states.iter().copied(), words, |key, value| {
        Written::read(section, key, value, scope, FormulaKind::Dynamics)
    })
}

/// Refuses what only derivatives need.
fn refuse_integration(model: &Section<'_>, time: Time) -> Result<()> {
    let given = [("integrator", time.integrator.is_some()), ("substeps", time.substeps.is_some())];
    match given.iter().find(|(_, given)| *given) {
        Some((key, _)) => {
            let problem = "belongs to `model.flow`: next values are not integrated";
            Err(model.refuse(&format!("time.{key}"), problem))
        }
        None => Ok(()),
    }
}

fn integration(model: &Section<'_>, time: Time) -> Result<Integration> {
    let missing = |key: &str, expected: &str| {
        model.refuse(&format!("time.{key}"), format!("missing; expected {expected}"))
    };
    Ok(Integration {
        period: time.period.ok_or_else(|| missing("period", "the seconds of a step"))?,
        integrator: time.integrator.ok_or_else(|| missing("integrator", "\"euler\" or \"rk4\""))?,
        substeps: time.substeps.unwrap_or(1),
    })
}
