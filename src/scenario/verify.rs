//! What a stored certificate is used for: the tier of states, and whether it still holds.

use serde::Serialize;

use super::bound::lower_bound;
use super::certify::certify;
use super::derived::derived;
use super::finding::{CheckReport, Figure, Finding};
use super::fit::check_sizes;
use super::key_source::Keys;
use super::origin::{Hashes, hashes, provenance};
use super::purpose;
use super::record::{Provenance, Record, SCHEMA, finite_margin};
use super::settings::Settings;
use super::tier::{Tier, tier, verified_set};
use super::tightened::tightening;
use super::{Context, Unwatched, Watch, compare, global};
use crate::backend::Program;
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{Keep, Query, ReachAvoidTask, Region, Starts, States, Stream, Tightening};

/// Fresh starts that a verified ball is tried with.
const FRESH_STARTS: u64 = 20_000;
/// Chance that a check calls a true claim false, each.
const FALSE_ALARM: f64 = 1e-6;
/// Relative difference of a recomputed bound that another device's rounding may make.
const TOLERANCE: f64 = 1e-4;
/// Share of the recomputed counts that another device's rounding may move across zero.
const MOVED: f64 = 1e-3;

/// Tier and margins of one state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QueryRow {
    /// Its tier.
    pub tier: Tier,
    /// `V_check`.
    #[serde(with = "crate::files::number")]
    pub check_margin: f32,
    /// Target margin.
    #[serde(with = "crate::files::number")]
    pub target_margin: f32,
}

/// Whether the record is of the version that this program writes, and not of an older one.
fn is_current(record: &Record) -> bool {
    record.schema == SCHEMA
}

/// That the physics of an older record cannot be compared; nothing of a current one.
fn not_compared(record: &Record) -> Option<Finding> {
    (!is_current(record)).then(|| Finding {
        name: "hash of the physics".to_owned(),
        stored: Figure::Words(format!("of schema {}", record.schema)),
        found: Figure::Words("not compared: system, settings and numbers are".to_owned()),
        holds: true,
    })
}

/// Refuses a record that is not of this plant.
fn check_identity(plant: &Plant, record: &Record) -> Result<()> {
    let refuse = |field: &str, stored: &str, found: &str| {
        Err(Error::Refused(format!(
            "{field} is {stored} in the record, {found} here; certify again"
        )))
    };
    let Hashes { physics_sha256: physics, policy_sha256: policy } = hashes(plant);
    let stored = &record.provenance;
    if record.schema > SCHEMA {
        return refuse("schema", &record.schema.to_string(), &SCHEMA.to_string());
    }
    if record.system.name != plant.model.name {
        return refuse("system.name", &record.system.name, &plant.model.name);
    }
    if record.system.states.len() != plant.model.states.len() {
        let found = record.system.states.len().to_string();
        return refuse("system.states length", &found, &plant.model.states.len().to_string());
    }
    if is_current(record) && stored.physics_sha256 != physics {
        return refuse("provenance.physics_sha256", &stored.physics_sha256, &physics);
    }
    // The digest of a formula is that of the physics.
    let comparable = is_current(record) || plant.controller.network().is_some();
    if comparable && stored.policy_sha256 != policy {
        return refuse("provenance.policy_sha256", &stored.policy_sha256, &policy);
    }
    if record.deviation.bound.len() != record.horizon as usize + 1 {
        let found = record.deviation.bound.len().to_string();
        let expected = format!("{} by its horizon", record.horizon + 1);
        return refuse("deviation.bound length", &found, &expected);
    }
    Ok(())
}

/// Refuses a record of which some field does not follow from its settings and its own counts.
fn check_derived(program: &Program<'_>, record: &Record, settings: &Settings) -> Result<()> {
    let mut again = derived(program.plant(), settings, record)?;
    let here = provenance(program, settings.seed, record.provenance.config.clone());
    let generator = settings.keys.generator().to_owned();
    again.provenance = Provenance { generator, ..here };
    let finding = compare::fields(record, &again);
    if finding.holds {
        return Ok(());
    }
    Err(Error::Refused(format!("{}; certify again", finding.found)))
}

/// Tier and `V_check` of each of `states` against a stored certificate.
///
/// # Errors
/// [`Error::Refused`] if the record is of another plant, or if a field does not follow from its
/// settings and its own counts; [`Error::Invalid`] for settings or states of another model; those of
/// the backend.
pub fn query(
    program: &Program<'_>,
    record: &Record,
    settings: &Settings,
    states: States<'_>,
) -> Result<Vec<QueryRow>> {
    let plant = program.plant();
    let settings = &with_keys_of(record, settings);
    check_identity(plant, record)?;
    check_sizes(settings, &plant.model)?;
    check_derived(program, record, settings)?;
    let spec = settings.spec;
    let tightening = tightening(&record.deviation.bound, &record.constants, &spec);
    let context = Context { program, watch: &Unwatched };
    let margins = global::check_margins(
        context,
        &spec,
        &tightening,
        states,
        Query::Measure,
        record.global.band,
    )?;
    let row = |(x, check_margin): (&[f32], f32)| {
        let target_margin = finite_margin(plant.model.target_at(x, 0));
        let check = f64::from(check_margin);
        let tier = tier(f64::from(target_margin), check, &record.growth, x);
        QueryRow { tier, check_margin, target_margin }
    };
    Ok(states.iter().zip(margins).map(row).collect())
}

