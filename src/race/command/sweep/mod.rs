//! The command `sweep`: a grid of settings, raced or certified point by point.

mod arguments;
mod axes;
mod certificate;
mod grid;
mod race;
mod text;

use crate::cli::options::Global;
use crate::cli::progress::Progress;
use crate::cli::{Outcome, devices, report};
use crate::error::Result;
use crate::race::sweep::record::{PointRecord, PointResult, SweepRecord};
use crate::race::sweep_page::sweep_html;
use arguments::Of;

pub(super) use arguments::SweepArguments;

/// Where the results go unless `--out` says otherwise.
const DEFAULT_OUT: &str = "reachcast-sweep";

/// Whether every certificate holds; races claim nothing.
fn outcome(record: &SweepRecord) -> Outcome {
    let fails = |point: &PointRecord| match &point.result {
        PointResult::Race(_) => false,
        PointResult::Certificate(certificate) => !certificate.holds,
    };
    if record.points.iter().any(fails) { Outcome::NotObtained } else { Outcome::Done }
}

/// Runs the points that are not stored yet and writes the tables and the page of all.
pub(super) fn run(global: &Global, asked: &SweepArguments) -> Result<Outcome> {
    let grid = axes::grid(asked)?;
    let out = global.folder(DEFAULT_OUT);
    let progress = Progress::new(global);
    let backend = devices::open(global)?;
    let mut store = match asked.of {
        Of::Race => race::run(global, asked, &grid, &backend, &progress, &out)?,
        Of::Certificate => certificate::run(global, asked, &grid, &backend, &progress, &out)?,
    };
    progress.finish();
    devices::note_events(global, &backend);
    let files = store.finish(sweep_html)?;
    report(global, store.record(), || text::text(store.record(), &files))?;
    Ok(outcome(store.record()))
}
