//! The trajectories of plans in closed loop as a table of steps and as arrays.

use super::closed_loop::{Flown, Trajectory};
use super::judged::Judged;
use crate::error::Result;
use crate::files::{Array, Column, Data, Table, npz_bytes};
use crate::model::{Costs, Model, TermKind};
use crate::rounding::as_written;

/// A row for each state of each run: `run`, `step`, `t` where the model says how long a step lasts, the
/// states, the controls, the margins, what the stage costs, each term, `effective_samples`,
/// `non_finite_samples` and `milliseconds`. A column of a state, control or term is named `x.NAME`,
/// `u.NAME`, `stage.NAME` or `terminal.NAME`. Cells without a number are empty: those of controls at
/// the last state of a run, and what is not finite.
pub fn steps_table(model: &Model, costs: &Costs, flown: &Flown, judged: &[Judged]) -> Table {
    let rows = Rows { runs: &flown.runs };
    let mut table = Table::default();
    table.add("run", Column::Count(rows.each(|run, _, _| run)));
    table.add("step", Column::Count(rows.each(|_, _, step| step as u64)));
    if let Some(period) = model.period {
        let seconds = |step: usize| step as f64 * as_written(period);
        table.add("t", rows.numbers(|_, _, step| Some(seconds(step))));
    }
    for (i, axis) in model.states.iter().enumerate() {
        let name = format!("x.{}", axis.name);
        table.add(&name, rows.singles(|run, step| run.states.get(step).map(|x| x[i])));
    }
    for (i, axis) in model.controls.iter().enumerate() {
        let name = format!("u.{}", axis.name);
        table.add(&name, rows.singles(|run, step| run.controls.get(step).map(|u| u[i])));
    }
    add_margins(&mut table, model, &rows, judged);
    add_costs(&mut table, costs, &rows);
    table.add("effective_samples", rows.numbers(|_, run, step| run.effective.get(step).copied()));
    let lost = |run: &Trajectory, step: usize| run.non_finite.get(step).map(|n| f64::from(*n));
    table.add("non_finite_samples", rows.numbers(|_, run, step| lost(run, step)));
    let time = |run: &Trajectory, step: usize| {
        flown.milliseconds.get(step).copied().filter(|_| step < run.controls.len())
    };
    table.add("milliseconds", rows.numbers(|_, run, step| time(run, step)));
    table
}

/// The margins that the task looks at.
fn add_margins(table: &mut Table, model: &Model, rows: &Rows<'_>, judged: &[Judged]) {
    if model.task.has_target() {
        let target = |run: u64, step: usize| judged[run as usize].target.get(step).copied();
        table.add("target_margin", rows.numbers(|run, _, step| target(run, step)));
    }
    if model.task.has_constraint() {
        let constraint = |run: u64, step: usize| judged[run as usize].constraint.get(step).copied();
        table.add("constraint_margin", rows.numbers(|run, _, step| constraint(run, step)));
    }
}

/// What each stage costs, and each term.
fn add_costs(table: &mut Table, costs: &Costs, rows: &Rows<'_>) {
    let of_stage: Vec<usize> = of_kind(costs, TermKind::Stage);
    let stage = |run: &Trajectory, step: usize| {
        let shares = run.shares.get(step).filter(|_| step < run.controls.len())?;
        Some(of_stage.iter().map(|&i| f64::from(shares[i])).sum())
    };
    table.add("cost", rows.numbers(|_, run, step| stage(run, step)));
    for (i, term) in costs.terms.iter().enumerate() {
        let share = |run: &Trajectory, step: usize| {
            let paid = term.kind == TermKind::Terminal || step < run.controls.len();
            run.shares.get(step).filter(|_| paid).map(|shares| shares[i])
        };
        table.add(&format!("{}.{}", term.kind.name(), term.name), rows.singles(share));
    }
}

/// The places of the terms of a kind.
fn of_kind(costs: &Costs, kind: TermKind) -> Vec<usize> {
    (0..costs.terms.len()).filter(|&i| costs.terms[i].kind == kind).collect()
}

/// The rows of the table: the states of one run after those of the other.
struct Rows<'a> {
    runs: &'a [Trajectory],
}

impl<'b> Rows<'b> {
    /// A cell for each row, from the number of the run, the run and the step.
    fn each<T>(&self, cell: impl Fn(u64, &Trajectory, usize) -> T) -> Vec<T> {
        let cell = &cell;
        let of_run = |(number, run): (u64, &'b Trajectory)| {
            (0..run.states.len()).map(move |step| cell(number, run, step))
        };
        (0..).zip(self.runs).flat_map(of_run).collect()
    }

    /// A column of numbers; what is not finite is none.
    fn numbers(&self, cell: impl Fn(u64, &Trajectory, usize) -> Option<f64>) -> Column {
        let finite = |number: &f64| number.is_finite();
        Column::Float(self.each(|number, run, step| cell(number, run, step).filter(finite)))
    }

    /// A column of f32, each as the shortest decimal that is this f32.
    fn singles(&self, cell: impl Fn(&Trajectory, usize) -> Option<f32>) -> Column {
        self.numbers(|_, run, step| cell(run, step).map(as_written))
    }
}

/// The trajectories as named arrays: `states` `[runs, T + 1, states]`, `controls` `[runs, T, controls]`,
/// `shares` `[runs, T + 1, terms]`, f32, and `lengths` `[runs]`, the controls that each run took: behind
/// them a run that stopped early is padded with NaN.
///
/// # Errors
/// Those of the archive.
pub fn trajectories(
    model: &Model,
    costs: &Costs,
    runs: &[Trajectory],
    steps: u32,
) -> Result<Vec<u8>> {
    let steps = steps as usize;
    let lengths = runs.iter().map(|run| run.controls.len() as u32).collect();
    npz_bytes(&[
        ("states", padded(runs, steps + 1, model.states.len(), |run| &run.states)),
        ("controls", padded(runs, steps, model.controls.len(), |run| &run.controls)),
        ("shares", padded(runs, steps + 1, costs.terms.len(), |run| &run.shares)),
        ("lengths", Array { shape: vec![runs.len()], data: Data::U32(lengths) }),
    ])
}

/// Rows of `width` numbers, `length` of each run.
fn padded(
    runs: &[Trajectory],
    length: usize,
    width: usize,
    rows: impl Fn(&Trajectory) -> &Vec<Vec<f32>>,
) -> Array {
    let mut numbers = Vec::with_capacity(runs.len() * length * width);
    for run in runs {
        let end = numbers.len() + length * width;
        numbers.extend(rows(run).iter().flatten());
        numbers.resize(end, f32::NAN);
    }
    Array { shape: vec![runs.len(), length, width], data: Data::F32(numbers) }
}
