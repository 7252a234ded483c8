//! The deterministic part of a certificate: the share of the box that is certified, and how far.

use super::Context;
use super::bound::interval;
use super::deterministic::Deterministic;
use super::deterministic_record::{DeterministicRecord, RadiiRecord};
use super::deterministic_settings::DeterministicSettings;
use super::finding::{Figure, Finding};
use super::global::check_margins;
use super::purpose;
use super::record::decimal;
use super::settings::Settings;
use crate::error::Result;
use crate::model::{Form, Model, Plant};
use crate::real::bound::Interval;
use crate::rollout::{
    PairControl, Pairs, Query, Region, Starts, StateList, States, Stream, Tightening, replay,
};
use crate::rounding::{confidence, lower, upper};

/// Starts between two looks at whether to stop.
const CHUNK: usize = 32;
/// The largest radius looked for, in radii asked for.
const MOST: f64 = 8.0;
/// Shares of the starts whose radii are told.
const SHARES: [f64; 3] = [0.1, 0.5, 0.9];
/// Certified starts that a check perturbs.
const TRIED: usize = 20;
/// Perturbations of each.
const PERTURBATIONS: u64 = 100;

/// What is counted and measured.
struct Measured {
    reached: u64,
    certified: u64,
    radii: RadiiRecord,
    f32_distance: f64,
}

/// The deterministic part that `settings` ask for.
pub(super) fn record(
    context: Context<'_>,
    settings: &Settings,
) -> Result<Option<DeterministicRecord>> {
    let Some(asked) = &settings.deterministic else { return Ok(None) };
    let certificate = certificate(context, settings, asked)?;
    let candidates = candidates(context, settings, asked)?;
    let radius = f64::from(asked.radius);
    context.watch.begin("deterministic certificates", candidates.len() as u64);
    let mut certified = 0;
    for chunk in chunks(&candidates) {
        let verdicts = certificate.certified(chunk.view(), radius);
        certified += verdicts.iter().filter(|certified| **certified).count() as u64;
        context.watch.advance(chunk.len() as u64)?;
    }
    let few = first(&candidates, asked.radii as usize);
    let radii = radii(context, &certificate, &few, MOST * radius)?;
    let f32_distance = few.iter().map(|start| distance(context, &certificate, start));
    let f32_distance = f32_distance.fold(0.0, f64::max);
    let reached = candidates.len() as u64;
    Ok(Some(conclude(
        context.model(),
        settings,
        asked,
        Measured { reached, certified, radii, f32_distance },
    )))
}

/// What `stored` says as its own counts and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: Option<&DeterministicRecord>,
) -> Option<DeterministicRecord> {
    let (asked, stored) = (settings.deterministic.as_ref()?, stored?.clone());
    let DeterministicRecord { reached, certified, radii, f32_distance, .. } = stored;
    Some(conclude(model, settings, asked, Measured { reached, certified, radii, f32_distance }))
}

/// Certified radii around `states`; none where `settings` ask for no deterministic certificate.
pub(super) fn radii_around(
    context: Context<'_>,
    settings: &Settings,
    states: States<'_>,
) -> Result<Option<Vec<f64>>> {
    let Some(asked) = &settings.deterministic else { return Ok(None) };
    let certificate = certificate(context, settings, asked)?;
    Ok(Some(certificate.radii(states, MOST * f64::from(asked.radius))))
}

/// Refuses a kind that the plant is not for, before any work.
///
/// # Errors
/// As [`Deterministic::new`].
pub(super) fn check(plant: &Plant, settings: &Settings) -> Result<()> {
    let asked = settings.deterministic.as_ref();
    let made =
        asked.map(|asked| Deterministic::new(plant, settings.spec, asked.control, asked.kind));
    made.transpose().map(|_| ())
}

fn certificate<'a>(
    context: Context<'a>,
    settings: &Settings,
    asked: &DeterministicSettings,
) -> Result<Deterministic<'a>> {
    Deterministic::new(context.plant(), settings.spec, asked.control, asked.kind)
}

/// The starts drawn whose rollouts succeed; no ball around another is certified.
fn candidates(
    context: Context<'_>,
    settings: &Settings,
    asked: &DeterministicSettings,
) -> Result<StateList> {
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let stream = settings.stream(purpose::DETERMINISTIC, 0);
    let starts = (0..asked.starts).map(|index| region.point(stream, index));
    let starts = StateList::new(settings.low.len()).with(starts);
    context.watch.begin("nominal rollouts", asked.starts);
    let none = Tightening::none(&settings.spec);
    let signs = check_margins(context, &settings.spec, &none, starts.view(), Query::Sign, 0.0)?;
    let reached = starts.iter().zip(signs).filter(|(_, sign)| *sign > 0.0);
    let reached: Vec<Vec<f32>> = reached.map(|(start, _)| start.to_vec()).collect();
    Ok(StateList::new(settings.low.len()).with(reached))
}

/// The first `count` starts.
fn first(starts: &StateList, count: usize) -> StateList {
    StateList::new(starts.view().size()).with(starts.iter().take(count))
}

/// The starts in lists of [`CHUNK`].
fn chunks(starts: &StateList) -> impl Iterator<Item = StateList> {
    let size = starts.view().size();
    let parts = (0..starts.len()).step_by(CHUNK);
    parts.map(move |from| StateList::new(size).with(starts.iter().skip(from).take(CHUNK)))
}

