//! The claims of margin drops and of the calibration on pairs and starts that they have not seen.

use super::Context;
use super::calibration::failing_score;
use super::drops::each_pair;
use super::drops_record::{CalibrationRecord, DropsRecord, ShareRecord};
use super::finding::Finding;
use super::purpose;
use super::record::Record;
use super::refuted::{refuted, share};
use super::settings::Settings;
use super::shares::{Fresh, Scored};
use crate::error::Result;
use crate::rollout::drops::Shapes;

/// Fresh pairs that the claims are tried with, those of the deviation bound.
const PAIRS: u64 = 4_000;

/// What fresh pairs and starts of the seed of `settings` say of these claims of `record`; nothing of a claim
/// that it does not make.
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn findings(
    context: Context<'_>,
    record: &Record,
    settings: &Settings,
) -> Result<Vec<Finding>> {
    let (drops, calibration) = (record.drops.as_ref(), record.calibration.as_ref());
    // Of a bound that is none, no pair is beyond.
    let bound = drops.filter(|drops| drops.level.is_finite());
    let mut findings = Vec::new();
    if bound.is_some() || calibration.is_some() {
        findings = on_pairs(context, settings, bound, calibration)?;
    }
    let sets = [
        ("share of margin drops on fresh starts", drops.map(of_drops)),
        (
            "share of the calibration on fresh starts",
            calibration.map(|one| of_calibration(one, settings)),
        ),
    ];
    for (name, set) in sets {
        let set = set.map(|set| on_starts(context, settings, record.global.band, name, &set));
        findings.extend(set.transpose()?);
    }
    Ok(findings)
}

/// How a fresh pair fares.
struct Fared {
    /// Its largest drop is above lambda.
    beyond: bool,
    /// Its nominal measure is above alpha, and its perturbed rollout fails.
    fails_above: bool,
}

/// The claims on pairs.
fn on_pairs(
    context: Context<'_>,
    settings: &Settings,
    drops: Option<&DropsRecord>,
    calibration: Option<&CalibrationRecord>,
) -> Result<Vec<Finding>> {
    let purposes = [purpose::FRESH_NOMINAL, purpose::FRESH_PERTURBATION];
    let bound = drops.map(|drops| (drops.shapes(), drops.level));
    let units = Shapes::of_discount(&settings.spec);
    let stage = "fresh pairs of margin drops";
    let fared = each_pair(context, settings, stage, purposes, PAIRS, |_, pair| Fared {
        beyond: bound.as_ref().is_some_and(|(shapes, level)| shapes.largest(pair) > *level),
        fails_above: calibration
            .is_some_and(|one| failing_score(&units, pair, &settings.spec) > one.level),
    })?;
    let count = |of: fn(&Fared) -> bool| fared.iter().filter(|pair| of(pair)).count() as u64;
    let drops = drops.map(|drops| {
        let risk = drops.claim.certified_risk;
        refuted("fresh pairs beyond lambda", risk, count(|pair| pair.beyond), PAIRS)
    });
    let calibration = calibration.map(|one| {
        let risk = one.claim.certified_risk;
        refuted("fresh pairs that fail above alpha", risk, count(|pair| pair.fails_above), PAIRS)
    });
    Ok(drops.into_iter().chain(calibration).collect())
}

/// A set by the score, and its share as stored.
struct ScoredSet {
    shapes: Shapes,
    level: f64,
    share: ShareRecord,
}

fn of_drops(drops: &DropsRecord) -> ScoredSet {
    ScoredSet { shapes: drops.shapes(), level: drops.level, share: drops.share }
}

fn of_calibration(calibration: &CalibrationRecord, settings: &Settings) -> ScoredSet {
    let CalibrationRecord { level, share, .. } = *calibration;
    ScoredSet { shapes: Shapes::of_discount(&settings.spec), level, share }
}

/// The share of a set.
fn on_starts(
    context: Context<'_>,
    settings: &Settings,
    band: f64,
    name: &str,
    set: &ScoredSet,
) -> Result<Finding> {
    let draws = settings.global.draws;
    let scored = [Scored { shapes: &set.shapes, levels: vec![set.level] }];
    let fresh = Fresh { purpose: purpose::CHECK, draws, band };
    let inside = super::shares::inside(context, settings, &scored, fresh)?;
    Ok(share(name, set.share.interval, inside.counts[0][0], draws))
}
