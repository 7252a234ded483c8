//! Calibration of the measure: the level above which few failing pairs lie.

use super::Context;
use super::drops::{each_pair, level, sample_claim};
use super::drops_record::{CalibrationRecord, ShareRecord};
use super::drops_settings::SampleSettings;
use super::purpose;
use super::record::Claim;
use super::settings::Settings;
use crate::error::Result;
use crate::model::Model;
use crate::rollout::drops::Shapes;
use crate::rollout::replay::{PairMargins, measure_of};
use crate::rollout::{RolloutSpec, Tightening};
use crate::rounding::confidence;

/// Draws the pairs and finds the level alpha: the largest measure of the nominal rollout of a failing pair
/// that is not discarded, and never below 0 (Lin and Bansal 2023).
///
/// # Errors
/// [`crate::Error::Invalid`] for an empty box, and [`crate::Error::Interrupted`] if the watch says so.
pub(super) fn calibrate(
    context: Context<'_>,
    settings: &Settings,
    asked: &SampleSettings,
) -> Result<CalibrationRecord> {
    let shapes = Shapes::of_discount(&settings.spec);
    let purposes = [purpose::CALIBRATION_NOMINAL, purpose::CALIBRATION_PERTURBATION];
    let count = asked.scenarios;
    let scores = each_pair(context, settings, "calibration", purposes, count, |_, pair| {
        failing_score(&shapes, pair, &settings.spec)
    })?;
    Ok(CalibrationRecord {
        claim: claim(context.model(), settings, asked)?,
        level: level(scores.iter().copied(), asked.discards),
        failing: scores.iter().filter(|score| **score > f64::NEG_INFINITY).count() as u64,
        share: ShareRecord::default(),
    })
}

/// What `stored` says as its own numbers and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    asked: &SampleSettings,
    stored: &CalibrationRecord,
    share_draws: u64,
) -> Result<CalibrationRecord> {
    Ok(CalibrationRecord {
        claim: claim(model, settings, asked)?,
        share: ShareRecord::new(stored.share.inside, share_draws, asked.beta),
        ..stored.clone()
    })
}

/// The measure of the nominal rollout where the perturbed one fails; minus infinity where it does not.
pub(super) fn failing_score(shapes: &Shapes, pair: &PairMargins, spec: &RolloutSpec) -> f64 {
    let reached = measure_of(&pair.perturbed, spec, &Tightening::none(spec)) > 0.0;
    if reached { f64::NEG_INFINITY } else { shapes.score(&pair.nominal) }
}

/// The claim in words and numbers.
fn claim(model: &Model, settings: &Settings, asked: &SampleSettings) -> Result<Claim> {
    let SampleSettings { epsilon, beta, scenarios, discards } = *asked;
    let discarded = match discards {
        0 => String::new(),
        _ => format!(" ({discards} of {scenarios} pairs discarded)"),
    };
    let measure = if model.task.is_plain() { "reach-avoid measure" } else { "measure" };
    let statement = format!(
        "With confidence {}, the chance that a nominal start of the box has a {measure} above \
         alpha and its perturbed rollout fails is at most {epsilon}{discarded}.",
        confidence(beta)
    );
    sample_claim(model, settings, asked, "calibration", statement)
}
