//! The points of a sweep as one flat table, the same for `sweep.csv` and `sweep.parquet`.

use super::record::{CertificatePoint, PointResult, RacePoint, SweepRecord};
use crate::files::{Column, Table};
use crate::race::judge::{FailureClass, Judge};
use crate::race::record::JudgedRecord;

/// One row per point: its value on each axis, then its results; durations in milliseconds, shares
/// as fractions.
pub fn table(record: &SweepRecord) -> Table {
    let mut table = Table::default();
    for (i, axis) in record.axes.iter().enumerate() {
        let values = record.points.iter().map(|point| point.values[i].as_str()).collect();
        table.add(&axis.name, axis_column(values));
    }
    let (mut races, mut certificates) = (Vec::new(), Vec::new());
    for point in &record.points {
        match &point.result {
            PointResult::Race(point) => races.push(point),
            PointResult::Certificate(point) => certificates.push(point),
        }
    }
    // The points of a sweep are all of one kind.
    if !races.is_empty() {
        race_columns(&mut table, &races);
    } else if !certificates.is_empty() {
        certificate_columns(&mut table, &certificates);
    }
    let hashes = record.points.iter().map(|point| point.sha256.clone()).collect();
    table.add("point_sha256", Column::Text(hashes));
    table
}

/// The values of an axis: whole numbers if all are, numbers if all are, else text.
fn axis_column(values: Vec<&str>) -> Column {
    let counts: Option<Vec<u64>> = values.iter().map(|text| text.parse().ok()).collect();
    let float = |text: &&str| text.parse().ok().filter(|number: &f64| number.is_finite());
    let floats: Option<Vec<_>> = values.iter().map(|text| float(text).map(Some)).collect();
    match (counts, floats) {
        (Some(counts), _) => Column::Count(counts),
        (None, Some(floats)) => Column::Float(floats),
        (None, None) => Column::Text(values.into_iter().map(str::to_owned).collect()),
    }
}

/// The figures of races.
fn race_columns(table: &mut Table, points: &[&RacePoint]) {
    let count =
        |of: &dyn Fn(&RacePoint) -> u64| Column::Count(points.iter().map(|p| of(p)).collect());
    let float = |of: &dyn Fn(&RacePoint) -> Option<f64>| {
        Column::Float(points.iter().map(|p| of(p)).collect())
    };
    table.add("races", count(&|point| point.races));
    for judge in Judge::ALL {
        judge_columns(table, points, judge);
    }
    let milliseconds = |seconds: f64| Some(1e3 * seconds);
    table.add("effective_samples", float(&|point| point.effective_samples));
    table.add("best_cost", float(&|point| point.best_cost));
    table.add("step_ms_median", float(&|point| milliseconds(point.latency.median_seconds)));
    table.add("step_ms_p95", float(&|point| milliseconds(point.latency.p95_seconds)));
    table.add("step_ms_p99", float(&|point| milliseconds(point.latency.p99_seconds)));
    table.add("timed_steps", count(&|point| point.latency.steps));
    table.add("batch_ms", float(&|point| milliseconds(point.batch_seconds)));
    table.add("non_finite_samples", count(&|point| point.non_finite_samples));
}

/// Rate, interval and failure classes under `judge`.
fn judge_columns(table: &mut Table, points: &[&RacePoint], judge: Judge) {
    let judged: Vec<_> = points
        .iter()
        .map(|point| point.judged.iter().find(|judged| judged.judge == judge))
        .collect();
    let name = judge.name();
    let float = |of: &dyn Fn(&JudgedRecord) -> f64| {
        Column::Float(judged.iter().map(|judged| judged.map(of)).collect())
    };
    table.add(&format!("{name}_rate"), float(&|judged| judged.rate));
    table.add(&format!("{name}_low"), float(&|judged| judged.interval[0]));
    table.add(&format!("{name}_high"), float(&|judged| judged.interval[1]));
    for class in FailureClass::ALL {
        let failed = |judged: &JudgedRecord| {
            judged.failures.iter().filter(|failure| failure.class == class).map(|f| f.count).sum()
        };
        let counts = judged.iter().map(|judged| judged.map_or(0, failed)).collect();
        table.add(&format!("{name}_{}", class.name().replace('-', "_")), Column::Count(counts));
    }
}

/// The figures of certificates.
fn certificate_columns(table: &mut Table, points: &[&CertificatePoint]) {
    let count = |of: &dyn Fn(&CertificatePoint) -> u64| {
        Column::Count(points.iter().map(|point| of(point)).collect())
    };
    let float = |of: &dyn Fn(&CertificatePoint) -> f64| {
        Column::Float(points.iter().map(|point| Some(of(point))).collect())
    };
    table.add("deviation_scenarios", count(&|point| point.deviation_scenarios));
    table.add("deviation_risk", float(&|point| point.deviation_risk));
    table.add("deviation_bound", float(&|point| point.deviation_bound));
    table.add("draws", count(&|point| point.draws));
    table.add("accepted", count(&|point| point.accepted));
    table.add("share_low", float(&|point| point.share_interval[0]));
    table.add("share_high", float(&|point| point.share_interval[1]));
    table.add("volume_low", float(&|point| point.volume_interval[0]));
    table.add("volume_high", float(&|point| point.volume_interval[1]));
    table.add("conditional_risk", float(&|point| point.conditional_risk));
    table.add("growth_scenarios", count(&|point| point.growth_scenarios));
    let outcomes = points.iter().map(|point| point.growth.name().to_owned()).collect();
    table.add("growth", Column::Text(outcomes));
    table.add("rounds", count(&|point| point.rounds));
    table.add("ball_radius", float(&|point| point.radius));
    table.add("holds", count(&|point| u64::from(point.holds)));
    table.add("beta_total", float(&|point| point.beta_total));
    table.add("seconds", float(&|point| point.seconds));
}
