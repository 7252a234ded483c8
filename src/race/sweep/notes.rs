//! What of the points of a sweep has to be said beside their figures.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use serde_json::Value;

use super::record::{
    CertificatePoint, LatencyRecord, PointRecord, PointResult, RacePoint, SweepRecord,
};
use crate::race::controller::Name;
use crate::race::weights::Weights;

/// Points that are named one by one.
const NAMED: usize = 3;

/// Points whose plans weigh their samples in a way that says little, with the figures, and axes that change
/// nothing.
pub(super) fn notes(record: &SweepRecord) -> Vec<String> {
    let mut notes: Vec<String> =
        record.points.iter().filter_map(|point| note(record, point)).collect();
    let more = notes.len().saturating_sub(NAMED);
    notes.truncate(NAMED);
    if more > 0 {
        notes.push(format!("the same goes for {more} more points"));
    }
    let idle = (0..record.axes.len()).filter(|&axis| is_idle(record, axis));
    notes.extend(idle.map(|axis| idle_note(&record.axes[axis].name)));
    notes
}

/// Whether points that differ on an axis alone all came to the same, times apart; there are some.
fn is_idle(record: &SweepRecord, axis: usize) -> bool {
    let elsewhere = |point: &PointRecord| {
        let values = point.values.iter().enumerate();
        values.filter(|(i, _)| *i != axis).map(|(_, value)| value.clone()).collect::<Vec<_>>()
    };
    let mut firsts: BTreeMap<Vec<String>, PointResult> = BTreeMap::new();
    let mut compared = false;
    let all_alike = record.points.iter().all(|point| match firsts.entry(elsewhere(point)) {
        Entry::Vacant(place) => {
            place.insert(without_times(&point.result));
            true
        }
        Entry::Occupied(first) => {
            compared = true;
            *first.get() == without_times(&point.result)
        }
    });
    compared && all_alike
}

/// A result whose times are 0.
fn without_times(result: &PointResult) -> PointResult {
    match result {
        PointResult::Certificate(point) => {
            PointResult::Certificate(CertificatePoint { seconds: 0.0, ..*point })
        }
        PointResult::Race(point) => {
            let still = LatencyRecord {
                median_seconds: 0.0,
                p95_seconds: 0.0,
                p99_seconds: 0.0,
                ..point.latency
            };
            PointResult::Race(RacePoint { latency: still, batch_seconds: 0.0, ..point.clone() })
        }
    }
}

fn idle_note(axis: &str) -> String {
    format!(
        "no figure of any point changes with `{axis}`: nothing that was computed here depends on it"
    )
}

/// The note on a point.
fn note(record: &SweepRecord, point: &PointRecord) -> Option<String> {
    let PointResult::Race(race) = &point.result else { return None };
    let controller = value(record, point, "controller")?;
    let name = Name::ALL.iter().find(|name| name.text() == controller)?;
    let sections = name.plan_sections().iter();
    let of = |key: &str| {
        let numbers = sections.clone().filter_map(|section| number(record, point, section, key));
        numbers.max_by(f64::total_cmp)
    };
    let weights = Weights {
        samples: of("samples")? as u64,
        temperature: of("temperature")?,
        effective: race.effective_samples,
        best_cost: race.best_cost,
    };
    let axes = record.axes.iter().zip(&point.values).filter(|(axis, _)| axis.values.len() > 1);
    let values: Vec<String> = axes.map(|(axis, value)| format!("{} {value}", axis.name)).collect();
    weights.note(&values.join(", "))
}

/// The value of the point on the axis `name`.
fn value<'a>(record: &SweepRecord, point: &'a PointRecord, name: &str) -> Option<&'a str> {
    let at = record.axes.iter().position(|axis| axis.name == name)?;
    point.values.get(at).map(String::as_str)
}

/// The number of a key in a section of plans: of an axis, else of the configuration.
fn number(record: &SweepRecord, point: &PointRecord, section: &str, key: &str) -> Option<f64> {
    let own = value(record, point, &format!("{section}.{key}"));
    let given = value(record, point, key).or(own).and_then(|text| text.parse().ok());
    let path = format!("/{}/{key}", section.replace('.', "/"));
    given.or_else(|| record.provenance.config.pointer(&path).and_then(Value::as_f64))
}
