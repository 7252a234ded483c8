//! What a record claims as a whole: whether all of it was obtained, and its sentences.

use super::box_record::BoxRecord;
use super::record::{
    DeterministicRecord, GlobalRecord, GrowthOutcome, GrowthRecord, PictureRecord, Record,
    SequentialRecord,
};
use super::sequential_record::SequentialOutcome;
use super::settings::Settings;
use super::{empty, probe, sampling, sets, side};
use crate::model::Plant;
use crate::rollout::StateList;
use crate::rounding::{confidence, lower, upper};

/// Whether every claim that is asked for was obtained.
pub(super) fn holds(record: &Record) -> bool {
    let Record { deviation, global, growth, .. } = record;
    record.constants_stand()
        && deviation.non_finite == 0
        && global.accepted > 0
        && global.claim.is_obtained()
        && growth.outcome == GrowthOutcome::Verified
        && box_holds(record.whole_box.as_ref())
        && deterministic_holds(record.deterministic.as_ref())
        && sequential_holds(record.sequential.as_ref())
}

/// Whether the sequential claim, where one was asked for, was obtained.
fn sequential_holds(record: Option<&SequentialRecord>) -> bool {
    record.is_none_or(|record| record.outcome == SequentialOutcome::Certified)
}

/// Whether the risk of the whole box is at most the one asked for, where one was.
fn box_holds(found: Option<&BoxRecord>) -> bool {
    found.is_none_or(|found| found.claim.is_obtained())
}

/// What is said of the whole box: its claim, and whether that is more than was asked for.
fn of_the_box(found: Option<&BoxRecord>) -> Option<String> {
    found.map(|found| match box_holds(Some(found)) {
        true => found.claim.statement.clone(),
        false => format!(
            "{} That is above the risk of {} that was asked for.",
            found.claim.statement,
            upper(found.claim.stated_risk())
        ),
    })
}

/// The claims in words, and what is to be said beside them.
pub(super) fn statements(plant: &Plant, settings: &Settings, record: &Record) -> Vec<String> {
    let Record { constants, deviation, global, growth, picture, .. } = record;
    let model = &*plant.model;
    let claims = [Some(&deviation.claim), Some(&global.claim), growth.claim.as_ref()];
    let mut statements: Vec<String> =
        claims.iter().flatten().map(|claim| claim.statement.clone()).collect();
    statements.insert(2, share_statement(global, settings));
    statements.extend(of_the_box(record.whole_box.as_ref()));
    statements.extend(sets::statements(record, settings.global.draws));
    statements.extend(record.deterministic.as_ref().map(|found| found.statement.clone()));
    statements.extend(record.enclosed.as_ref().map(|found| found.statement.clone()));
    if global.accepted == 0 {
        statements.extend(match &record.enclosed {
            Some(enclosed) => enclosed.reasons(),
            None => empty::reasons(model, record, &settings.spec),
        });
    }
    statements.extend(growth_statement(growth));
    statements.extend(record.sequential.as_ref().map(|asked| asked.claim.statement.clone()));
    statements.extend(side::statement(model, settings, growth));
    // Margin drops and enclosures rest on no constant.
    if record.drops.is_none() && record.enclosed.is_none() {
        statements.extend(constants.statements());
    }
    statements.extend(probe::statement(global));
    statements.extend(of_samples(plant, settings, picture));
    statements
}

/// Whether the deterministic certificate, where one was asked for, certifies any start.
fn deterministic_holds(record: Option<&DeterministicRecord>) -> bool {
    record.is_none_or(|record| record.certified > 0)
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
    let (inside, draws) =
        global.share.map_or((global.accepted, global.draws), |share| (share.inside, share.draws));
    format!(
        "With confidence {}, the certified set holds between {} % and {} % of the box \
         ({} of {} starts).",
        confidence(settings.global.beta),
        lower(low),
        upper(high),
        inside,
        draws
    )
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
