//! The runs that a page of plans shows: which, in which lines, and what is said of them.

use super::figure::Swatch;
use super::text::counted;
use crate::model::Form;
use crate::plan::{Judged, PlanRecord, Plane, Trajectory};
use crate::scenario::drawn_record::DrawnRecord;

/// Runs that are drawn.
const DRAWN: usize = 20;

/// What the page is made of.
#[derive(Clone, Copy, Debug)]
pub struct PlanPage<'a> {
    /// What the runs came to.
    pub record: &'a PlanRecord,
    /// The runs in order.
    pub runs: &'a [Trajectory],
    /// What each came to.
    pub judged: &'a [Judged],
    /// The margins over the plane of the paths, where there is one.
    pub plane: Option<&'a Plane>,
    /// The bodies of the model along the first [`Self::DRAWN`] runs, and its shapes.
    pub drawn: &'a DrawnRecord,
}

impl PlanPage<'_> {
    /// Runs that are drawn.
    pub const DRAWN: usize = DRAWN;
}

/// The runs that are drawn, with what they came to.
pub(super) fn drawn<'a>(
    page: &PlanPage<'a>,
) -> impl Iterator<Item = (&'a Trajectory, &'a Judged)> + use<'a> {
    page.runs.iter().zip(page.judged).take(DRAWN)
}

/// The class of a run's line.
pub(super) fn class(judged: &Judged) -> &'static str {
    if judged.success() { "body first" } else { "body first failed" }
}

/// How many of the runs are drawn, in words.
pub(super) fn shown(record: &PlanRecord) -> String {
    let runs = record.runs.len();
    match runs <= DRAWN {
        true => format!("{}.", counted(runs, "run", "runs")),
        false => format!("The first {DRAWN} of {runs} runs; the others are in steps.csv."),
    }
}

/// What lines mean.
pub(super) fn legend(page: &PlanPage<'_>) -> Vec<(Swatch, String)> {
    let record = page.record;
    let deed = record.system.task.short_words(Form::Past, record.steps);
    let good = drawn(page).any(|(_, judged)| judged.success());
    let bad = drawn(page).any(|(_, judged)| !judged.success());
    let good = good.then(|| (Swatch::Line("body first"), deed.to_owned()));
    let bad = bad.then(|| (Swatch::Line("body first failed"), "failed".to_owned()));
    good.into_iter().chain(bad).collect()
}
