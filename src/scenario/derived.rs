//! What of a record follows from its settings and its own counts, without a rollout.

use super::budget::{ledger, spendings};
use super::claims::{holds, statements};
use super::enclosure;
use super::origin::{Hashes, hashes, system_record};
use super::record::{Record, SliceRecord, StateRecord, decimal, finite_margin};
use super::settings::Settings;
use super::tier::tier;
use super::{constants, deterministic_set, deviation, global, growth, sequential, sets, whole_box};
use crate::error::Result;
use crate::model::{Model, Plant};

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
    record.provenance.generator = settings.keys.generator().to_owned();
    record.provenance.policy = plant.controller.name.clone();
    let Hashes { physics_sha256, policy_sha256 } = hashes(plant);
    record.provenance.physics_sha256 = physics_sha256;
    record.provenance.policy_sha256 = policy_sha256;
    record.system = system_record(model, &settings.low, &settings.high);
    record.constants = constants::derived(model, settings, &stored.constants)?;
    record.deviation = deviation::derived(model, settings, &stored.deviation)?;
    match &settings.drops {
        Some(asked) => sets::rederived(model, settings, asked, &mut record)?,
        None => record.global = global::derived(model, settings, &stored.global)?,
    }
    record.whole_box =
        whole_box::derived(model, settings, &record.global, stored.whole_box.as_ref())?;
    record.enclosed = enclosure::record(model, settings);
    record.deterministic =
        deterministic_set::derived(model, settings, stored.deterministic.as_ref());
    record.growth = growth::derived(model, settings, &stored.growth)?;
    record.sequential = sequential::derived(model, settings, stored.sequential.as_ref())?;
    record.attempt = settings.attempt_record();
    let ledger = ledger(settings)?;
    (record.ledger, record.beta_total) = (spendings(&ledger), ledger.total());
    margins(&mut record, model, settings);
    record.statements = statements(plant, settings, &record);
    record.holds = holds(&record);
    Ok(record)
}

/// The states of the record, their margins of target and constraint, and the tier.
fn margins(record: &mut Record, model: &Model, settings: &Settings) {
    let x = &*settings.state;
    let state = &mut record.state;
    state.x = x.to_vec();
    state.target_margin = decimal(finite_margin(model.target_at(x, 0)));
    state.constraint_margin = decimal(finite_margin(model.constraint_at(x, 0)));
    let StateRecord { target_margin, check_margin, .. } = *state;
    state.tier = tier(&model.task, target_margin, check_margin, &record.growth, x).number();
    let cells = global::slice_through(settings, x);
    let check_margin = std::mem::take(&mut record.slice.check_margin);
    record.slice =
        SliceRecord { check_margin, ..global::slice_record(model, settings, cells.view()) };
}
