//! Words and numbers shared by the figures and tables of the race page.

use crate::experiment::judge::{FailureClass, Judge};
use crate::experiment::record::{ControllerRecord, JudgedRecord, RaceRecord};
use crate::report::text::{interval, number, ordinary};

/// Name of the controller that the others are compared with.
const HYBRID: &str = "hybrid";

/// Every class in the order of figures and tables.
pub(super) const CLASSES: [FailureClass; 7] = FailureClass::ALL;

/// Name of a judge.
pub(super) fn judge(judge: Judge) -> &'static str {
    match judge {
        Judge::Study => "study",
        Judge::Paper => "paper",
        Judge::Rigorous => "rigorous",
    }
}

/// What a judge asks for.
pub(super) fn rules(judge: Judge) -> &'static str {
    match judge {
        Judge::Study => "the rules of the published code",
        Judge::Paper => {
            "the rules as printed in the paper, the gate in place of the fences where it is crossed"
        }
        Judge::Rigorous => "the same with the cone in its distance form",
    }
}

/// Name of a failure class.
pub(super) fn class(class: FailureClass) -> &'static str {
    match class {
        FailureClass::UnsafeStart => "unsafe start",
        FailureClass::NotFinite => "not finite",
        FailureClass::Collision => "collision",
        FailureClass::Fence => "fence",
        FailureClass::MissedGate => "missed gate",
        FailureClass::Overtaken => "overtaken",
        FailureClass::Timeout => "timeout",
    }
}

/// The letter and the style class of a failure class; no two share a letter.
pub(super) fn mark(class: FailureClass) -> (&'static str, &'static str) {
    match class {
        FailureClass::UnsafeStart => ("U", "unsafe"),
        FailureClass::NotFinite => ("N", "infinite"),
        FailureClass::Collision => ("C", "collision"),
        FailureClass::Fence => ("F", "fence"),
        FailureClass::MissedGate => ("M", "missed"),
        FailureClass::Overtaken => ("O", "overtaken"),
        FailureClass::Timeout => ("T", "timeout"),
    }
}

/// What is flown in a tier.
pub(super) fn tier(tier: u8) -> &'static str {
    match tier {
        0 => "in the target, once in it, or at the gate: fast MPPI",
        1 => "V_check is positive: the policy",
        2 => "in the verified ball: the policy",
        _ => "none of these: recovery",
    }
}

/// A share in percent; the sign stays on the line of its number.
pub(super) fn percent(share: f64) -> String {
    format!("{}\u{a0}%", number(100.0 * share))
}

/// An interval of shares in percent, rounded outwards.
pub(super) fn percents(shares: [f64; 2]) -> String {
    format!("{}\u{a0}%", interval(shares.map(|share| 100.0 * share)))
}

/// A difference of shares in points, with its sign.
pub(super) fn points(difference: f64) -> String {
    let sign = if difference > 0.0 && ordinary(difference) { "+" } else { "" };
    format!("{sign}{}", minus(&number(100.0 * difference)))
}

/// An interval of differences in points, rounded outwards.
pub(super) fn point_interval(ends: [f64; 2]) -> String {
    minus(&interval(ends.map(|end| 100.0 * end)))
}

/// A number with true minus signs, after which no line breaks.
pub(super) fn minus(number: &str) -> String {
    number.replace('-', "−")
}

/// `noun` after its count, `nouns` unless there is one.
pub(super) fn counted(count: usize, noun: &str, nouns: &str) -> String {
    format!("{count} {}", if count == 1 { noun } else { nouns })
}

/// `a`, `a and b`, or `a, b and c`.
pub(super) fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// The judges of the record, in the order in which they first appear.
pub(super) fn judges(record: &RaceRecord) -> Vec<Judge> {
    let ceilings = record.starts.ceilings.iter().map(|ceiling| ceiling.judge);
    let judged = record.controllers.iter().flat_map(|controller| &controller.judged);
    let mut judges = Vec::new();
    for judge in ceilings.chain(judged.map(|judged| judged.judge)) {
        if !judges.contains(&judge) {
            judges.push(judge);
        }
    }
    judges
}

/// The verdicts of `judge` on a controller.
pub(super) fn judged(controller: &ControllerRecord, judge: Judge) -> Option<&JudgedRecord> {
    controller.judged.iter().find(|judged| judged.judge == judge)
}

/// The controllers that `judge` has judged, with its verdicts.
pub(super) fn verdicts(
    record: &RaceRecord,
    judge: Judge,
) -> impl Iterator<Item = (&ControllerRecord, &JudgedRecord)> {
    let controllers = record.controllers.iter();
    controllers.filter_map(move |controller| Some((controller, judged(controller, judge)?)))
}

/// The hybrid controller, or the first one where it did not run.
pub(super) fn lead(record: &RaceRecord) -> Option<&ControllerRecord> {
    let mut controllers = record.controllers.iter();
    controllers.find(|controller| controller.name == HYBRID).or(record.controllers.first())
}

/// Starts that `judge` finds safe before anyone moves, and their share.
pub(super) fn ceiling(record: &RaceRecord, judge: Judge) -> Option<(u64, f64)> {
    let ceiling = record.starts.ceilings.iter().find(|ceiling| ceiling.judge == judge)?;
    let count = record.starts.count;
    (count > 0).then(|| (ceiling.safe, ceiling.safe as f64 / count as f64))
}

/// Races of each controller: starts times noise seeds.
pub(super) fn races(record: &RaceRecord) -> u64 {
    record.starts.count.saturating_mul(record.noise_seeds.len() as u64)
}

/// Failures of one class, over all seeds.
pub(super) fn failures(judged: &JudgedRecord, class: FailureClass) -> u64 {
    let same = judged.failures.iter().filter(|failure| failure.class == class);
    same.map(|failure| failure.count).sum()
}
