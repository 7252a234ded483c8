//! The table of every point, and those of starts and provenance.

use super::grid::Grid;
use super::readings::{certificate, judged, race, share};
use crate::race::judge::{FailureClass, Judge};
use crate::race::page::provenance::provenance;
use crate::race::page::verdicts::{self, Ceiling};
use crate::race::sweep::record::{CertificatePoint, RacePoint, SweepRecord};
use crate::report::sortable::{Cell, Column, Order, sortable};
use crate::report::table::pairs;
use crate::report::text::{
    count, interval, lower, minus, number, or_dash, percent, percents, upper,
};
use crate::scenario::record::GrowthOutcome;

/// Every point with its values and results.
pub(super) fn points(grid: &Grid<'_>) -> String {
    let mut columns = vec![numbers(grid.points.len())];
    columns.extend((0..grid.axes.len()).map(|axis| values(grid, axis)));
    let races: Vec<_> = grid.points.iter().filter_map(|point| race(point.record)).collect();
    let certificates: Vec<_> =
        grid.points.iter().filter_map(|point| certificate(point.record)).collect();
    // The points of a sweep are all of one kind.
    if certificates.is_empty() {
        columns.extend(success(grid));
        columns.extend(race_columns(&races));
        columns.extend(failures(grid));
        columns.extend(other_judges(grid.record, &races));
    } else {
        columns.extend(certificate_columns(&certificates));
    }
    sortable("Every point", &columns)
}

fn numbers(points: usize) -> Column {
    let cells = (1..=points).map(|point| Cell::number(point as f64, point.to_string()));
    Column { name: "point".to_owned(), order: Order::Number, cells: cells.collect() }
}

/// The values of an axis.
fn values(grid: &Grid<'_>, index: usize) -> Column {
    let axis = &grid.axes[index];
    let cell = |place: usize| {
        let (text, number) = axis.values[place];
        number.map_or_else(|| Cell::text(text), |number| Cell::number(number, text))
    };
    let cells = grid.points.iter().map(|point| cell(point.places[index])).collect();
    let order = if axis.is_numeric() { Order::Number } else { Order::Text };
    Column { name: axis.name.to_owned(), order, cells }
}

/// A column of numbers.
fn column<T>(name: &str, of: &[T], cell: impl Fn(&T) -> Cell) -> Column {
    Column { name: name.to_owned(), order: Order::Number, cells: of.iter().map(cell).collect() }
}

/// A whole number.
fn whole(value: u64) -> Cell {
    Cell::number(value as f64, count(value))
}

/// The verdicts of the sweep's judge.
fn success(grid: &Grid<'_>) -> Vec<Column> {
    let all: Vec<_> = grid.points.iter().map(|point| judged(grid.record, point.record)).collect();
    let mut columns = vec![
        column("won", &all, |judged| Cell::optional(judged.map(|judged| judged.rate), percent)),
        column("95 % interval", &all, |judged| match judged {
            Some(judged) => Cell::number(judged.interval[0], percents(judged.interval)),
            None => Cell::text("–"),
        }),
    ];
    if grid.record.noise_seeds.len() > 1 {
        let spread = |spread: f64| number(100.0 * spread);
        columns.push(column("spread of seeds, points", &all, |judged| {
            Cell::optional(judged.and_then(|judged| judged.spread), spread)
        }));
    }
    columns
}

fn race_columns(races: &[&RacePoint]) -> Vec<Column> {
    let milliseconds = |seconds: f64| Cell::number(seconds, number(1e3 * seconds));
    vec![
        column("latency, median ms", races, |race| milliseconds(race.latency.median_seconds)),
        column("95th percentile, ms", races, |race| milliseconds(race.latency.p95_seconds)),
        column("99th percentile, ms", races, |race| milliseconds(race.latency.p99_seconds)),
        column("steps timed", races, |race| whole(race.latency.steps)),
        column("share of a batch step, ms", races, |race| milliseconds(race.batch_seconds)),
        column("effective samples", races, |race| Cell::optional(race.effective_samples, number)),
        column("best cost", races, |race| {
            Cell::optional(race.best_cost, |cost| minus(&number(cost)))
        }),
        column("samples not finite", races, |race| whole(race.non_finite_samples)),
        column("races", races, |race| whole(race.races)),
    ]
}

