//! What the page says of a certified set that rests on no sample.

use super::table::pairs;
use super::text::lower;
use super::words;
use crate::scenario::record::{EnclosedRecord, Record};

/// How the set is enclosed, and for which perturbations; nothing of a set that margins certify.
pub(crate) fn table(record: &Record) -> String {
    let Some(found) = &record.enclosed else { return String::new() };
    pairs(
        "Certified set without samples",
        &[
            ("enclosure", found.kind.name().to_owned()),
            ("perturbed trajectories", words::control(found.control).to_owned()),
            ("radius of the ball around each state", lower(found.radius)),
        ],
    )
}

/// What the set says of one given state.
pub(crate) fn limit(record: &Record, found: &EnclosedRecord) -> String {
    format!(
        "The certified set says of each of its states that {}; in real arithmetic, of which f32 rollouts are \
         a rounding. Everything else is about a measure: how much of what is drawn from it may fail, not \
         which start does. The deviation bound is about {}; the chance of failure inside the set about {}.",
        found.short(),
        record.deviation.claim.measure,
        record.global.claim.measure
    )
}
