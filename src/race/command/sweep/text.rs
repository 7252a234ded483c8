//! A sweep as a page of text.

use std::path::PathBuf;

use crate::race::sweep::record::{
    CertificatePoint, PointRecord, PointResult, RacePoint, SweepRecord,
};
use crate::rounding::{interval, lower, number, upper};

/// One line per point, and where the files are.
pub(super) fn text(record: &SweepRecord, files: &[PathBuf]) -> String {
    let mut rows = vec![header(record)];
    rows.extend(record.points.iter().map(|point| row(record, point)));
    let mut text = headline(record);
    let columns = rows[0].len();
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    for row in &rows {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:>width$}"));
        text += &(cells.collect::<Vec<_>>().join("  ") + "\n");
    }
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    text += legend(record);
    text.extend(record.notes.iter().map(|note| format!("note: {note}\n")));
    text + "\nfiles  " + &names.join("\n       ") + "\n"
}

/// What the columns are.
fn legend(record: &SweepRecord) -> &'static str {
    match record.starts {
        Some(_) => {
            "effective: mean of 1 / sum w^2 over the plans, from 1 to K; best cost: mean of the smallest\n\
             of a plan's samples; median, p95, p99: ms of a control step of one race that flies alone\n"
        }
        None => {
            "N: pairs of the deviation bound; certified share: interval of the certified set's share of\n\
             the box; risk: most that a perturbed rollout from there fails with; growth, radius: what came\n\
             of the ball around a boundary point (exhausted: each radius had failures; no-boundary: no start that\n\
             is certified lies next to one that is not); holds: whether every claim that was asked for was obtained,\n\
             if not, certify of that point says which failed\n"
        }
    }
}

/// What every point shares.
fn headline(record: &SweepRecord) -> String {
    let Some(starts) = &record.starts else {
        return format!("{} certificates\n\n", record.points.len());
    };
    let judge = record.judge.map_or("", |judge| judge.name());
    format!(
        "{} points, {} starts ({}) each, noise seeds {:?}\n\
         Success under the {judge} judge with the 95 % interval of the first seed's run, latency of \
         a control step in ms\n\n",
        record.points.len(),
        starts.count,
        starts.source,
        record.noise_seeds
    )
}

/// The names of the columns.
fn header(record: &SweepRecord) -> Vec<String> {
    let axes = record.axes.iter().map(|axis| axis.name.clone());
    let results: &[&str] = match record.starts {
        Some(_) => &["success", "effective", "best cost", "median", "p95", "p99"],
        None => &["N", "certified share", "risk", "largest bound", "growth", "radius", "holds"],
    };
    axes.chain(results.iter().map(|name| (*name).to_owned())).collect()
}

/// The cells of a point.
fn row(record: &SweepRecord, point: &PointRecord) -> Vec<String> {
    let results = match &point.result {
        PointResult::Race(race) => race_cells(record, race),
        PointResult::Certificate(certificate) => certificate_cells(certificate),
    };
    point.values.iter().cloned().chain(results).collect()
}

/// Success, plans and latency.
fn race_cells(record: &SweepRecord, point: &RacePoint) -> Vec<String> {
    let judged = point.judged.iter().find(|judged| Some(judged.judge) == record.judge);
    let success = judged.map_or(String::new(), |judged| {
        let ends = judged.interval.map(|share| 100.0 * share);
        format!("{} % ({})", number(100.0 * judged.rate), interval(ends))
    });
    let or_dash = |value: Option<f64>| value.map_or("-".to_owned(), number);
    let latency = &point.latency;
    let seconds = [latency.median_seconds, latency.p95_seconds, latency.p99_seconds];
    let plans = [or_dash(point.effective_samples), or_dash(point.best_cost)];
    let milliseconds = seconds.map(|seconds| number(1e3 * seconds));
    std::iter::once(success).chain(plans).chain(milliseconds).collect()
}

/// Scenario count, certified set and growth.
fn certificate_cells(point: &CertificatePoint) -> Vec<String> {
    vec![
        point.deviation_scenarios.to_string(),
        interval(point.share_interval),
        upper(point.conditional_risk),
        upper(point.deviation_bound),
        point.growth.name().to_owned(),
        lower(point.radius),
        if point.holds { "yes" } else { "no" }.to_owned(),
    ]
}
