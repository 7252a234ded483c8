//! What of a record follows from its settings and its own counts, without a rollout.

use super::certify::{constants, hashes, ledger, spendings, system_record};
use super::record::{
    DeviationRecord, GlobalRecord, GrowthOutcome, GrowthRecord, PictureRecord, Record, SliceRecord,
    decimal, finite_margin,
};
use super::settings::Settings;
use super::{deviation, global, growth, sampling, verify};
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::rollout::{GENERATOR, StateList};

/// `stored` with everything that follows from `settings` and its own counts computed again: claims,
/// intervals, constants, the ledger, margins of the states, words. What rollouts came to is taken
/// from `stored` as it is.
///
/// # Errors
/// Settings whose claims could not be made.
pub(super) fn derived(plant: &Plant, settings: &Settings, stored: &Record) -> Result<Record> {
    let model = &*plant.model;
    let mut record = stored.clone();
    record.horizon = settings.spec.horizon;
    record.gamma = decimal(settings.spec.gamma);
    record.provenance.seed = settings.seed;
    record.provenance.generator = GENERATOR.to_owned();
    record.provenance.policy = plant.controller.name.clone();
    (record.provenance.physics_sha256, record.provenance.policy_sha256) = hashes(plant);
    record.system = system_record(model, settings);
    record.constants = constants(model, settings)?;
    record.deviation = deviation::derived(model, settings, &stored.deviation)?;
    record.global = global::derived(model, settings, &stored.global)?;
    record.growth = growth::derived(model, settings, &stored.growth)?;
    let ledger = ledger(settings)?;
    (record.ledger, record.beta_total) = (spendings(&ledger), ledger.total());
    margins(&mut record, model, settings);
    record.statements = statements(settings, &record.deviation, &record.global, &record.growth);
    record.statements.extend(of_samples(plant, settings, &record.picture));
    record.holds = holds(&record.deviation, &record.global, &record.growth);
    Ok(record)
}

/// The states of the record, their margins of target and constraint, and the tier.
fn margins(record: &mut Record, model: &Model, settings: &Settings) {
    let x = &*settings.state;
    let state = &mut record.state;
    state.x = x.to_vec();
    state.target_margin = decimal(finite_margin(model.target_at(x, 0)));
    state.constraint_margin = decimal(finite_margin(model.constraint_at(x, 0)));
    state.tier = verify::tier(state.target_margin, state.check_margin, &record.growth, x).number();
    let cells = global::slice_through(settings, x);
    let check_margin = std::mem::take(&mut record.slice.check_margin);
    record.slice =
        SliceRecord { check_margin, ..global::slice_record(model, settings, cells.view()) };
}

/// Whether every claim that is asked for was obtained.
pub(super) fn holds(
    deviation: &DeviationRecord,
    global: &GlobalRecord,
    growth: &GrowthRecord,
) -> bool {
    deviation.non_finite == 0
        && global.accepted > 0
        && global.claim.certified_risk <= deviation.claim.epsilon
        && growth.outcome == GrowthOutcome::Verified
}

/// The claims in words.
pub(super) fn statements(
    settings: &Settings,
    deviation: &DeviationRecord,
    global: &GlobalRecord,
    growth: &GrowthRecord,
) -> Vec<String> {
    let claims = [Some(&deviation.claim), Some(&global.claim), growth.claim.as_ref()];
    let mut statements: Vec<String> =
        claims.iter().flatten().map(|claim| claim.statement.clone()).collect();
    statements.insert(2, share_statement(global, settings));
    statements.extend(growth_statement(growth));
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
