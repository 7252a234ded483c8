//! A file of starts beside a search: all of them are rolled out and counted.

use serde::Serialize;

use crate::backend::Program;
use crate::error::Result;
use crate::rollout::{RolloutSpec, Starts, States};
use crate::rounding::interval as outwards;
use crate::scenario::bound::interval;
use crate::scenario::counterexamples::{FailingStart, Worst};
use crate::scenario::global::band_of;
use crate::scenario::walk::Walk;
use crate::scenario::{Context, Watch};

/// One minus the confidence of the interval, as of `rollout`.
const BETA: f64 = 0.05;

/// How the starts of a file fare.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileRecord {
    /// Starts in the file, N.
    pub starts: u64,
    /// Of which fail, k; a measure within rounding of zero is that of f64.
    pub failures: u64,
    /// Two-sided 95 % interval (Clopper-Pearson) of the probability with which a start fails of whatever they
    /// were drawn from, if they were drawn independently.
    #[serde(with = "crate::files::number")]
    pub failure_interval: [f64; 2],
    /// The worst of those that fail, by their place in the file, from 0.
    pub worst: Vec<FailingStart>,
    /// The same in words.
    pub words: String,
}

/// Rolls out all of `states`.
///
/// # Errors
/// Those of the backend and of the watch.
pub fn roll_out(
    program: &Program<'_>,
    spec: RolloutSpec,
    states: States<'_>,
    watch: &dyn Watch,
) -> Result<FileRecord> {
    let (starts, count) = (Starts::Listed(states), states.len() as u64);
    watch.begin("starts of the file", count);
    let (mut worst, mut failures) = (Worst::default(), 0);
    let walk = Walk { starts: starts.clone(), range: 0..count, spec, band: band_of(0.0) };
    walk.each(Context { program, watch }, |rolled| {
        if rolled.failed() {
            failures += 1;
            worst.add(rolled.single, rolled.index);
        }
    })?;
    let (low, high) = interval(failures, count, BETA);
    let failure_interval = [low, high];
    let words = format!(
        "all {count} starts of the file were rolled out and {failures} fail, which is a count of the file and no \
         estimate. Of what they were drawn from, if independently, a start fails with probability {} \
         (N = {count}, k = {failures}, 95 % interval of Clopper and Pearson)",
        outwards(failure_interval)
    );
    let worst = worst.starts(&starts);
    Ok(FileRecord { starts: count, failures, failure_interval, worst, words })
}
