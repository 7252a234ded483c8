//! What has to be said beside the figures of plans in closed loop.

use super::record::{PlanRecord, SuccessRecord};
use crate::model::{Costs, Model, Reference, ReferenceSource};
use crate::rounding::{lower, upper};
use crate::scenario::sampling::points_between;

/// Share of the samples from which on they count as weighing the same.
const ALL: f64 = 0.99;
/// Effective samples below which one sample decides a plan.
const ONE: f64 = 1.5;
/// Samples from which on that is worth saying.
const MANY: u32 = 64;

/// The notes on `record`, a record of plans for `model` and `costs`; `non_finite` samples of all had no
/// finite cost.
pub(super) fn notes(
    model: &Model,
    costs: &Costs,
    record: &PlanRecord,
    non_finite: u64,
) -> Vec<String> {
    let fixed = model.controls.iter().filter(|axis| axis.low == axis.high).map(|axis| {
        format!("the control `{}` stays at {}: its bounds have no width", axis.name, axis.low)
    });
    let SuccessRecord { runs, .. } = record.success;
    let batch = (runs > 1).then(|| {
        format!(
            "latency is that of a step in which the plans of {runs} runs are improved together; \
             `--set plan.runs=1` has that of one plan"
        )
    });
    let failed = runs - record.success.successes;
    let failed = (failed > 0).then(|| {
        format!(
            "{failed} of {runs} runs fail the task: plans keep the costs small and know nothing of it; a term that \
             grows where a margin of the task falls below 0 ties both"
        )
    });
    let lost = (non_finite > 0).then(|| {
        format!(
            "{non_finite} samples had a cost that is not finite, or 1e30 and more; they weigh nothing"
        )
    });
    let stopped = record.runs.iter().filter(|run| run.stopped.is_some()).count();
    let first =
        record.runs.iter().enumerate().find_map(|(i, run)| Some((i, run.stopped.as_ref()?)));
    let stopped = first.map(|(run, why)| {
        format!(
            "{stopped} of {runs} runs stopped early: their costs end there, and they succeed only where \
             the task was done before; run {run} at step {}: {}",
            why.step, why.reason
        )
    });
    let looked = match model.points {
        1 => "states are looked at only at the samples, and nothing is said of what lies between two of them"
            .to_owned(),
        points => format!(
            "runs are judged at the samples and {}, which tables and pictures do not show",
            points_between(points - 1)
        ),
    };
    fixed
        .chain([looked])
        .chain(held(costs, record))
        .chain(batch)
        .chain(failed)
        .chain(weights(record))
        .chain(lost)
        .chain(stopped)
        .collect()
}

/// The references from files that end before the last stage of the last plan.
fn held(costs: &Costs, record: &PlanRecord) -> Vec<String> {
    let rows = costs.stage.rows(record.plans.horizon as usize);
    let last = record.steps as usize + rows - 2;
    let short = |reference: &Reference| match &reference.source {
        ReferenceSource::Rows(rows) if rows.len() <= last => Some(format!(
            "the reference `{}` has {} rows, and plans look up to step {last}: its last row is held",
            reference.name,
            rows.len()
        )),
        _ => None,
    };
    costs.references.iter().filter_map(short).collect()
}

/// Why the weights of the plans say little, where they do.
fn weights(record: &PlanRecord) -> Option<String> {
    let (median, samples) = (record.effective.median, record.plans.samples);
    let temperature = record.plans.temperature;
    if samples > 1 && median > ALL * f64::from(samples) {
        return Some(format!(
            "{} of {samples} samples are effective, so all weigh about the same and a plan is their mean: \
             the temperature {temperature} is large beside the differences of their costs: lower it, unless \
             the costs hardly depend on the controls",
            lower(median)
        ));
    }
    (samples >= MANY && median > 0.0 && median < ONE).then(|| {
        format!(
            "{} of {samples} samples are effective, so one sample is the plan: the temperature \
             {temperature} is small beside the differences of their costs; raise it, or scale the weights \
             down",
            upper(median)
        )
    })
}
