//! The certified set: `V_check` of any states, over a slice, and its conditional failure.

use rayon::prelude::*;

use super::Context;
use super::bound::{certified_risk, interval};
use super::coordinates::{Coordinates, coordinates};
use super::finding::{Figure, Finding};
use super::purpose;
use super::record::{Claim, GlobalRecord, SliceAxisRecord, SliceRecord, finite_margin};
use super::settings::Settings;
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::rollout::{
    DeviationTask, Keep, NON_FINITE, PairMeasure, Pairs, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Starts, StateList, States, Tightening, replay,
};

/// Pairs that are run in f32 and f64 to measure the f32 error.
const ERROR_SAMPLE: u64 = 128;
/// The band around zero that is run again in f64, in measured errors.
const BAND_FACTOR: f64 = 8.0;
/// The least band: rounding of a margin of order 10 in f32.
const LEAST_BAND: f64 = 1e-5;

/// `V_check` (or its sign) of each of `states`; a measure within `band` of zero is that of f64.
pub fn check_margins(
    context: Context<'_>,
    spec: &RolloutSpec,
    tightening: &Tightening,
    states: States<'_>,
    query: Query,
    band: f64,
) -> Result<Vec<f32>> {
    if states.is_empty() {
        return Ok(Vec::new());
    }
    let (starts, range) = (Starts::Listed(states), 0..states.len() as u64);
    let task = ReachAvoidTask { starts, range: range.clone(), spec: *spec, tightening, query };
    let advance = &mut |count| context.watch.advance(count);
    let tally = context.program.tally_told(&task, Keep::Measures, advance)?;
    let mut margins = tally.finish(range)?.values;
    if query == Query::Measure {
        let near = |margin: &&mut f32| f64::from(margin.abs()) <= band;
        let pairs = margins.iter_mut().zip(states.iter());
        for (margin, start) in pairs.filter(|(margin, _)| near(margin)) {
            // Rounding to f32 keeps the sign.
            *margin = replay::measure(context.plant(), start, spec, tightening) as f32;
        }
    }
    Ok(margins)
}

/// `V_check`, target and constraint margin over the slice through the state; `band` as in
/// [`check_margins`].
pub fn slice(
    context: Context<'_>,
    settings: &Settings,
    tightening: &Tightening,
    band: f64,
) -> Result<SliceRecord> {
    let states = slice_through(settings, &settings.state);
    context.watch.begin("slice", states.len() as u64);
    let query = Query::Measure;
    let mut slice = slice_record(context.model(), settings, states.view());
    slice.check_margin =
        check_margins(context, &settings.spec, tightening, states.view(), query, band)?;
    Ok(slice)
}

/// The slice through `states` without `V_check`, which only rollouts tell; empty where there is no
/// slice.
pub(super) fn slice_record(model: &Model, settings: &Settings, states: States<'_>) -> SliceRecord {
    let axis = |i: usize| match &settings.slice {
        Some(axes) => SliceAxisRecord { state: axes[i].state, values: axes[i].values.clone() },
        None => SliceAxisRecord { state: 0, values: Vec::new() },
    };
    SliceRecord {
        x: axis(0),
        y: axis(1),
        check_margin: Vec::new(),
        target_margin: states.iter().map(|x| finite_margin(model.target_at(x, 0))).collect(),
        constraint_margin: states
            .iter()
            .map(|x| finite_margin(model.constraint_at(x, 0)))
            .collect(),
    }
}

/// The cells of the slice through `state`, row by row; none where there is no slice.
pub fn slice_through(settings: &Settings, state: &[f32]) -> StateList {
    let Some([across, along]) = &settings.slice else {
        return StateList::new(state.len());
    };
    let cell = |y: f32, x: f32| {
        let mut state = state.to_vec();
        state[across.state] = x;
        state[along.state] = y;
        state
    };
    let row = |y: f32| across.values.iter().map(move |&x| cell(y, x));
    StateList::new(state.len()).with(along.values.iter().flat_map(|&y| row(y)))
}

