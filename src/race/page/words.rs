//! Words and numbers shared by the figures and tables of the race page.

use super::verdicts::{self, Ceiling};
use crate::race::judge::Judge;
use crate::race::record::{ControllerRecord, JudgedRecord, RaceRecord};
use crate::report::text::{interval, minus, number, ordinary};

/// Name of the controller that the others are compared with.
const HYBRID: &str = "hybrid";

/// What is flown in a tier.
pub(super) fn tier(tier: u8) -> &'static str {
    match tier {
        0 => "in the target, once in it, or at the gate: fast MPPI",
        1 => "V_check is positive: the policy",
        2 => "in the verified ball: the policy",
        _ => "none of these: recovery",
    }
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

/// Most races that can be won under `judge`.
pub(super) fn ceiling(record: &RaceRecord, judge: Judge) -> Option<Ceiling> {
    verdicts::ceiling(&record.starts, judge)
}

/// Races of each controller: starts times noise seeds.
pub(super) fn races(record: &RaceRecord) -> u64 {
    record.starts.count.saturating_mul(record.noise_seeds.len() as u64)
}
