//! How far f32 measures lie from f64, on a few pairs; and plants whose f64 rollouts are other rollouts.

use super::pairs_f64;
use super::record::GlobalRecord;
use crate::error::Result;
use crate::rollout::{DeviationTask, Keep, NON_FINITE};
use crate::rounding::number;

use super::Context;

/// Pairs that are run in f32 and f64 to measure the f32 error.
pub(super) const PROBES: u64 = 128;
/// Difference, beside the larger measure or a tenth, from which on two measures are of other rollouts:
/// thousands of roundings.
const APART: f64 = 1e-2;
/// Share of the probes from which on that is said: a state on the edge of a branch may differ once.
const TOLD: f64 = 0.125;

/// What the probes showed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Probe {
    /// The largest distance of an f32 measure from f64, of those that are finite.
    pub(super) error: f64,
    /// Pairs of which a measure lies far from f64.
    pub(super) apart: u64,
}

/// Runs the first pairs of `task` in f32 and in f64.
pub(super) fn probe(context: Context<'_>, task: &DeviationTask<'_>) -> Result<Probe> {
    let range = 0..PROBES.min(task.range.end);
    let sample = DeviationTask { range: range.clone(), ..task.clone() };
    let tally = context.program.tally_pairs(&sample, Keep::Measures)?;
    let singles = tally.finish(range.clone())?.values;
    let doubles = pairs_f64::measures(context.plant(), task, &range.collect::<Vec<u64>>());
    let mut found = Probe::default();
    for (single, double) in singles.iter().zip(doubles) {
        let both = [(single.nominal, double[0]), (single.perturbed, double[1])];
        found.error = both.map(error).into_iter().fold(found.error, f64::max);
        found.apart += u64::from(both.into_iter().any(apart));
    }
    Ok(found)
}

/// The distance of two measures that are both finite; 0 of others.
fn error((single, double): (f32, f64)) -> f64 {
    let open = single == NON_FINITE || double == f64::from(NON_FINITE);
    if open { 0.0 } else { (double - f64::from(single)).abs() }
}

/// Whether no rounding explains the distance of two measures.
fn apart((single, double): (f32, f64)) -> bool {
    let size = f64::from(single.abs()).min(double.abs()).max(0.1);
    error((single, double)) > APART * size
}

/// That f64 rollouts of the same starts are other rollouts, where the probes show it.
pub(super) fn statement(global: &GlobalRecord) -> Option<String> {
    let (apart, probes) = (global.f32_apart?, PROBES.min(global.draws));
    (apart as f64 > TOLD * probes as f64).then(|| {
        format!(
            "CAUTION: {apart} of {probes} pairs that were run in f32 and in f64 have measures that lie up \
             to {} apart, far more than rounding explains: the plant amplifies the last digits of its \
             state, as one does that draws pseudo-random numbers from them. Then a rollout that is run \
             again in f64 is another one, and its failures are of other numbers. Give such numbers as \
             noise that is drawn for the rollout.",
            number(global.f32_error)
        )
    })
}
