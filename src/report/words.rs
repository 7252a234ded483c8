//! Words for what a record stores as numbers and modes.

use super::places::titled;
use super::text::{interval, lower, upper};
use crate::rollout::PairControl;
use crate::scenario::BoxRecord;
use crate::scenario::record::{Claim, GrowthOutcome, Record};
use crate::scenario::settings::{BoundarySearch, DeviationSource, Joint};

/// Name and unit of a state, as `ego_x (m)`.
pub(crate) fn axis(record: &Record, state: usize) -> String {
    titled(&record.system.states, state)
}

/// Name of a state.
pub(crate) fn name(record: &Record, state: usize) -> String {
    let axis = record.system.states.get(state);
    axis.map_or_else(|| format!("state {state}"), |axis| axis.name.clone())
}

/// Unit of the Euclidean norm over the states that `counts` picks.
pub(crate) fn norm_unit(record: &Record, counts: impl Fn(usize) -> bool) -> String {
    let mut units: Vec<&str> = Vec::new();
    for (state, axis) in record.system.states.iter().enumerate() {
        if counts(state) && !units.contains(&axis.unit.as_str()) {
            units.push(&axis.unit);
        }
    }
    units.join(", ")
}

/// Unit of the radii of local growth.
pub(crate) fn radius_unit(record: &Record) -> String {
    let varies = &record.growth.varies;
    norm_unit(record, |state| varies.get(state).copied().unwrap_or(true))
}

/// A claim beside the answer to the question whether it was obtained.
pub(crate) struct Verdict<'a> {
    /// Short title.
    pub(crate) title: &'static str,
    /// Whether the claim was obtained.
    pub(crate) obtained: bool,
    /// The outcome in a few words.
    pub(crate) headline: String,
    /// What it means, in one sentence.
    pub(crate) detail: String,
    /// The claim, where one was made.
    pub(crate) claim: Option<&'a Claim>,
}

/// The claims in the order of the method.
pub(crate) fn verdicts(record: &Record) -> Vec<Verdict<'_>> {
    let whole_box = record.whole_box.as_ref().map(whole_box);
    [deviation(record), global(record)]
        .into_iter()
        .chain(whole_box)
        .chain([growth(record)])
        .collect()
}

fn whole_box(found: &BoxRecord) -> Verdict<'_> {
    let asked = match found.claim.epsilon {
        Some(asked) => format!("a risk of {} was asked for", lower(asked)),
        None => "no risk was asked for".to_owned(),
    };
    Verdict {
        title: "Whole box",
        obtained: found.claim.is_obtained(),
        headline: format!("risk {}", interval(found.risk_interval)),
        detail: format!("Chance that a start of the box fails, certified or not; {asked}."),
        claim: Some(&found.claim),
    }
}

fn deviation(record: &Record) -> Verdict<'_> {
    let claim = &record.deviation.claim;
    let void = record.deviation.non_finite > 0;
    Verdict {
        title: "Deviation bound",
        obtained: claim.is_obtained() && !void,
        headline: match void {
            true => "none".to_owned(),
            false => format!("risk ≤ {}", upper(claim.certified_risk)),
        },
        detail: format!(
            "Chance that a start within {} drifts further than the bound; {} was asked for.",
            lower(record.deviation.radius),
            upper(claim.stated_risk())
        ),
        claim: Some(claim),
    }
}

fn global(record: &Record) -> Verdict<'_> {
    let global = &record.global;
    let found = global.accepted > 0;
    Verdict {
        title: "Certified set",
        obtained: found && global.claim.is_obtained() && record.constants_stand(),
        headline: if found {
            format!("risk ≤ {}", upper(global.claim.certified_risk))
        } else {
            "empty".to_owned()
        },
        detail: format!(
            "{}Chance of failure inside the set, which fills {} of the sampled box.",
            record.enclosed.as_ref().map_or_else(String::new, |found| {
                format!("Deterministic: {}. What draws from the box show: ", found.short())
            }),
            interval(global.share_interval)
        ),
        claim: Some(&global.claim),
    }
}

fn growth(record: &Record) -> Verdict<'_> {
    let growth = &record.growth;
    let (headline, detail) = match growth.outcome {
        GrowthOutcome::Verified => (
            format!("radius {}", lower(growth.radius)),
            growth.claim.as_ref().map_or_else(String::new, |claim| {
                let (risk, set) = (upper(claim.certified_risk), grown(record));
                format!("Chance of failure for a start in the verified {set}: at most {risk}.")
            }),
        ),
        GrowthOutcome::Exhausted => (
            "not verified".to_owned(),
            match &growth.upward {
                None => "Every round had failures, so no ball is certified.".to_owned(),
                Some(_) => {
                    format!("The first radius was refused, so no {} is certified.", grown(record))
                }
            },
        ),
        GrowthOutcome::NoBoundary => (
            "no boundary".to_owned(),
            "No boundary of the certified set was found, so there was nothing to grow from."
                .to_owned(),
        ),
    };
    Verdict {
        title: "Local growth",
        obtained: growth.outcome == GrowthOutcome::Verified,
        headline,
        detail,
        claim: growth.claim.as_ref(),
    }
}

/// What V_check takes off the margins.
pub(crate) fn tightened(record: &Record) -> &'static str {
    match (&record.enclosed, &record.drops) {
        (Some(_), _) => "enclosed with the ball of starts around it",
        (None, Some(_)) => "with margins that lose what drops in pairs of rollouts",
        (None, None) => "with margins tightened by the deviation bound",
    }
}

/// What local growth grew.
pub(crate) fn grown(record: &Record) -> &'static str {
    record.growth.shape().name()
}

/// How the steps of the deviation bound hold together.
pub(crate) fn joint(joint: Joint) -> &'static str {
    match joint {
        Joint::FixedShape => "fixed shape from a pilot sample, one scalar (all steps at once)",
        Joint::Variables => "one decision variable per step (all steps at once)",
        Joint::Bonferroni => "each step on its own, risk and beta divided (all steps at once)",
        Joint::Separate => "each step on its own at full risk (no joint statement)",
    }
}

/// How perturbed rollouts were driven.
pub(crate) fn control(control: PairControl) -> &'static str {
    match control {
        PairControl::Replay => "replay of the nominal rollout's controls",
        PairControl::ClosedLoop => "closed loop: the policy in feedback",
    }
}

/// Which bound tightened the margins.
pub(crate) fn source(source: DeviationSource) -> &'static str {
    match source {
        DeviationSource::Scenario => "scenario bound",
        DeviationSource::Exact => "exact supremum of the linear system",
    }
}

/// Where the centre of growth was looked for.
pub(crate) fn boundary(boundary: BoundarySearch) -> &'static str {
    match boundary {
        BoundarySearch::Slice => "a boundary cell of the slice",
        BoundarySearch::Rays => "bisection along many directions in the coordinates that vary",
    }
}

/// Where the state stands in the hierarchy.
pub(crate) fn tier(record: &Record) -> String {
    let set = grown(record);
    match record.state.tier {
        0 => "0, in the target set".to_owned(),
        1 => "1, V_check is positive there".to_owned(),
        2 => format!("2, in the verified {set}"),
        _ => format!("3, none of target set, certified set and verified {set}"),
    }
}
