//! What a record claims as a whole: whether all of it was obtained, and its sentences.

use super::record::{
    ConstantsRecord, DeviationRecord, GlobalRecord, GrowthOutcome, GrowthRecord, PictureRecord,
};
use super::settings::Settings;
use super::tightened::tightening;
use super::{empty, probe, sampling, side};
use crate::model::Plant;
use crate::rollout::StateList;
use crate::rounding::{lower, upper};

/// Whether every claim that is asked for was obtained.
pub(super) fn holds(
    constants: &ConstantsRecord,
    deviation: &DeviationRecord,
    global: &GlobalRecord,
    growth: &GrowthRecord,
) -> bool {
    constants.stand()
        && deviation.non_finite == 0
        && global.accepted > 0
        && global.claim.is_obtained()
        && growth.outcome == GrowthOutcome::Verified
}

/// What the claims of a record are made of.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a> {
    /// Lipschitz constants.
    pub(super) constants: &'a ConstantsRecord,
    /// Deviation bound.
    pub(super) deviation: &'a DeviationRecord,
    /// Certified set.
    pub(super) global: &'a GlobalRecord,
    /// Local growth.
    pub(super) growth: &'a GrowthRecord,
    /// Pictured rollouts.
    pub(super) picture: &'a PictureRecord,
}

/// The claims in words, and what is to be said beside them.
pub(super) fn statements(plant: &Plant, settings: &Settings, parts: Parts<'_>) -> Vec<String> {
    let Parts { constants, deviation, global, growth, picture } = parts;
    let model = &*plant.model;
    let claims = [Some(&deviation.claim), Some(&global.claim), growth.claim.as_ref()];
    let mut statements: Vec<String> =
        claims.iter().flatten().map(|claim| claim.statement.clone()).collect();
    statements.insert(2, share_statement(global, settings));
    if global.accepted == 0 {
        let losses = tightening(&deviation.bound, constants, &settings.spec);
        statements.extend(empty::reasons(model, deviation, &losses, picture));
    }
    statements.extend(growth_statement(growth));
    statements.extend(side::statement(model, settings, growth));
    statements.extend(constants.statements());
    statements.extend(probe::statement(global));
    statements.extend(of_samples(plant, settings, picture));
    statements
}

/// What is to be said of the pictured rollouts: that they are looked at at samples, and where f32 is
/// too coarse for them.
fn of_samples(plant: &Plant, settings: &Settings, picture: &PictureRecord) -> Vec<String> {
    let size = settings.state.len();
    let first = |x: &&Vec<f32>| x.len() == size;
    let firsts = picture.rollouts.iter().filter_map(|rollout| rollout.states.first());
    let starts = StateList::new(size).with(firsts.filter(first));
    sampling::sampling(plant, starts.view(), settings.spec.horizon)
}

/// The certified share of the box in words.
fn share_statement(global: &GlobalRecord, settings: &Settings) -> String {
    let [low, high] = global.share_interval.map(|share| 100.0 * share);
    format!(
        "With confidence 1 - {}, the certified set holds between {} % and {} % of the box \
         ({} of {} starts).",
        settings.global.beta,
        lower(low),
        upper(high),
        global.accepted,
        global.draws
    )
}

/// What came of the growth, where it is not a claim.
fn growth_statement(growth: &GrowthRecord) -> Option<String> {
    match growth.outcome {
        GrowthOutcome::Verified => None,
        GrowthOutcome::Exhausted => Some(format!(
            "Local growth is exhausted: each of {} rounds had a failure, no ball is verified.",
            growth.rounds.len()
        )),
        GrowthOutcome::NoBoundary => Some(
            "No boundary of the certified set was found: there is nothing to grow from.".into(),
        ),
    }
}
