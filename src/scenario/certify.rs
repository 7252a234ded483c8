//! The certificate as a whole: constants, deviation, certified set, slice, boundary, growth.

use std::collections::BTreeMap;
use std::time::Instant;

use super::budget::{ledger, spendings};
use super::criterion::Criterion;
use super::enclosure::{self, Enclosure};
use super::fit::check_sizes;
use super::growth_plan::Around;
use super::origin::{provenance, system_record};
use super::purpose;
use super::record::{
    GrowthRecord, Provenance, Record, SCHEMA, StateRecord, Timing, decimal, finite_margin,
};
use super::sets;
use super::settings::Settings;
use super::tier::tier;
use super::tightened::{Tightened, tightened};
use super::{
    Context, Watch, boundary, claims, deterministic_set, deviation, global, growth, picture,
    sequential, whole_box,
};
use crate::backend::Program;
use crate::error::Result;
use crate::rollout::{Query, Region, States};

/// Certifies the plant: every number of the [`Record`] but the threads of its timing.
///
/// `config` is stored as it is; it is what a later check starts from.
///
/// # Errors
/// [`crate::Error::TooFewScenarios`] and [`crate::Error::Invalid`] before any work; those of the backend;
/// [`crate::Error::Interrupted`] if `watch` says so.
pub fn certify(
    program: &Program<'_>,
    settings: &Settings,
    config: serde_json::Value,
    watch: &dyn Watch,
) -> Result<Record> {
    let begun = Instant::now();
    let context = Context { program, watch };
    let (plant, backend) = (program.plant(), program.backend());
    let settings = &settings.keyed(plant);
    check_sizes(settings, &plant.model)?;
    check_settings(settings)?;
    Enclosure::of(plant, settings)?;
    deterministic_set::check(plant, settings)?;
    let ledger = ledger(settings)?;
    let mut tightened = tightened(context, settings)?;
    let mut drops = tightened.drops.take();
    let around_bound = drops.is_some() && settings.growth.plan.around == Around::Bound;
    let alone = around_bound.then(|| Criterion::Margins(tightened.tightening.clone()));
    let mut share_rollouts = 0;
    let (global, sequence, calibration) = match (&settings.drops, &mut drops) {
        (Some(asked), Some(drops)) => {
            let found = sets::sets(context, settings, asked, &mut tightened, drops)?;
            share_rollouts = found.share_rollouts;
            (found.global, Some(found.sequence), found.calibration)
        }
        _ => {
            let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
            let criterion = Criterion::new(plant, settings, &tightened.tightening)?;
            (global::conditional(context, settings, &criterion, purposes)?, None, None)
        }
    };
    let Tightened { constants, deviation, tightening, .. } = tightened;
    let criterion = Criterion::new(plant, settings, &tightening)?;
    let whole_box = whole_box::record(context, settings, &criterion, &global)?;
    let slice = global::slice(context, settings, &criterion, global.band)?;
    let center = boundary::center(context, settings, alone.as_ref(), &criterion, global.band)?;
    let growth = growth::record(context, settings, center, global.band)?;
    let sequential = sequential::record(context, settings, &criterion, global.band)?;
    let state = state(context, settings, &criterion, &growth, global.band)?;
    let picture = picture::picture(plant, settings, &growth);
    let deterministic = deterministic_set::record(context, settings)?;
    let rollouts = 2 * (settings.deviation.scenarios + deviation.pilot + global.draws)
        + whole_box.as_ref().map_or(0, |found| found.draws)
        + slice.check_margin.len() as u64
        + settings.deterministic.map_or(0, |asked| asked.starts)
        + growth.rounds.iter().map(|round| round.scenarios).sum::<u64>()
        + sequential.as_ref().map_or(0, |asked| asked.draws);
    let mut record = Record {
        schema: SCHEMA,
        digests: BTreeMap::new(),
        holds: false,
        statements: Vec::new(),
        provenance: Provenance {
            generator: settings.keys.generator().to_owned(),
            ..provenance(program, settings.seed, config)
        },
        system: system_record(&plant.model, &settings.low, &settings.high),
        horizon: settings.spec.horizon,
        gamma: decimal(settings.spec.gamma),
        constants,
        deviation,
        global,
        whole_box,
        drops,
        sequence,
        calibration,
        enclosed: enclosure::record(context.model(), settings),
        deterministic,
        state,
        slice,
        growth,
        sequential,
        attempt: settings.attempt_record(),
        beta_total: ledger.total(),
        ledger: spendings(&ledger),
        picture,
        events: backend.events(),
        timing: Timing { wall_seconds: 0.0, threads: 0, rollouts },
    };
    record.statements = claims::statements(plant, settings, &record);
    record.holds = claims::holds(&record);
    record.timing.rollouts += sets::rollouts(&record) + share_rollouts;
    record.timing.wall_seconds = begun.elapsed().as_secs_f64();
    Ok(record)
}

/// Refuses settings whose claims could not be made, as far as that shows without work: numbers out of
/// range, scenarios that are too few, claims that spend more than 1 together, an empty box.
///
/// # Errors
/// [`crate::Error::TooFewScenarios`] and [`crate::Error::Invalid`].
pub fn check_settings(settings: &Settings) -> Result<()> {
    settings.check()?;
    growth::check_scenarios(&settings.growth)?;
    deviation::check_scenarios(&settings.deviation, settings.spec.horizon)?;
    ledger(settings)?;
    Region::new_box(&*settings.low, &*settings.high).map(|_| ())
}

/// Tier and margins of the state.
fn state(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
    growth: &GrowthRecord,
    band: f64,
) -> Result<StateRecord> {
    let (x, query) = (&*settings.state, Query::Measure);
    let states = States::one(x);
    let margins = criterion.margins(context, &settings.spec, states, query, band)?;
    let check_margin = decimal(margins[0]);
    let target_margin = decimal(finite_margin(context.model().target_at(x, 0)));
    let tier = tier(&context.model().task, target_margin, check_margin, growth, x).number();
    let constraint_margin = decimal(finite_margin(context.model().constraint_at(x, 0)));
    Ok(StateRecord { x: x.to_vec(), tier, check_margin, target_margin, constraint_margin })
}