/// Races lost in each class under the sweep's judge.
fn failures(grid: &Grid<'_>) -> Vec<Column> {
    let all: Vec<_> = grid.points.iter().map(|point| judged(grid.record, point.record)).collect();
    let class = |class: FailureClass| {
        column(verdicts::class(class), &all, |judged| match judged {
            Some(judged) => whole(verdicts::failures(judged, class)),
            None => Cell::text("–"),
        })
    };
    verdicts::CLASSES.map(class).into()
}

/// The success rates under the judges that the figures do not show.
fn other_judges(record: &SweepRecord, races: &[&RacePoint]) -> Vec<Column> {
    let others = Judge::ALL.into_iter().filter(|&judge| Some(judge) != record.judge);
    let rate = |race: &RacePoint, judge: Judge| {
        let judged = race.judged.iter().find(|judged| judged.judge == judge);
        Cell::optional(judged.map(|judged| judged.rate), percent)
    };
    others
        .filter(|&judge| races.iter().any(|race| race.judged.iter().any(|one| one.judge == judge)))
        .map(|judge| {
            column(&format!("won, {} judge", judge.name()), races, |race| rate(race, judge))
        })
        .collect()
}

fn certificate_columns(all: &[&CertificatePoint]) -> Vec<Column> {
    let shares = |[low, high]: [f64; 2]| Cell::number(low, percents([low, high]));
    vec![
        column("certified share", all, |one| Cell::number(share(one), percent(share(one)))),
        column("interval of the share", all, |one| shares(one.share_interval)),
        column("certified draws", all, |one| whole(one.accepted)),
        column("draws", all, |one| whole(one.draws)),
        column("pairs N", all, |one| whole(one.deviation_scenarios)),
        column("deviation risk", all, |one| {
            Cell::number(one.deviation_risk, upper(one.deviation_risk))
        }),
        column("largest deviation bound", all, |one| {
            Cell::number(one.deviation_bound, upper(one.deviation_bound))
        }),
        column("failure risk in the set", all, |one| {
            Cell::number(one.conditional_risk, upper(one.conditional_risk))
        }),
        outcomes(all),
        column("radius", all, |one| Cell::number(one.radius, lower(one.radius))),
        column("rounds", all, |one| whole(one.rounds)),
        column("starts N of a round", all, |one| whole(one.growth_scenarios)),
        column("volume", all, |one| {
            Cell::number(one.volume_interval[0], interval(one.volume_interval))
        }),
        column("every claim obtained", all, |one| {
            Cell::number(f64::from(u8::from(one.holds)), if one.holds { "yes" } else { "no" })
        }),
        column("beta of all claims", all, |one| {
            Cell::number(one.beta_total, upper(one.beta_total))
        }),
        column("wall time, s", all, |one| Cell::number(one.seconds, number(one.seconds))),
    ]
}

fn outcomes(all: &[&CertificatePoint]) -> Column {
    let word = |one: &&CertificatePoint| {
        Cell::text(match one.growth {
            GrowthOutcome::Verified => "verified",
            GrowthOutcome::Exhausted => "exhausted",
            GrowthOutcome::NoBoundary => "no boundary",
        })
    };
    let cells = all.iter().map(word).collect();
    Column { name: "local growth".to_owned(), order: Order::Text, cells }
}

/// The tables of two columns.
pub(super) fn narrow(record: &SweepRecord) -> String {
    starts(record) + &provenance(record.schema, &record.provenance, &[])
}

fn starts(record: &SweepRecord) -> String {
    let Some(starts) = &record.starts else {
        return String::new();
    };
    let seeds: Vec<_> = record.noise_seeds.iter().map(u64::to_string).collect();
    let mut values = vec![
        ("starts", count(starts.count)),
        ("source", starts.source.clone()),
        ("starts SHA-256", starts.sha256.clone()),
        ("noise seeds", seeds.join(", ")),
        ("judge", or_dash(record.judge.map(Judge::name))),
    ];
    let ceiling = record.judge.and_then(|judge| verdicts::ceiling(starts, judge));
    if let Some(Ceiling { safe, share }) = ceiling {
        values.push(("safe at t = 0", format!("{}, {}", count(safe), percent(share))));
    }
    pairs("Starts and noise", &values)
}
