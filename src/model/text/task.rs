//! The task of a description: its kind, its margins, its times.

use toml::Value;

use super::dynamics::Dynamics;
use super::names::Scope;
use super::section::{Section, unknown};
use super::written::{FormulaKind, Written};
use crate::error::Result;
use crate::model::{Task, Window};

/// Kinds of tasks.
const KINDS: [&str; 5] = ["reach-avoid", "avoid", "reach", "reach-stay", "at-end"];
/// Keys of times.
const TIMES: [&str; 3] = ["from", "to", "by"];
/// How many further points of each period are looked at.
const BETWEEN: &str = "between";
/// How far a time may lie from a whole number of periods, in periods for each of them: a period is an f32.
const WHOLE: f64 = 1e-6;

/// A task with its margins, of which one that it has no use for is not there.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenTask {
    /// What a rollout has to do.
    pub task: Task,
    /// Positive inside the target set.
    pub target: Option<Written>,
    /// Positive where safe.
    pub constraint: Option<Written>,
    /// Points inside each period that are looked at besides the samples.
    pub between: u32,
}

/// Reads `[model.task]` of a model that moves on by `dynamics`, whose steps last `period` seconds, where that
/// is known.
pub(super) fn task(
    section: &Section<'_>,
    scope: &Scope,
    dynamics: &Dynamics,
    period: Option<f32>,
) -> Result<WrittenTask> {
    section.only(["kind", "target", "constraint", BETWEEN].into_iter().chain(TIMES))?;
    let kind = kind(section)?;
    refuse_unused(section, kind)?;
    let margin = |key: &str| {
        let needed = used(kind).contains(&key);
        needed.then(|| margin(section, key, scope)).transpose()
    };
    Ok(WrittenTask {
        task: timed(section, kind, period)?,
        target: margin("target")?,
        constraint: margin("constraint")?,
        between: between(section, dynamics)?,
    })
}

/// The number of points inside each period: the state after each of its equal parts but the last.
fn between(section: &Section<'_>, dynamics: &Dynamics) -> Result<u32> {
    let Some(count) = section.whole(BETWEEN)? else { return Ok(0) };
    let refuse = |problem: String| section.refuse(BETWEEN, problem);
    let Dynamics::Flow(_, rule) = dynamics else {
        let problem = "points inside a period need `model.flow`: next values have nothing between";
        return Err(refuse(problem.to_owned()));
    };
    let points = u32::try_from(count).ok().filter(|count| *count > 0);
    let parts = points.and_then(|count| count.checked_add(1)).ok_or_else(|| {
        let problem =
            "expected a number of points inside each period, 1 or more; leave it out for none";
        refuse(format!("{count}; {problem}"))
    })?;
    if !rule.substeps.is_multiple_of(parts) {
        let problem = format!(
            "{count} points cut a period into {parts} parts, and {} substeps cannot be shared evenly; \
             take a multiple of {parts} for `model.time.substeps`",
            rule.substeps
        );
        return Err(refuse(problem));
    }
    Ok(parts - 1)
}

/// The task of this kind with its times.
fn timed(section: &Section<'_>, kind: &str, period: Option<f32>) -> Result<Task> {
    let time = |key| moment(section, key, period);
    let window =
        || -> Result<Window> { Ok(Window { from: time("from")?.unwrap_or(0), to: time("to")? }) };
    Ok(match kind {
        "avoid" => Task::Avoid,
        "reach" => Task::Reach(window()?),
        "reach-stay" => Task::ReachStay { by: time("by")? },
        "at-end" => Task::AtEnd,
        _ => Task::ReachAvoid(window()?),
    })
}

/// The keys that a kind of task has a use for.
fn used(kind: &str) -> &'static [&'static str] {
    match kind {
        "avoid" => &["constraint"],
        "reach" => &["target", "from", "to"],
        "reach-stay" => &["target", "constraint", "by"],
        "at-end" => &["target", "constraint"],
        _ => &["target", "constraint", "from", "to"],
    }
}

/// Refuses a key that the kind has no use for.
fn refuse_unused(section: &Section<'_>, kind: &str) -> Result<()> {
    let used = used(kind);
    let mut given =
        ["target", "constraint"].into_iter().chain(TIMES).filter(|key| section.has(key));
    match given.find(|key| !used.contains(key)) {
        Some(key) => {
            let problem = format!(
                "a task of the kind \"{kind}\" has no use for it, but for {}; leave it \
                 out or take another kind",
                used.join(", ")
            );
            Err(section.refuse(key, problem))
        }
        None => Ok(()),
    }
}

fn kind<'a>(section: &Section<'a>) -> Result<&'a str> {
    let missing = || {
        let known = KINDS.map(|kind| format!("\"{kind}\"")).join(", ");
        section.refuse("kind", format!("missing; expected one of {known}"))
    };
    let kind = section.text("kind")?.ok_or_else(missing)?;
    if KINDS.contains(&kind) {
        return Ok(kind);
    }
    Err(section.refuse("kind", unknown("kind of task", kind, KINDS.into_iter())))
}

fn margin(section: &Section<'_>, key: &str, scope: &Scope) -> Result<Written> {
    let missing = || {
        let expected = "a margin, a formula that is positive where it holds";
        section.refuse(key, format!("missing; expected {expected}"))
    };
    let value = section.entries().find(|(name, _)| *name == key);
    let (_, value) = value.ok_or_else(missing)?;
    Written::read(section, key, value, scope, FormulaKind::Task)
}

/// The step at `key`: a whole number of steps, or seconds as text with their unit.
fn moment(section: &Section<'_>, key: &str, period: Option<f32>) -> Result<Option<u32>> {
    let Some((_, value)) = section.entries().find(|(name, _)| *name == key) else {
        return Ok(None);
    };
    let expected = "a number of steps, or seconds as text, \"1.5 s\"";
    let beyond = |step: &dyn std::fmt::Display| {
        section.refuse(key, format!("{step}; expected {expected}, from 0 to {}", u32::MAX))
    };
    match value {
        Value::Integer(step) => u32::try_from(*step).map(Some).map_err(|_| beyond(step)),
        Value::String(text) => {
            let seconds = text.trim().strip_suffix('s').map(|number| number.trim().parse::<f64>());
            let Some(Ok(seconds)) = seconds else {
                return Err(section.wrong(key, expected, value));
            };
            let step = whole_periods(section, key, seconds, period)?;
            let steps = 0.0..=f64::from(u32::MAX);
            if steps.contains(&step) { Ok(Some(step as u32)) } else { Err(beyond(text)) }
        }
        other => Err(section.wrong(key, expected, other)),
    }
}

/// How many periods `seconds` are.
fn whole_periods(
    section: &Section<'_>,
    key: &str,
    seconds: f64,
    period: Option<f32>,
) -> Result<f64> {
    let Some(period) = period else {
        let problem = "seconds need `period` in `[model.time]`; give it, or a number of steps";
        return Err(section.refuse(key, problem));
    };
    let periods = seconds / f64::from(period);
    let whole = periods.round();
    if (periods - whole).abs() <= WHOLE * whole.abs() {
        return Ok(whole);
    }
    let problem = format!("{seconds} s is no multiple of the period, {period} s");
    Err(section.refuse(key, problem))
}
