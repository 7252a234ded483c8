//! What of the points of a sweep has to be said beside their figures.

use serde_json::Value;

use super::record::{PointRecord, PointResult, SweepRecord};
use crate::race::controller::Name;
use crate::race::weights::Weights;

/// Points that are named one by one.
const NAMED: usize = 3;

/// Points whose plans weigh their samples in a way that says little, with the figures.
pub(super) fn notes(record: &SweepRecord) -> Vec<String> {
    let mut notes: Vec<String> =
        record.points.iter().filter_map(|point| note(record, point)).collect();
    let more = notes.len().saturating_sub(NAMED);
    notes.truncate(NAMED);
    if more > 0 {
        notes.push(format!("the same goes for {more} more points"));
    }
    notes
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
