//! Growth upward on the page: what was fixed beforehand, and the words of its figure.

use super::table::pairs;
use super::text::{count, lower, number, or_dash};
use super::words;
use crate::scenario::record::{GrowthOutcome, GrowthRecord, Record, UpwardRecord};

/// The table of what was fixed beforehand; empty of Algorithm 1.
pub(crate) fn upward(record: &Record) -> String {
    let Some(upward) = &record.growth.upward else { return String::new() };
    let radii: Vec<String> = upward.radii.iter().map(|radius| number(*radius)).collect();
    let piloted = (upward.pilot > 0)
        .then(|| format!("{} failed of {}", count(upward.pilot_failures), count(upward.pilot)));
    pairs(
        "Growth upward, fixed beforehand",
        &[
            ("what grows", upward.shape.name().to_owned()),
            ("radii, in their order", radii.join(", ")),
            ("failures that a round may have", count(upward.allowed)),
            ("starts of the pilot", or_dash(piloted)),
            ("half-widths of the verified set", or_dash(half_widths(&record.growth, upward))),
        ],
    )
}

/// Half of each side or axis of the verified set, 0 where a state does not vary.
fn half_widths(growth: &GrowthRecord, upward: &UpwardRecord) -> Option<String> {
    let half = |width: &f32| lower(growth.radius * f64::from(*width));
    let halves: Vec<String> = upward.widths.iter().map(half).collect();
    (growth.outcome == GrowthOutcome::Verified).then(|| halves.join(", "))
}

/// What the rounds of the figure are.
pub(super) fn caption(record: &Record) -> String {
    let growth = &record.growth;
    let set = words::grown(record);
    let Some(upward) = &growth.upward else {
        let outcome = match growth.outcome {
            GrowthOutcome::Verified => "The last round had no failure: its ball is verified.",
            GrowthOutcome::Exhausted => "No round was clean: no ball is certified.",
            GrowthOutcome::NoBoundary => "There was no boundary to grow from.",
        };
        return format!(
            "Each round draws fresh starts from a ball and shrinks it to the nearest failure; the \
             labels count failures among starts. {outcome}"
        );
    };
    let outcome = match growth.outcome {
        GrowthOutcome::Verified if growth.rounds.len() == upward.radii.len() => format!(
            "All radii were accepted: verified is the {set} of the last, {}, and larger ones were not tried.",
            lower(growth.radius)
        ),
        GrowthOutcome::Verified => {
            format!(
                "The largest {set} before a refusal is verified: radius {}.",
                lower(growth.radius)
            )
        }
        GrowthOutcome::Exhausted => format!("The first radius was refused: no {set} is certified."),
        GrowthOutcome::NoBoundary => "There was no boundary to grow from.".to_owned(),
    };
    format!(
        "Each round draws fresh starts from the {set} of the next larger radius, fixed beforehand, and is \
         accepted with at most {} failures; the labels count failures among starts. {outcome}",
        upward.allowed
    )
}