/// Certified radii of `starts` up to `most`.
fn radii(
    context: Context<'_>,
    certificate: &Deterministic<'_>,
    starts: &StateList,
    most: f64,
) -> Result<RadiiRecord> {
    context.watch.begin("certified radii", starts.len() as u64);
    let mut radii = Vec::with_capacity(starts.len());
    for chunk in chunks(starts) {
        radii.extend(certificate.radii(chunk.view(), most));
        context.watch.advance(chunk.len() as u64)?;
    }
    radii.sort_by(f64::total_cmp);
    let last = radii.len().saturating_sub(1) as f64;
    let quantile = |share: f64| radii.get((share * last) as usize).copied();
    let quantiles = SHARES.into_iter().filter_map(quantile).collect();
    Ok(RadiiRecord { starts: starts.len() as u64, most, quantiles })
}

/// Largest distance of the f32 rollout from `start` to any state of the enclosure of the nominal; infinite
/// where the enclosure ends before it.
fn distance(context: Context<'_>, certificate: &Deterministic<'_>, start: &[f32]) -> f64 {
    let rollout = replay::looks::<f32>(context.plant(), start, certificate.horizon());
    let enclosure = certificate.nominal(start).states();
    if enclosure.len() < rollout.len() {
        return f64::INFINITY;
    }
    let apart = |(x, sides): (&Vec<f32>, &Vec<Interval>)| {
        let farthest = |(x, side): (&f32, &Interval)| {
            let x = f64::from(*x);
            (side.high - x).max(x - side.low).powi(2)
        };
        x.iter().zip(sides).map(farthest).sum::<f64>().sqrt()
    };
    rollout.iter().zip(&enclosure).map(apart).fold(0.0, f64::max)
}

/// The record that the counts support.
fn conclude(
    model: &Model,
    settings: &Settings,
    asked: &DeterministicSettings,
    measured: Measured,
) -> DeterministicRecord {
    let Measured { reached, certified, radii, f32_distance } = measured;
    let (low, high) = interval(certified, asked.starts, asked.beta);
    let mut record = DeterministicRecord {
        statement: String::new(),
        kind: asked.kind,
        control: asked.control,
        // As it was written: 0.1, not 0.10000000149.
        radius: decimal(asked.radius),
        starts: asked.starts,
        reached,
        certified,
        beta: asked.beta,
        share_interval: [low, high],
        radii,
        f32_distance,
    };
    debug_assert_eq!(settings.deterministic.as_ref(), Some(asked));
    let deed = model.task.short_words(Form::One, settings.spec.horizon);
    record.statement = statement(&record, &deed);
    record
}

/// The certificate in words; `deed` is what a rollout does.
fn statement(record: &DeterministicRecord, deed: &str) -> String {
    let DeterministicRecord { certified, starts, radius, beta, .. } = record;
    let driven = match record.control {
        PairControl::Replay => "under the controls of the nominal start",
        PairControl::ClosedLoop => "under the policy in feedback",
    };
    let [low, high] = record.share_interval;
    format!(
        "Every start within {radius} of a start that is certified by {} {deed} {driven}: \
         no risk and no confidence, in real arithmetic with the f32 parameters of model and policy. With \
         confidence {}, this certifies between {} % and {} % of the box \
         ({certified} of {starts} starts). f32 rollouts were at most {} away from the enclosure.",
        record.kind.name(),
        confidence(*beta),
        lower(100.0 * low),
        upper(100.0 * high),
        upper(record.f32_distance),
    )
}

/// Certified starts against fresh perturbations: none may fail.
pub(super) fn adversaries(context: Context<'_>, settings: &Settings) -> Result<Option<Finding>> {
    let Some(asked) = &settings.deterministic else { return Ok(None) };
    let certificate = certificate(context, settings, asked)?;
    let candidates = candidates(context, settings, asked)?;
    let (mut tried, mut trials, mut failures) = (0, 0, 0);
    for chunk in chunks(&candidates) {
        let verdicts = certificate.certified(chunk.view(), f64::from(asked.radius));
        let certified = chunk.iter().zip(verdicts).filter(|(_, certified)| *certified);
        for (start, _) in certified.take(TRIED - tried) {
            failures += failed(context, settings, asked, (start, tried as u64));
            (tried, trials) = (tried + 1, trials + PERTURBATIONS);
        }
        if tried == TRIED {
            break;
        }
    }
    Ok(Some(Finding {
        name: "perturbations of certified starts".to_owned(),
        stored: Figure::AtMost { at_most: 0.0 },
        found: Figure::Words(format!("{failures} of {trials} fail")),
        holds: failures == 0,
    }))
}

/// How many perturbations of a start fail in f64.
fn failed(
    context: Context<'_>,
    settings: &Settings,
    asked: &DeterministicSettings,
    (start, number): (&[f32], u64),
) -> u64 {
    let list = StateList::new(start.len()).with([start]);
    let stream = Stream::new(settings.seed, purpose::DETERMINISTIC_ADVERSARY, number as u32);
    let none = Tightening::none(&settings.spec);
    let fails = |index: u64| {
        let pairs = Pairs { nominal: Starts::listed(list.view()), radius: asked.radius, stream };
        let [nominal, perturbed] = pairs.pair(index);
        let both = [&*nominal, &*perturbed];
        let spec = &settings.spec;
        replay::pair_measures(context.plant(), both, spec, &none, asked.control).1 <= 0.0
    };
    (0..PERTURBATIONS).filter(|index| fails(*index)).count() as u64
}
