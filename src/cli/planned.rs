//! What `plan` says in the end: its files and its words.

use std::fmt::Write;
use std::path::PathBuf;

use crate::error::Result;
use crate::files::{Staged, json};
use crate::model::{Costs, Model};
use crate::plan::record::{LatencyRecord, SuccessRecord, TermRecord};
use crate::plan::{Flown, Judged, PlanRecord, Plane, steps_table, trajectories};
use crate::report::{PlanPage, plan_html};
use crate::rounding::{complement, interval, lower, number, upper};
use crate::scenario::bodies_and_shapes;

/// Name of the record.
const RECORD: &str = "plan.json";
/// Name of the table of steps.
const STEPS: &str = "steps.csv";
/// Name of the arrays.
const TRAJECTORIES: &str = "trajectories.npz";
/// Name of the page.
const PAGE: &str = "report.html";

/// Runs that are over.
pub(super) struct Steered {
    /// What they came to.
    pub(super) record: PlanRecord,
    /// The runs.
    pub(super) flown: Flown,
    /// What each came to.
    pub(super) judged: Vec<Judged>,
    /// Ends of the box of starts, `[states]` each.
    pub(super) bounds: [Vec<f32>; 2],
}

/// Writes the files of the folder, the record last.
///
/// # Errors
/// Those of the files.
pub(super) fn stage(
    staged: &mut Staged,
    model: &Model,
    costs: &Costs,
    steered: &Steered,
) -> Result<()> {
    let Steered { record, flown, judged, bounds } = steered;
    staged.add(STEPS, &steps_table(model, costs, flown, judged).csv()?)?;
    staged.add(TRAJECTORIES, &trajectories(model, costs, &flown.runs, record.steps)?)?;
    let plane = Plane::new(model, &flown.runs, bounds);
    let shown = flown.runs.iter().take(PlanPage::DRAWN);
    let states: Vec<&[Vec<f32>]> = shown.map(|run| &run.states[..]).collect();
    let drawn = bodies_and_shapes(model, &states);
    let page = PlanPage { record, runs: &flown.runs, judged, plane: plane.as_ref(), drawn: &drawn };
    staged.add(PAGE, plan_html(&page).as_bytes())?;
    staged.add(RECORD, json(RECORD, record)?.as_bytes())
}

/// What came of the runs.
pub(super) fn text(record: &PlanRecord, files: &[PathBuf]) -> String {
    let SuccessRecord { successes, runs, interval: ends, beta, of } = &record.success;
    let plural = if *runs == 1 { "" } else { "s" };
    // A String takes whatever is written to it.
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{successes} of {runs} run{plural} of {} steps succeed{}; share {} with confidence {}, over {of}",
        record.steps,
        if *runs == 1 { "s" } else { "" },
        interval(*ends),
        complement(*beta)
    );
    let _ = writeln!(text, "cost of a run: {} ({})", number(record.cost.mean), terms(record));
    let LatencyRecord { plans, median, p95, most, .. } = record.latency;
    let together = if plans == 1 { "" } else { ", all plans together" };
    let _ = writeln!(
        text,
        "a control step: {} ms median, {} ms in 95 % of the steps, {} ms at most{together}, on {}",
        upper(median),
        upper(p95),
        upper(most),
        record.provenance.device
    );
    let (effective, samples) = (record.effective, record.plans.samples);
    let _ = writeln!(
        text,
        "effective samples: {} median, {} at least, of {samples}",
        lower(effective.median),
        lower(effective.least)
    );
    for note in &record.notes {
        let _ = writeln!(text, "note: {note}");
    }
    for file in files {
        let _ = writeln!(text, "file: {}", file.display());
    }
    text
}

/// What each term costs.
fn terms(record: &PlanRecord) -> String {
    let one = |term: &TermRecord| format!("{} {}", term.key(), number(term.mean));
    record.cost.terms.iter().map(one).collect::<Vec<_>>().join(", ")
}