/// Draws pairs from the box: how much of it is certified, and how often a perturbed rollout
/// fails whose nominal start is, sections 4 and 8.3.
pub fn conditional(
    context: Context<'_>,
    settings: &Settings,
    tightening: &Tightening,
    purposes: [Purpose; 2],
) -> Result<GlobalRecord> {
    let draws = settings.global.draws;
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let [nominal, perturbation] = purposes.map(|purpose| settings.stream(purpose, 0));
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
    context.program.deviation(&task, &mut |first, pairs| {
        count.add(context.plant(), &task, first, pairs);
        context.watch.advance(pairs.len() as u64)
    })?;
    conclude(context.model(), settings, &count, f32_error)
}

/// What `stored` says as its own counts and `settings` give it.
pub(super) fn derived(
    model: &Model,
    settings: &Settings,
    stored: &GlobalRecord,
) -> Result<GlobalRecord> {
    let GlobalRecord { accepted, reached, non_finite, f32_error, f64_reruns, .. } = *stored;
    let (band, failures) = (band_of(f32_error), stored.claim.failures);
    let count = Count { band, accepted, failures, reached, non_finite, f64_reruns };
    conclude(model, settings, &count, f32_error)
}

/// Claim and intervals that the counts support.
fn conclude(
    model: &Model,
    settings: &Settings,
    count: &Count,
    f32_error: f64,
) -> Result<GlobalRecord> {
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let box_volume = region.volume();
    let Coordinates { dimension, frozen } = coordinates(model, &region.varies());
    let (draws, beta) = (settings.global.draws, settings.global.beta);
    let (low, high) = interval(count.accepted, draws, beta);
    let risk = certified_risk(count.accepted, count.failures, beta);
    let states = model.states.len();
    let claim = Claim {
        name: "global".to_owned(),
        statement: format!(
            "With confidence 1 - {beta}, a perturbed rollout whose nominal start is drawn from the \
             box and certified fails with probability at most {risk:.6} \
             ({} of {} such rollouts failed).",
            count.failures, count.accepted
        ),
        measure: format!(
            "nominal start uniform in the certified part of the box, {dimension} of {states} \
             coordinates varying; perturbed start uniform in the Euclidean ball of radius {} around \
             it, all {states} coordinates",
            settings.deviation.radius
        ),
        dimension,
        frozen,
        scenarios: count.accepted,
        failures: count.failures,
        decision_vars: 1,
        epsilon: None,
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
    fn add(&mut self, plant: &Plant, task: &DeviationTask<'_>, first: u64, pairs: &[PairMeasure]) {
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
fn pair_f64(plant: &Plant, task: &DeviationTask<'_>, index: u64) -> (f64, f64) {
    let [nominal, perturbed] = task.pairs.pair(index);
    let pair = [&*nominal, &*perturbed];
    replay::pair_measures(plant, pair, &task.spec, task.tightening, task.control)
}

/// The band around zero that a measured f32 error asks for.
fn band_of(f32_error: f64) -> f64 {
    (BAND_FACTOR * f32_error).max(LEAST_BAND)
}

/// The band around zero within which measures are run again in f64, from the f32 error measured
/// on pairs drawn from the box.
pub fn band(context: Context<'_>, settings: &Settings, tightening: &Tightening) -> Result<f64> {
    let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
    let [nominal, perturbation] = purposes.map(|purpose| settings.stream(purpose, 0));
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn {
                region: Region::new_box(&*settings.low, &*settings.high)?,
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
fn f32_error(context: Context<'_>, task: &DeviationTask<'_>) -> Result<f64> {
    let (range, plant) = (0..ERROR_SAMPLE.min(task.range.end), context.plant());
    let sample = DeviationTask { range: range.clone(), ..task.clone() };
    let pairs = context.program.tally_pairs(&sample, Keep::Measures)?.finish(range)?.values;
    let finite = |a: f64, b: f32| {
        if b == NON_FINITE || a == f64::from(NON_FINITE) { 0.0 } else { (a - f64::from(b)).abs() }
    };
    let error = |(index, pair): (usize, &PairMeasure)| {
        let (nominal, perturbed) = pair_f64(plant, task, index as u64);
        finite(nominal, pair.nominal).max(finite(perturbed, pair.perturbed))
    };
    Ok(pairs.par_iter().enumerate().map(error).reduce(|| 0.0, f64::max))
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
