//! Counterexamples as tables: what `rollout --starts` reads, with columns beside the states.
//!
//! A column that is no state has a colon in its name: `start:index`, `measure:policy`,
//! `parameter:NAME`; of a pair also `nominal:STATE`, `measure:replay`, and `control:STEP:NAME` for each
//! step. Readers of states leave such columns out.

use std::fmt::Write;

use super::pairs::{FailingPair, Replayed};
use super::worst::FailingStart;
use crate::error::{Error, Result};
use crate::rollout::RolloutSpec;
use crate::system::{Axis, Parameter};

/// Name of the table of starts that fail under the policy.
pub const COUNTEREXAMPLES: &str = "counterexamples.csv";
/// Name of the table of pairs that fail under the controls listed with them.
pub const REPLAYED: &str = "counterexamples_replayed.csv";
/// Beginning of the names of controls.
const CONTROL: &str = "control:";

/// The starts as a table, a line each; numbers are the shortest that are the same f32 again.
pub fn starts_csv(states: &[Axis], parameters: &[Parameter], starts: &[FailingStart]) -> String {
    let names = ["start:index".to_owned(), "measure:policy".to_owned()];
    let mut text =
        line(names.into_iter().chain(names_of(states)).chain(parameter_names(parameters)));
    for FailingStart { index, x, measure } in starts {
        let first = [index.to_string(), measure.to_string()];
        text += &line(first.into_iter().chain(numbers(x)).chain(values(parameters)));
    }
    text
}

/// The pairs as a table, a line each: the perturbed start under the names of the states.
pub fn replayed_csv(
    [states, controls]: [&[Axis]; 2],
    parameters: &[Parameter],
    pairs: &[FailingPair],
) -> String {
    let steps = pairs.first().map_or(0, |pair| pair.perturbed.controls.len());
    let names = ["start:index".to_owned(), "measure:replay".to_owned()];
    let nominal = states.iter().map(|axis| format!("nominal:{}", axis.name));
    let mut text = line(
        names
            .into_iter()
            .chain(names_of(states))
            .chain(parameter_names(parameters))
            .chain(nominal)
            .chain(control_names(controls, steps)),
    );
    for FailingPair { index, nominal, perturbed, measure } in pairs {
        let first = [index.to_string(), measure.to_string()];
        let driven = perturbed.controls.iter().flat_map(|controls| numbers(controls));
        let start = first.into_iter().chain(numbers(&perturbed.x)).chain(values(parameters));
        text += &line(start.chain(numbers(nominal)).chain(driven));
    }
    text
}

/// Whether a table with this header lists starts under controls of their own.
pub fn is_replayed(header: &str) -> bool {
    header.split(',').any(|name| name.trim().starts_with(CONTROL))
}

/// The starts and controls of a table of [`replayed_csv`], for a model with these states and controls.
///
/// # Errors
/// [`Error::Invalid`] naming the column that is missing, or the line that is no row of the table.
pub fn read_replayed(
    text: &str,
    [states, controls]: [&[Axis]; 2],
    spec: &RolloutSpec,
) -> Result<Vec<Replayed>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let place = |name: String| {
        header.iter().position(|column| *column == name).ok_or_else(|| {
            Error::invalid(
                "starts",
                format!("the header has no column `{name}`, which a replay needs"),
            )
        })
    };
    let steps = spec.horizon as usize;
    let starts = names_of(states).map(&place).collect::<Result<Vec<_>>>()?;
    let driven = control_names(controls, steps).map(&place).collect::<Result<Vec<_>>>()?;
    let row = |(number, text): (usize, &str)| {
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        let read = |place: &usize| field(&fields, *place, number + 2);
        let x = starts.iter().map(read).collect::<Result<Vec<f32>>>()?;
        let flat = driven.iter().map(read).collect::<Result<Vec<f32>>>()?;
        let controls = flat.chunks(controls.len().max(1)).map(<[f32]>::to_vec).collect();
        Ok(Replayed { x, controls })
    };
    lines.enumerate().filter(|(_, text)| !text.trim().is_empty()).map(row).collect()
}

/// The number in column `place` of a line.
fn field(fields: &[&str], place: usize, line: usize) -> Result<f32> {
    let text = fields.get(place).copied().unwrap_or_default();
    let number = text.parse::<f64>().ok().map(|number| number as f32);
    number.filter(|number| number.is_finite()).ok_or_else(|| {
        let problem = format!("line {line}, column {}: `{text}` is not a finite number", place + 1);
        Error::invalid("starts", problem)
    })
}

fn names_of(axes: &[Axis]) -> impl Iterator<Item = String> {
    axes.iter().map(|axis| axis.name.clone())
}

fn parameter_names(parameters: &[Parameter]) -> impl Iterator<Item = String> {
    parameters.iter().map(|parameter| format!("parameter:{}", parameter.name))
}

fn values(parameters: &[Parameter]) -> impl Iterator<Item = String> {
    parameters.iter().map(|parameter| parameter.value.to_string())
}

/// Step by step, the controls of each.
fn control_names(controls: &[Axis], steps: usize) -> impl Iterator<Item = String> {
    (0..steps).flat_map(move |step| {
        controls.iter().map(move |axis| format!("{CONTROL}{step}:{}", axis.name))
    })
}

fn numbers(row: &[f32]) -> impl Iterator<Item = String> {
    row.iter().map(f32::to_string)
}

/// A line of the table.
fn line(fields: impl Iterator<Item = String>) -> String {
    let mut text = String::new();
    for (i, field) in fields.enumerate() {
        // A String takes whatever is written to it.
        let _ = write!(text, "{}{field}", if i > 0 { "," } else { "" });
    }
    text + "\n"
}
