//! The verdict on the box in a sentence: the certified subset beside the whole, so that a box that mostly
//! fails never reads as certified.

use super::enclosed_record::EnclosedRecord;
use super::record::GlobalRecord;
use crate::rounding::{interval, upper};

/// What is certified of the box, and how often any start of it fails.
pub(super) fn verdict(
    global: &GlobalRecord,
    enclosed: Option<&EnclosedRecord>,
    [low, high]: [f64; 2],
) -> String {
    let whole =
        format!("over the whole box a start fails with probability {}", interval([low, high]));
    let mostly = match () {
        () if low > 0.5 => ": most of the box fails",
        () if high >= 0.5 => ": it is not shown that most of the box succeeds",
        () => "",
    };
    format!("{}; {whole}{mostly}", subset(global, enclosed))
}

/// What is certified of the box.
fn subset(global: &GlobalRecord, enclosed: Option<&EnclosedRecord>) -> String {
    if global.accepted == 0 || global.claim.certified_risk >= 1.0 {
        return "nothing of the box is certified".to_owned();
    }
    let share = interval(global.share_interval.map(|share| 100.0 * share));
    if let Some(enclosed) = enclosed {
        return format!("certified is {share} % of the box: {}", enclosed.short());
    }
    format!(
        "certified is {share} % of the box, where a perturbed start fails with probability at most {}",
        upper(global.claim.certified_risk)
    )
}
