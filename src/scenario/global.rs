//! The certified set: `V_check` of any states, over a slice, and its conditional failure.

use rayon::prelude::*;

use super::Context;
use super::bound::{certified_risk, interval};
use super::finding::{Figure, Finding};
use super::record::{Claim, GlobalRecord, SliceAxisRecord, SliceRecord};
use super::settings::Settings;
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{
    DeviationTask, NON_FINITE, PairMeasure, Pairs, Plant, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Starts, Stream, Tightening, measure, pair_measures,
};
use crate::system::System;

/// Pairs that are run in f32 and f64 to measure the f32 error.
const ERROR_SAMPLE: u64 = 128;
/// The band around zero that is run again in f64, in measured errors.
const BAND_FACTOR: f64 = 8.0;
/// The least band: rounding of a margin of order 10 in f32.
const LEAST_BAND: f64 = 1e-5;

/// `V_check` (or its sign) of each of `states`; a measure within `band` of zero is that of f64.
pub fn check_margins<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    spec: &RolloutSpec,
    tightening: &Tightening,
    states: &[[f32; NX]],
    query: Query,
    band: f64,
) -> Result<Vec<f32>>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let mut margins = Vec::with_capacity(states.len());
    if states.is_empty() {
        return Ok(margins);
    }
    let task = ReachAvoidTask {
        starts: Starts::Listed(states),
        range: 0..states.len() as u64,
        spec: *spec,
        tightening,
        query,
    };
    context.backend.reach_avoid(context.plant, &task, &mut |_, values| {
        margins.extend_from_slice(values);
        context.watch.advance(values.len() as u64)
    })?;
    if query == Query::Measure {
        let near = |margin: &&mut f32| f64::from(margin.abs()) <= band;
        let pairs = margins.iter_mut().zip(states);
        for (margin, start) in pairs.filter(|(margin, _)| near(margin)) {
            // Rounding to f32 keeps the sign.
            *margin = measure(context.plant, *start, spec, tightening) as f32;
        }
    }
    Ok(margins)
}

/// `V_check`, target and constraint margin over the slice through the state; `band` as in
/// [`check_margins`].
pub fn slice<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
    tightening: &Tightening,
    band: f64,
) -> Result<SliceRecord>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let states = slice_through(settings, &settings.state);
    context.watch.begin("slice", states.len() as u64);
    let system = context.plant.system;
    let axis = |i: usize| SliceAxisRecord {
        state: settings.slice[i].state,
        values: settings.slice[i].values.clone(),
    };
    Ok(SliceRecord {
        x: axis(0),
        y: axis(1),
        check_margin: check_margins(
            context,
            &settings.spec,
            tightening,
            &states,
            Query::Measure,
            band,
        )?,
        target_margin: states.iter().map(|x| system.target(*x)).collect(),
        constraint_margin: states.iter().map(|x| system.constraint(*x)).collect(),
    })
}

/// The cells of the slice through `state`, row by row.
pub fn slice_through<const NX: usize>(
    settings: &Settings<NX>,
    state: &[f32; NX],
) -> Vec<[f32; NX]> {
    let [across, along] = &settings.slice;
    let cell = |y: f32, x: f32| {
        let mut state = *state;
        state[across.state] = x;
        state[along.state] = y;
        state
    };
    along.values.iter().flat_map(|&y| across.values.iter().map(move |&x| cell(y, x))).collect()
}

/// Draws pairs from the box: how much of it is certified, and how often a perturbed rollout
/// fails whose nominal start is, sections 4 and 8.3.
pub fn conditional<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
    tightening: &Tightening,
    purposes: [Purpose; 2],
) -> Result<GlobalRecord>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let draws = settings.global.draws;
    let region = Region::new_box(settings.low, settings.high)?;
    let [nominal, perturbation] = purposes.map(|purpose| Stream::new(settings.seed, purpose, 0));
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn { region, stream: nominal },
            radius: settings.deviation.radius,
            stream: perturbation,
        },
        range: 0..draws,
        spec: settings.spec,
        tightening,
        control: settings.deviation.control,
    };
    context.watch.begin("certified set", draws);
    let f32_error = f32_error(context, &task)?;
    let mut count = Count { band: band_of(f32_error), ..Count::default() };
    context.backend.deviation(context.plant, &task, &mut |first, pairs| {
        count.add(context.plant, &task, first, pairs);
        context.watch.advance(pairs.len() as u64)
    })?;
    conclude(context.plant.system, settings, &count, f32_error)
}

/// What `stored` says as its own counts and `settings` give it.
pub(super) fn derived<S, const NX: usize, const NU: usize>(
    system: &S,
    settings: &Settings<NX>,
    stored: &GlobalRecord,
) -> Result<GlobalRecord>
where
    S: System<NX, NU>,
{
    let GlobalRecord { accepted, reached, non_finite, f32_error, f64_reruns, .. } = *stored;
    let (band, failures) = (band_of(f32_error), stored.claim.failures);
    let count = Count { band, accepted, failures, reached, non_finite, f64_reruns };
    conclude(system, settings, &count, f32_error)
}