/// Verifies a stored certificate: computes it again from its seed, and tries its claims on fresh
/// scenarios.
///
/// A claim fails on fresh scenarios only if they refute it with confidence 1 - 1e-6.
///
/// # Errors
/// [`Error::Refused`] if the record is of another plant; those of the backend.
pub fn check(
    program: &Program<'_>,
    record: &Record,
    settings: &Settings,
    watch: &dyn Watch,
) -> Result<CheckReport> {
    check_identity(program.plant(), record)?;
    let settings = &with_keys_of(record, settings);
    let again = certify(program, settings, record.provenance.config.clone(), watch)?;
    let context = Context { program, watch };
    let mut findings = recomputed(record, &again);
    findings.push(compare::fields(record, &again));
    findings.extend(not_compared(record));
    let tightening = tightening(&record.deviation.bound, &record.constants, &settings.spec);
    let purposes = [purpose::CHECK, purpose::CHECK_PERTURBATION];
    let fresh = global::conditional(context, settings, &tightening, purposes)?;
    findings.push(refuted(
        "conditional failure on fresh pairs",
        record.global.claim.certified_risk,
        fresh.claim.failures,
        fresh.accepted,
    ));
    let share = global::share_overlaps(&record.global, &fresh);
    findings.push(share);
    if let Some(set) = verified_set(&record.growth, settings.state.len()) {
        let failures = fresh_failures(context, settings, set)?;
        let risk = record.growth.claim.as_ref().map_or(0.0, |claim| claim.certified_risk);
        findings.push(refuted("failures in the verified ball", risk, failures, FRESH_STARTS));
    }
    Ok(CheckReport::new(findings))
}

/// `settings` with the keys that `record` was made with.
fn with_keys_of(record: &Record, settings: &Settings) -> Settings {
    Settings { keys: Keys::of(&record.provenance.generator), ..settings.clone() }
}

/// Compares the stored record with the one computed again from its seed.
fn recomputed(stored: &Record, again: &Record) -> Vec<Finding> {
    let number = |name: &str, stored: f64, found: f64| Finding {
        name: name.to_owned(),
        stored: Figure::Number(stored),
        found: Figure::Number(found),
        // Two that are infinite have no difference.
        holds: stored == found || (stored - found).abs() <= TOLERANCE * stored.abs().max(1e-9),
    };
    let count = |name: &str, stored: u64, found: u64, of: u64| Finding {
        name: name.to_owned(),
        stored: Figure::Count(stored),
        found: Figure::Count(found),
        holds: stored.abs_diff(found) as f64 <= MOVED * of as f64,
    };
    let worst = stored.deviation.bound.iter().zip(&again.deviation.bound);
    let (was, is) = worst.fold((0.0, 0.0), |worst: (f64, f64), (was, is)| {
        let farther = (was - is).abs() > (worst.0 - worst.1).abs();
        if farther || worst.0 == 0.0 { (*was, *is) } else { worst }
    });
    let text = |name: &str, stored: Figure, found: Figure| {
        let holds = stored == found;
        Finding { name: name.to_owned(), stored, found, holds }
    };
    let outcome = |record: &Record| Figure::Words(record.growth.outcome.name().to_owned());
    vec![
        number(
            "constant of the target margin",
            stored.constants.target.used,
            again.constants.target.used,
        ),
        number(
            "constant of the constraint margin",
            stored.constants.constraint.used,
            again.constants.constraint.used,
        ),
        number("deviation bound, where it differs most", was, is),
        count(
            "certified starts",
            stored.global.accepted,
            again.global.accepted,
            again.global.draws,
        ),
        count(
            "failures among them",
            stored.global.claim.failures,
            again.global.claim.failures,
            again.global.draws,
        ),
        number(
            "conditional failure bound",
            stored.global.claim.certified_risk,
            again.global.claim.certified_risk,
        ),
        text("outcome of local growth", outcome(stored), outcome(again)),
        number("radius of the verified ball", stored.growth.radius, again.growth.radius),
        text("all claims obtained", Figure::Flag(stored.holds), Figure::Flag(again.holds)),
    ]
}

/// Whether `failures` of `trials` refute a risk of at most `risk`.
fn refuted(name: &str, risk: f64, failures: u64, trials: u64) -> Finding {
    let least = lower_bound(failures, trials, FALSE_ALARM);
    Finding {
        name: name.to_owned(),
        stored: Figure::AtMost { at_most: risk },
        found: Figure::Trials { failures, trials, at_least: least },
        holds: least <= risk,
    }
}

/// Failures among fresh starts in the verified ball.
fn fresh_failures(context: Context<'_>, settings: &Settings, region: Region) -> Result<u64> {
    context.watch.begin("fresh starts in the ball", FRESH_STARTS);
    let stream = Stream::new(settings.seed, purpose::CHECK, 1);
    let tightening = Tightening::none(&settings.spec);
    let task = ReachAvoidTask {
        starts: Starts::Drawn { region, stream },
        range: 0..FRESH_STARTS,
        spec: settings.spec,
        tightening: &tightening,
        query: Query::Sign,
    };
    let advance = &mut |count| context.watch.advance(count);
    Ok(context.program.tally_told(&task, Keep::Counts, advance)?.counts().failures())
}
