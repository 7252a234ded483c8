//! What a stored certificate is used for: the tier of states, and whether it still holds.

use serde::Serialize;

use super::answer::{Beside, beside};
use super::certify::certify;
use super::criterion::Criterion;
use super::derived::derived;
use super::finding::{CheckReport, Figure, Finding};
use super::fit::check_sizes;
use super::fresh;
use super::key_source::Keys;
use super::origin::{Hashes, hashes, provenance};
use super::record::{HASHED_ALIKE, Provenance, Record, SCHEMA, finite_margin};
use super::settings::Settings;
use super::tier::{Tier, tier};
use super::{Context, Unwatched, Watch, compare, sets, whole_box};
use crate::backend::Program;
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{Query, States};

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
    /// What the other parts of the certificate say of it.
    #[serde(flatten)]
    pub beside: Beside,
}

/// Whether the record's hashes are of the text that this program records.
fn is_hashed_alike(record: &Record) -> bool {
    record.schema >= HASHED_ALIKE
}

/// That the physics of an older record cannot be compared; nothing of a current one.
fn not_compared(record: &Record) -> Option<Finding> {
    (!is_hashed_alike(record)).then(|| Finding {
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
    if is_hashed_alike(record) && stored.physics_sha256 != physics {
        return refuse("provenance.physics_sha256", &stored.physics_sha256, &physics);
    }
    // The digest of a formula is that of the physics.
    let comparable = is_hashed_alike(record) || plant.controller.network().is_some();
    if comparable && stored.policy_sha256 != policy {
        return refuse("provenance.policy_sha256", &stored.policy_sha256, &policy);
    }
    if record.deviation.bound.len() != record.horizon as usize + 1 {
        let found = record.deviation.bound.len().to_string();
        let expected = format!("{} by its horizon", record.horizon + 1);
        return refuse("deviation.bound length", &found, &expected);
    }
    if let Some(drops) = &record.drops {
        let shapes = [
            ("drops.target_shape", &drops.target_shape),
            ("drops.constraint_shape", &drops.constraint_shape),
        ];
        for (field, shape) in shapes {
            if shape.len() != record.horizon as usize + 1 {
                let expected = format!("{} by its horizon", record.horizon + 1);
                return refuse(&format!("{field} length"), &shape.len().to_string(), &expected);
            }
        }
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

/// Tier and `V_check` of each of `states` against a stored certificate, and what its other parts say of it.
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
    let settings = &with_keys_of(record, settings)?;
    check_identity(plant, record)?;
    check_sizes(settings, &plant.model)?;
    let settings = &whole_box::as_recorded(settings, record);
    check_derived(program, record, settings)?;
    let spec = settings.spec;
    let criterion = Criterion::new(plant, settings, &sets::tightening(record, &spec))?;
    let context = Context { program, watch: &Unwatched };
    let band = record.global.band;
    let margins = criterion.margins(context, &spec, states, Query::Measure, band)?;
    let beside = beside(context, record, settings, states)?;
    let row = |(x, (check_margin, beside)): (&[f32], (f32, Beside))| {
        let target_margin = finite_margin(plant.model.target_at(x, 0));
        let check = f64::from(check_margin);
        let tier = tier(&plant.model.task, f64::from(target_margin), check, &record.growth, x);
        QueryRow { tier, check_margin, target_margin, beside }
    };
    Ok(states.iter().zip(margins.into_iter().zip(beside)).map(row).collect())
}

/// Verifies a stored certificate: computes it again from its seed, and tries its claims on scenarios of
/// `fresh_seed`, which is to be another one each time, or the same again to repeat a check.
///
/// A claim fails on fresh scenarios only if they refute it with confidence 1 - 1e-6.
///
/// # Errors
/// [`Error::Refused`] if the record is of another plant; those of the backend.
pub fn check(
    program: &Program<'_>,
    record: &Record,
    settings: &Settings,
    fresh_seed: u64,
    watch: &dyn Watch,
) -> Result<CheckReport> {
    check_identity(program.plant(), record)?;
    let settings = &whole_box::as_recorded(&with_keys_of(record, settings)?, record);
    let again = certify(program, settings, record.provenance.config.clone(), watch)?;
    let context = Context { program, watch };
    let mut findings = recomputed(record, &again);
    findings.push(compare::fields(record, &again));
    findings.extend(not_compared(record));
    findings.extend(fresh::findings(context, record, settings, fresh_seed)?);
    Ok(CheckReport::new(fresh_seed, findings))
}

/// `settings` with the keys that `record` was made with.
///
/// # Errors
/// [`Error::Refused`] for a generator that this program does not have.
fn with_keys_of(record: &Record, settings: &Settings) -> Result<Settings> {
    let generator = &record.provenance.generator;
    match Keys::of(generator) {
        Some(keys) => Ok(Settings { keys, ..settings.clone() }),
        None => Err(Error::Refused(format!(
            "provenance.generator is `{generator}`, which this version does not have; certify again"
        ))),
    }
}

/// Compares the stored record with the one computed again from its seed.
fn recomputed(stored: &Record, again: &Record) -> Vec<Finding> {
    let number = |side: fn(f64) -> Figure, name: &str, stored: f64, found: f64| Finding {
        name: name.to_owned(),
        stored: side(stored),
        found: side(found),
        // Two that are infinite have no difference.
        holds: stored == found || (stored - found).abs() <= TOLERANCE * stored.abs().max(1e-9),
    };
    let (upper, lower) = (Figure::Upper, Figure::Lower);
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
    let verified = format!("radius of the verified {}", stored.growth.shape().name());
    let outcome = |record: &Record| Figure::Words(record.growth.outcome.name().to_owned());
    vec![
        number(
            upper,
            "constant of the target margin",
            stored.constants.target.used,
            again.constants.target.used,
        ),
        number(
            upper,
            "constant of the constraint margin",
            stored.constants.constraint.used,
            again.constants.constraint.used,
        ),
        number(upper, "deviation bound, where it differs most", was, is),
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
            upper,
            "conditional failure bound",
            stored.global.claim.certified_risk,
            again.global.claim.certified_risk,
        ),
        text("outcome of local growth", outcome(stored), outcome(again)),
        number(lower, &verified, stored.growth.radius, again.growth.radius),
        text("all claims obtained", Figure::Flag(stored.holds), Figure::Flag(again.holds)),
    ]
}