/// Claim and intervals that the counts support.
fn conclude<S, const NX: usize, const NU: usize>(
    system: &S,
    settings: &Settings<NX>,
    count: &Count,
    f32_error: f64,
) -> Result<GlobalRecord>
where
    S: System<NX, NU>,
{
    let region = Region::new_box(settings.low, settings.high)?;
    let box_volume = region.volume();
    let (dimension, frozen) = super::certify::coordinates(system, &region.varies());
    let (draws, beta) = (settings.global.draws, settings.global.beta);
    let (low, high) = interval(count.accepted, draws, beta);
    let risk = certified_risk(count.accepted, count.failures, beta);
    let claim = Claim {
        name: "global".to_owned(),
        statement: format!(
            "With confidence 1 - {beta}, a perturbed rollout whose nominal start is drawn from the \
             box and certified fails with probability at most {risk:.6} \
             ({} of {} such rollouts failed).",
            count.failures, count.accepted
        ),
        measure: format!(
            "nominal start uniform in the certified part of the box, {dimension} of {NX} \
             coordinates varying; perturbed start uniform in the Euclidean ball of radius {} around \
             it, all {NX} coordinates",
            settings.deviation.radius
        ),
        dimension,
        frozen,
        scenarios: count.accepted,
        failures: count.failures,
        decision_vars: 1,
        epsilon: risk,
        beta,
        beta_used: beta,
        required_simple: None,
        required_exact: None,
        certified_risk: risk,
    };
    Ok(GlobalRecord {
        claim,
        draws,
        accepted: count.accepted,
        share_interval: [low, high],
        box_volume,
        volume_interval: [low * box_volume, high * box_volume],
        reached: count.reached,
        non_finite: count.non_finite,
        f32_error,
        band: count.band,
        f64_reruns: count.f64_reruns,
    })
}

/// Counts over the pairs.
#[derive(Default)]
struct Count {
    band: f64,
    accepted: u64,
    failures: u64,
    reached: u64,
    non_finite: u64,
    f64_reruns: u64,
}

impl Count {
    /// Adds the pairs `first..`; a measure within the band is run again in f64.
    fn add<S, P, const NX: usize, const NU: usize>(
        &mut self,
        plant: Plant<'_, S, P>,
        task: &DeviationTask<'_, NX>,
        first: u64,
        pairs: &[PairMeasure],
    ) where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        for (index, pair) in (first..).zip(pairs) {
            let (mut nominal, mut perturbed) = (f64::from(pair.nominal), f64::from(pair.perturbed));
            if nominal.abs() <= self.band || perturbed.abs() <= self.band {
                (nominal, perturbed) = pair_f64(plant, task, index);
                self.f64_reruns += 1;
            }
            self.reached += u64::from(perturbed > 0.0);
            self.non_finite += u64::from(perturbed == f64::from(NON_FINITE));
            if nominal > 0.0 {
                self.accepted += 1;
                self.failures += u64::from(perturbed <= 0.0);
            }
        }
    }
}

/// The measures of pair `index` in f64.
fn pair_f64<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_, NX>,
    index: u64,
) -> (f64, f64)
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let pair = task.pairs.load::<1>(index).map(|start| start.map(|lane| lane.0[0]));
    pair_measures(plant, pair, &task.spec, task.tightening, task.control)
}

/// The band around zero that a measured f32 error asks for.
fn band_of(f32_error: f64) -> f64 {
    (BAND_FACTOR * f32_error).max(LEAST_BAND)
}

/// The band around zero within which measures are run again in f64, from the f32 error measured
/// on pairs drawn from the box.
pub fn band<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
    tightening: &Tightening,
) -> Result<f64>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let purposes = [Purpose::ConditionalNominal, Purpose::ConditionalPerturbation];
    let [nominal, perturbation] = purposes.map(|purpose| Stream::new(settings.seed, purpose, 0));
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn {
                region: Region::new_box(settings.low, settings.high)?,
                stream: nominal,
            },
            radius: settings.deviation.radius,
            stream: perturbation,
        },
        range: 0..ERROR_SAMPLE,
        spec: settings.spec,
        tightening,
        control: settings.deviation.control,
    };
    Ok(band_of(f32_error(context, &task)?))
}

/// The largest distance of an f32 measure from f64 over the first pairs, those that are finite.
fn f32_error<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    task: &DeviationTask<'_, NX>,
) -> Result<f64>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let sample = DeviationTask { range: 0..ERROR_SAMPLE.min(task.range.end), ..task.clone() };
    let mut worst = 0.0_f64;
    context.backend.deviation(context.plant, &sample, &mut |first, pairs| {
        let error = |(i, pair): (usize, &PairMeasure)| {
            let (nominal, perturbed) = pair_f64(context.plant, task, first + i as u64);
            let finite = |a: f64, b: f32| {
                if b == NON_FINITE || a == f64::from(NON_FINITE) {
                    0.0
                } else {
                    (a - f64::from(b)).abs()
                }
            };
            finite(nominal, pair.nominal).max(finite(perturbed, pair.perturbed))
        };
        let errors = pairs.par_iter().enumerate().map(error);
        worst = worst.max(errors.reduce(|| 0.0, f64::max));
        Ok(())
    })?;
    Ok(worst)
}

/// Whether the certified shares of two independent samples are compatible.
pub(super) fn share_overlaps(stored: &GlobalRecord, fresh: &GlobalRecord) -> Finding {
    let [low, high] = stored.share_interval;
    let [fresh_low, fresh_high] = fresh.share_interval;
    Finding {
        name: "certified share on fresh pairs".to_owned(),
        stored: Figure::Interval(stored.share_interval),
        found: Figure::Interval(fresh.share_interval),
        holds: low <= fresh_high && fresh_low <= high,
    }
}
