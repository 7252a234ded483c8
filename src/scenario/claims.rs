//! What a record claims as a whole: whether all of it was obtained, and its sentences.

use super::record::SequentialRecord;
use super::record::{DeviationRecord, GlobalRecord, GrowthOutcome, GrowthRecord, PictureRecord};
use super::sampling;
use super::sequential_record::SequentialOutcome;
use super::settings::Settings;
use crate::model::Plant;
use crate::rollout::{HUGE, StateList};

/// Whether every claim that is asked for was obtained.
pub(super) fn holds(
    deviation: &DeviationRecord,
    global: &GlobalRecord,
    growth: &GrowthRecord,
    sequential: Option<&SequentialRecord>,
) -> bool {
    deviation.non_finite == 0
        && global.accepted > 0
        && deviation.claim.epsilon.is_some_and(|asked| global.claim.certified_risk <= asked)
        && growth.outcome == GrowthOutcome::Verified
        && sequential.is_none_or(|claim| claim.outcome == SequentialOutcome::Certified)
}

/// The claims in words.
pub(super) fn statements(
    settings: &Settings,
    deviation: &DeviationRecord,
    global: &GlobalRecord,
    growth: &GrowthRecord,
    sequential: Option<&SequentialRecord>,
) -> Vec<String> {
    let claims = [Some(&deviation.claim), Some(&global.claim), growth.claim.as_ref()];
    let mut statements: Vec<String> =
        claims.iter().flatten().map(|claim| claim.statement.clone()).collect();
    statements.insert(2, share_statement(global, settings));
    statements.extend(growth_statement(growth));
    statements.extend(sequential.map(|asked| asked.claim.statement.clone()));
    statements.extend(broken_statement(deviation));
    statements
}

/// What is to be said of the pictured rollouts: that they are looked at at samples, and where f32 is
/// too coarse for them.
pub(super) fn of_samples(
    plant: &Plant,
    settings: &Settings,
    picture: &PictureRecord,
) -> Vec<String> {
    let size = settings.state.len();
    let first = |x: &&Vec<f32>| x.len() == size;
    let firsts = picture.rollouts.iter().filter_map(|rollout| rollout.states.first());
    let starts = StateList::new(size).with(firsts.filter(first));
    sampling::sampling(plant, starts.view(), settings.spec.horizon)
}

/// The certified share of the box in words.
fn share_statement(global: &GlobalRecord, settings: &Settings) -> String {
    let [low, high] = global.share_interval;
    format!(
        "With confidence 1 - {}, the certified set holds between {:.3} % and {:.3} % of the box \
         ({} of {} starts).",
        settings.global.beta,
        100.0 * low,
        100.0 * high,
        global.accepted,
        global.draws
    )
}

/// That rollouts of the deviation bound met states that are not finite.
fn broken_statement(deviation: &DeviationRecord) -> Option<String> {
    let (broken, pairs) = (deviation.non_finite, deviation.claim.scenarios);
    (broken > 0).then(|| {
        format!(
            "The deviation bound is none: {broken} of {pairs} pairs met a state that is not finite, \
             which counts as a distance of {HUGE:e}; no claim follows from it."
        )
    })
}

/// What came of the growth, where it is not a claim.
fn growth_statement(growth: &GrowthRecord) -> Option<String> {
    match growth.outcome {
        GrowthOutcome::Verified => None,
        GrowthOutcome::Exhausted if growth.upward.is_some() => Some(
            "Local growth is exhausted: the first of its radii was refused, nothing is verified."
                .to_owned(),
        ),
        GrowthOutcome::Exhausted => Some(format!(
            "Local growth is exhausted: each of {} rounds had a failure, no ball is verified.",
            growth.rounds.len()
        )),
        GrowthOutcome::NoBoundary => Some(
            "No boundary of the certified set was found: there is nothing to grow from.".into(),
        ),
    }
}
