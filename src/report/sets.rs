//! The sets side by side: what is claimed of each, and how much of the box it has.

use super::table::{pairs, table};
use super::text::{count, lower, number, or_dash, percent, percents, upper};
use crate::scenario::drops_record::{DropsRecord, SequenceRecord, ShareRecord};
use crate::scenario::record::{Claim, Record};

/// The sets that the record has beside each other; nothing where there is but one.
pub(crate) fn sets(record: &Record) -> String {
    let Some(drops) = &record.drops else { return String::new() };
    let head = ["set", "what is claimed", "share of the box", "interval", "fresh starts", "pairs"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(record.global.share.map(|share| {
        let claim = &record.global.claim;
        let risk = upper(claim.certified_risk);
        let of = "a perturbed rollout from the set fails with probability at most";
        row("certified set", format!("{of} {risk}"), &share, claim.scenarios)
    }));
    rows.push(row(LAMBDA, joint(&drops.claim), &drops.share, drops.claim.scenarios));
    rows.extend(record.calibration.as_ref().map(|calibration| {
        let claim = &calibration.claim;
        row("measure above alpha", joint(claim), &calibration.share, claim.scenarios)
    }));
    rows.extend(drops.by_constants.map(|seen| {
        let share = percent(seen.inside as f64 / seen.draws.max(1) as f64);
        let claimed = joint(&record.deviation.claim);
        let pairs = count(record.deviation.claim.scenarios);
        let [name, none] = ["constants times the deviation bound", "–"].map(str::to_owned);
        vec![name, claimed, share, none, count(seen.draws), pairs]
    }));
    let levels = record.sequence.as_ref().map_or_else(String::new, levels);
    [table("Sets", &rows), levels].concat()
}

/// Name of the set of the bound on margin drops.
const LAMBDA: &str = "margin drops within lambda";

/// The joint claim of a set in words.
fn joint(claim: &Claim) -> String {
    let risk = upper(claim.certified_risk);
    format!("a start of the box is in the set and fails with probability at most {risk}")
}

fn row(name: &str, claimed: String, share: &ShareRecord, pairs: u64) -> Vec<String> {
    vec![
        name.to_owned(),
        claimed,
        percent(share.point()),
        percents(share.interval),
        count(share.draws),
        count(pairs),
    ]
}

/// The levels that were tested, strict to lax.
fn levels(sequence: &SequenceRecord) -> String {
    let head = ["level", "score above", "draws in the set", "failures", "risk at most", ""];
    let tested = sequence.levels.iter().enumerate().filter(|(_, level)| level.accepted.is_some());
    let rows = tested.map(|(number, level)| {
        vec![
            (number + 1).to_string(),
            super::text::number(level.level),
            or_dash(level.accepted.map(count)),
            or_dash(level.failures.map(count)),
            or_dash(level.risk.map(upper)),
            if number == sequence.chosen { "the certified set" } else { "" }.to_owned(),
        ]
    });
    let head = head.map(str::to_owned).to_vec();
    table("Sequence of sets", &std::iter::once(head).chain(rows).collect::<Vec<_>>())
}

/// What the bound on margin drops, sequence and calibration came to.
pub(crate) fn drops(record: &Record) -> String {
    let Some(drops) = &record.drops else { return String::new() };
    let mut values = bound(drops);
    if let Some(sequence) = &record.sequence {
        values.extend([
            ("conditional risk asked for, e", or_dash(sequence.risk.map(number))),
            ("outcome of the sequence", sequence.outcome.name().to_owned()),
            ("starts of the pilot of the levels", count(sequence.pilot)),
            ("draws that the strictest set is to hold", or_dash(sequence.start.map(count))),
            ("draws that e needs if none fails", or_dash(sequence.required.map(count))),
            ("level of the certified set", or_dash(sequence.level().map(upper))),
        ]);
    }
    if let Some(calibration) = &record.calibration {
        values.extend([
            ("alpha of the calibration", upper(calibration.level)),
            ("failing pairs of the calibration", count(calibration.failing)),
        ]);
    }
    pairs("Margin drops", &values)
}

/// What the bound came to.
fn bound(drops: &DropsRecord) -> Vec<(&'static str, String)> {
    let widest = drops.widest.as_ref();
    let widest = widest.map(|at| format!("step {}, {} margin", at.step, at.margin));
    vec![
        ("pairs of the pilot", count(drops.pilot)),
        ("lambda", upper(drops.level)),
        ("largest drop of all pairs, in shapes", upper(drops.largest)),
        ("where it was", or_dash(widest)),
        ("pairs discarded", count(drops.claim.failures)),
        ("pairs not finite", count(drops.non_finite)),
        ("smallest of the shapes", lower(smallest(drops))),
    ]
}

/// The smallest unit of a step.
fn smallest(drops: &DropsRecord) -> f64 {
    let both = drops.target_shape.iter().chain(&drops.constraint_shape);
    both.copied().fold(f64::INFINITY, f64::min)
}
