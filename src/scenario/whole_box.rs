//! The whole box: how many of its starts fail under the policy, certified or not.

use super::Context;
use super::bound::interval;
use super::box_record::BoxRecord;
use super::box_settings::BoxSettings;
use super::coordinates::{Coordinates, coordinates};
use super::counterexamples::{Worst, failing_pairs};
use super::criterion::Criterion;
use super::enclosure;
use super::finding::{Figure, Finding};
use super::purpose;
use super::record::{Claim, GlobalRecord, Record};
use super::settings::Settings;
use super::verdict::verdict;
use super::walk::Walk;
use crate::error::Result;
use crate::model::Model;
use crate::rollout::{NON_FINITE, Purpose, Region, Starts};
use crate::rounding::{confidence, lower, upper};

/// The first version of the record that says something of the whole box.
const FIRST_SCHEMA: u32 = 3;

/// What the settings ask about the whole box, from the nominal starts of the conditional sample and,
/// where pairs of it failed, from these; a measure within the band of `global` is that of f64.
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn record(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
    global: &GlobalRecord,
) -> Result<Option<BoxRecord>> {
    let Some(asked) = settings.whole_box else { return Ok(None) };
    let count = count(context, settings, purpose::CONDITIONAL_NOMINAL, global.band)?;
    let mut record = conclude(context.model(), settings, asked, global, &count)?;
    record.starts = count.worst.starts(&starts(settings, purpose::CONDITIONAL_NOMINAL)?);
    if global.claim.failures > 0 {
        record.pairs = failing_pairs(context, settings, criterion, global.band)?;
    }
    Ok(Some(record))
}

/// What `stored` says as its own counts and `settings` give it; where it is missing, what no failure
/// gives, which a comparison notices.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    global: &GlobalRecord,
    stored: Option<&BoxRecord>,
) -> Result<Option<BoxRecord>> {
    let Some(asked) = settings.whole_box else { return Ok(None) };
    let count = stored.map_or_else(Count::default, |stored| Count {
        failures: stored.failures,
        non_finite: stored.non_finite,
        f64_reruns: stored.f64_reruns,
        worst: Worst::default(),
    });
    let mut again = conclude(model, settings, asked, global, &count)?;
    if let Some(BoxRecord { starts, pairs, .. }) = stored {
        (again.starts, again.pairs) = (starts.clone(), pairs.clone());
    }
    Ok(Some(again))
}

/// Settings as the record was made with: none of the box in versions that say nothing of it.
pub(super) fn as_recorded(settings: &Settings, stored: &Record) -> Settings {
    let says = stored.whole_box.is_some() || stored.schema >= FIRST_SCHEMA;
    Settings { whole_box: settings.whole_box.filter(|_| says), ..settings.clone() }
}

/// Whether fresh starts of the box refute the interval of `stored`, each end with `false_alarm`.
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn on_fresh_starts(
    context: Context<'_>,
    settings: &Settings,
    stored: &BoxRecord,
    band: f64,
    false_alarm: f64,
) -> Result<Finding> {
    let fresh = count(context, settings, purpose::CHECK, band)?;
    let (low, high) = interval(fresh.failures, stored.draws, 2.0 * false_alarm);
    let [stored_low, stored_high] = stored.risk_interval;
    Ok(Finding {
        name: "failures of the whole box on fresh starts".to_owned(),
        stored: Figure::Interval(stored.risk_interval),
        found: Figure::Interval([low, high]),
        holds: low <= stored_high && stored_low <= high,
    })
}

/// Counts over the starts.
#[derive(Default)]
struct Count {
    failures: u64,
    non_finite: u64,
    f64_reruns: u64,
    worst: Worst,
}

/// The starts that `purpose` draws from the box.
fn starts(settings: &Settings, purpose: Purpose) -> Result<Starts<'static>> {
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    Ok(Starts::Drawn { region, stream: settings.stream(purpose, 0) })
}

/// Rolls out as many starts as the conditional sample has pairs, and counts those that fail.
fn count(context: Context<'_>, settings: &Settings, purpose: Purpose, band: f64) -> Result<Count> {
    let (starts, range) = (starts(settings, purpose)?, 0..settings.global.draws);
    context.watch.begin("whole box", settings.global.draws);
    let mut count = Count::default();
    Walk { starts, range, spec: settings.spec, band }.each(context, |rolled| {
        let (single, failed) = (rolled.single, rolled.failed());
        count.f64_reruns += rolled.reruns();
        count.failures += u64::from(failed);
        count.non_finite += u64::from(failed && (single.is_nan() || single <= NON_FINITE));
        if failed {
            count.worst.add(single, rolled.index);
        }
    })?;
    Ok(count)
}

/// Claim, interval and verdict that the counts support; no start or pair is listed yet.
fn conclude(
    model: &Model,
    settings: &Settings,
    asked: BoxSettings,
    global: &GlobalRecord,
    count: &Count,
) -> Result<BoxRecord> {
    let (draws, failures) = (settings.global.draws, count.failures);
    let (low, high) = interval(failures, draws, asked.beta);
    let risk_interval = [low, high];
    Ok(BoxRecord {
        claim: claim(model, settings, asked, failures, risk_interval)?,
        verdict: verdict(global, enclosure::record(model, settings).as_ref(), risk_interval),
        draws,
        failures,
        non_finite: count.non_finite,
        risk_interval,
        f64_reruns: count.f64_reruns,
        parameters: model.parameters.clone(),
        starts: Vec::new(),
        pairs: Vec::new(),
    })
}

/// The claim about a start of the box.
fn claim(
    model: &Model,
    settings: &Settings,
    asked: BoxSettings,
    failures: u64,
    [low, high]: [f64; 2],
) -> Result<Claim> {
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let Coordinates { dimension, frozen } = coordinates(model, &region.varies());
    let (draws, states) = (settings.global.draws, model.states.len());
    let BoxSettings { risk, beta } = asked;
    Ok(Claim {
        name: "box".to_owned(),
        statement: format!(
            "With confidence {}, a start drawn from the whole box fails under the policy with \
             probability at least {} and at most {} ({failures} of {draws} starts failed).",
            confidence(beta),
            lower(low),
            upper(high)
        ),
        measure: format!(
            "start uniform in the box, {dimension} of {states} coordinates varying, under the policy in \
             feedback"
        ),
        dimension,
        frozen,
        scenarios: draws,
        failures,
        decision_vars: 1,
        epsilon: risk,
        beta,
        beta_used: beta,
        required_simple: None,
        required_exact: None,
        certified_risk: high,
    })
}
