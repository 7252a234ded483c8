//! Compares a stored record with the one computed again from its seed, field by field.

use serde_json::Value;

use super::finding::{Figure, Finding};
use super::record::{Record, SCHEMA};
use super::settings::Joint;

/// Difference, relative to the larger number or to one, that another device's rounding may make.
const TOLERANCE: f64 = 1e-3;
/// Difference of a count beside its share of the draws that another device's rounding may make.
const MOVED: f64 = 2.0;
/// Fields that a second run may change: who ran it, what failed on the way and how long it took, and
/// the digests, which are checked when a record is read.
const FREE: [&str; 7] = [
    "digests",
    "timing",
    "events",
    "provenance.backend",
    "provenance.device",
    "provenance.networks",
    "provenance.version",
];
/// Fields that are measured on the device, or that put its numbers into words.
const OF_THE_DEVICE: [&str; 10] = [
    "statements",
    "global.f32_error",
    "global.f32_apart",
    "global.band",
    "global.f64_reruns",
    "growth.rounds",
    "whole_box.verdict",
    "whole_box.f64_reruns",
    "whole_box.starts",
    "whole_box.pairs",
];
/// Fields that each version of the record has its own way of.
const OF_THE_VERSION: [&str; 4] =
    ["schema", "provenance.physics_sha256", "provenance.policy_sha256", "global.claim.epsilon"];
/// Fields that are another thing since schema 3 where the steps are bounded separately: each step has
/// its own beta.
const OF_SEPARATE_STEPS: [&str; 2] = ["ledger", "beta_total"];
/// Counts of rollouts, in which a measure may have crossed zero.
const COUNTS: [&str; 5] = ["accepted", "certified", "failures", "reached", "non_finite"];

/// One finding: whether every field of the record is what its seed and configuration give.
///
/// On the device that made it the record must be the same to the last digit; on another one
/// numbers may differ by rounding.
pub(super) fn fields(stored: &Record, again: &Record) -> Finding {
    let same_version = stored.schema == SCHEMA;
    let same_device = same_version
        && stored.provenance.backend == again.provenance.backend
        && stored.provenance.device == again.provenance.device
        && stored.provenance.version == again.provenance.version
        // What failed half-way was finished on another device.
        && stored.events.is_empty()
        && again.events.is_empty();
    let (Ok(was), Ok(is)) = (serde_json::to_value(stored), serde_json::to_value(again)) else {
        return finding(vec!["the record has no JSON form".to_owned()]);
    };
    let mut walk = Walk {
        same_version,
        same_device,
        separate: again.deviation.joint == Joint::Separate,
        draws: again.global.draws as f64,
        differences: Vec::new(),
    };
    walk.compare("", &was, &is);
    finding(walk.differences)
}

fn finding(differences: Vec<String>) -> Finding {
    let found = match differences.as_slice() {
        [] => "the same".to_owned(),
        [only] => only.clone(),
        [first, rest @ ..] => format!("{first}, and {} more", rest.len()),
    };
    Finding {
        name: "every field of the record".to_owned(),
        stored: Figure::Words("as its seed and configuration give it".to_owned()),
        found: Figure::Words(found),
        holds: differences.is_empty(),
    }
}

/// A walk through two JSON values side by side.
struct Walk {
    same_version: bool,
    same_device: bool,
    separate: bool,
    draws: f64,
    differences: Vec<String>,
}

impl Walk {
    fn compare(&mut self, path: &str, was: &Value, is: &Value) {
        let under = |names: &[&str]| {
            names.iter().any(|name| {
                path.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            })
        };
        if under(&FREE)
            || (!self.same_device && under(&OF_THE_DEVICE))
            || (!self.same_version && under(&OF_THE_VERSION))
            || (!self.same_version && self.separate && under(&OF_SEPARATE_STEPS))
        {
            return;
        }
        match (was, is) {
            (Value::Object(was_map), Value::Object(is_map)) => {
                // What an older version has no field for is not looked for in it.
                let same_version = self.same_version;
                let new = |key: &&String| same_version && !was_map.contains_key(*key);
                let added = is_map.keys().filter(new);
                for key in was_map.keys().chain(added) {
                    let inner = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                    let [was, is] =
                        [was_map, is_map].map(|map| map.get(key).unwrap_or(&Value::Null));
                    self.compare(&inner, was, is);
                }
            }
            (Value::Array(was_list), Value::Array(is_list)) if was_list.len() == is_list.len() => {
                for (i, (was, is)) in was_list.iter().zip(is_list).enumerate() {
                    self.compare(&format!("{path}.{i}"), was, is);
                }
            }
            (Value::Number(_), Value::Number(_)) if self.close(path, was, is) => {}
            (Value::String(_), Value::String(_)) if !self.same_device && in_words(path) => {}
            _ if was == is => {}
            _ => self.differences.push(format!(
                "{path} is {} here, {} stored",
                short(is),
                short(was)
            )),
        }
    }

    /// Whether two numbers agree as far as the devices do.
    fn close(&self, path: &str, was: &Value, is: &Value) -> bool {
        let (Some(was), Some(is)) = (was.as_f64(), is.as_f64()) else { return false };
        if self.same_device {
            return was == is;
        }
        let last = path.rsplit('.').next().unwrap_or(path);
        let allowed = if COUNTS.contains(&last) || path == "global.claim.scenarios" {
            MOVED + TOLERANCE * self.draws
        } else {
            TOLERANCE * was.abs().max(is.abs()).max(1.0)
        };
        (was - is).abs() <= allowed
    }
}

/// Whether the field puts computed numbers into words.
fn in_words(path: &str) -> bool {
    path.ends_with(".statement") || path.ends_with(".measure")
}

/// A value in few characters.
fn short(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{} ...", &text[..end]),
        None => text,
    }
}
