//! The certified set: `V_check` of any states, over a slice, and its conditional failure.

use super::Context;
use super::bound::{certified_risk, interval};
use super::coordinates::{Coordinates, coordinates};
use super::criterion::Criterion;
use super::drops::pairs;
use super::drops_record::{SequenceOutcome, SequenceRecord, ShareRecord};
use super::drops_settings::ConditionalRisk;
pub use super::margins::check_margins;
use super::pairs_f64;
use super::probe::{PROBES, Probe, probe};
use super::purpose;
use super::record::{Claim, GlobalRecord, SliceAxisRecord, SliceRecord, finite_margin};
use super::settings::Settings;
use crate::error::Result;
use crate::model::{Model, Plant};
use crate::rollout::{
    DeviationTask, NON_FINITE, PairMeasure, Pairs, Purpose, Query, Region, Starts, StateList,
    States, Tightening,
};
use crate::rounding::{confidence, upper};

/// The band around zero that is run again in f64, in measured errors.
const BAND_FACTOR: f64 = 8.0;
/// The least band: rounding of a margin of order 10 in f32.
const LEAST_BAND: f64 = 1e-5;

/// `V_check`, target and constraint margin over the slice through the state; `band` as in
/// [`check_margins`].
pub fn slice(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<SliceRecord> {
    let states = slice_through(settings, &settings.state);
    context.watch.begin("slice", states.len() as u64);
    let query = Query::Measure;
    let mut slice = slice_record(context.model(), settings, states.view());
    slice.check_margin = criterion.margins(context, &settings.spec, states.view(), query, band)?;
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
    criterion: &Criterion<'_>,
    purposes: [Purpose; 2],
) -> Result<GlobalRecord> {
    let draws = settings.global.draws;
    let region = Region::new_box(&*settings.low, &*settings.high)?;
    let [nominal, perturbation] = purposes.map(|purpose| settings.stream(purpose, 0));
    let tightening = criterion.tightening(&settings.spec);
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Drawn { region, stream: nominal },
            radius: settings.deviation.radius,
            stream: perturbation,
        },
        range: 0..draws,
        spec: settings.spec,
        tightening: &tightening,
        control: settings.deviation.control,
    };
    context.watch.begin("certified set", draws);
    let probe = probe(context, &task)?;
    let mut count = Count { band: band_of(probe.error), ..Count::default() };
    context.program.deviation(&task, &mut |first, pairs| {
        let enclosed = criterion.enclosed(context, &task, first, pairs, count.band)?;
        count.add(context.plant(), &task, first, pairs, enclosed.as_deref());
        context.watch.advance(pairs.len() as u64)
    })?;
    let record = conclude(context.model(), settings, &count, probe.error)?;
    Ok(GlobalRecord { f32_apart: Some(probe.apart), ..record })
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
    let record = conclude(model, settings, &count, f32_error)?;
    Ok(GlobalRecord { f32_apart: stored.f32_apart, ..record })
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
        statement: statement(count, draws, beta, risk),
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
        // The certified set is to be as safe as the bound that it rests on; an enclosure rests on none.
        epsilon: settings.enclosed.is_none().then_some(settings.deviation.epsilon),
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
        f32_apart: None,
        band: count.band,
        f64_reruns: count.f64_reruns,
        share: None,
    })
}

/// A set that was chosen among several by a sequence.
pub(super) struct ChosenSet<'a> {
    /// The sequence.
    pub(super) sequence: &'a SequenceRecord,
    /// Its share of the box, from fresh starts.
    pub(super) share: ShareRecord,
    /// Draws whose perturbed start reaches the target.
    pub(super) reached: u64,
    /// Perturbed rollouts that failed for a state that is not finite.
    pub(super) non_finite: u64,
    /// How far measures with the set's tightening lie from f64.
    pub(super) probe: Probe,
    /// Draws decided in f64.
    pub(super) f64_reruns: u64,
}

/// Claim and intervals of a set that was chosen among several.
pub(super) fn of_sequence(
    model: &Model,
    settings: &Settings,
    chosen: &ChosenSet<'_>,
) -> Result<GlobalRecord> {
    let &ChosenSet { sequence, share, reached, non_finite, probe, f64_reruns } = chosen;
    let asked = settings.drops.and_then(|drops| drops.risk);
    let level = sequence.levels.get(sequence.chosen);
    let accepted = level.and_then(|level| level.accepted).unwrap_or_default();
    let failures = level.and_then(|level| level.failures).unwrap_or_default();
    let band = band_of(probe.error);
    let count = Count { band, accepted, failures, reached, non_finite, f64_reruns };
    let mut global = conclude(model, settings, &count, probe.error)?;
    // A risk that is asked for and not tested is not obtained; one that is looked for is told where shown.
    let shown = sequence.risk.filter(|_| sequence.outcome == SequenceOutcome::Accepted);
    if let Some(risk) = shown.or(asked.and_then(ConditionalRisk::asked)) {
        (global.claim.epsilon, global.claim.required_exact) = (Some(risk), sequence.required);
    }
    // Which set was chosen depends on its failures: what holds of it is the risk that accepts, not the bound
    // that these failures give.
    if let Some(risk) = shown {
        let (draws, beta) = (settings.global.draws, settings.global.beta);
        global.claim.certified_risk = risk;
        global.claim.statement = statement(&count, draws, beta, risk);
    }
    global.share_interval = share.interval;
    global.volume_interval = share.interval.map(|end| end * global.box_volume);
    global.share = Some(share);
    global.f32_apart = Some(probe.apart);
    Ok(global)
}

/// The claim in words; of an empty set there is none.
fn statement(count: &Count, draws: u64, beta: f64, risk: f64) -> String {
    if count.accepted == 0 {
        return format!(
            "No claim is made about rollouts from the certified set: it holds none of {draws} nominal \
             starts that were drawn from the box."
        );
    }
    if risk >= 1.0 {
        return format!(
            "No claim is made about rollouts from the certified set: {} of {} perturbed ones failed.",
            count.failures, count.accepted
        );
    }
    format!(
        "With confidence {}, a perturbed rollout whose nominal start is drawn from the box and certified \
         fails with probability at most {} ({} of {} such rollouts failed).",
        confidence(beta),
        upper(risk),
        count.failures,
        count.accepted
    )
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
    /// Adds the pairs `first..`: those that are certified, or of which a measure is within the band, as
    /// f64 has them. Whether a start is certified is for f64 to say within the band alone, or for an
    /// enclosure, which says it of each in `enclosed`.
    fn add(
        &mut self,
        plant: &Plant,
        task: &DeviationTask<'_>,
        first: u64,
        pairs: &[PairMeasure],
        enclosed: Option<&[bool]>,
    ) {
        let band = self.band;
        let near = |pair: &PairMeasure| {
            [pair.nominal, pair.perturbed].iter().any(|measure| f64::from(measure.abs()) <= band)
        };
        let again = |place: usize| {
            let certified = enclosed.map_or(pairs[place].nominal > 0.0, |all| all[place]);
            certified || near(&pairs[place])
        };
        let indices = (0..pairs.len()).filter(|place| again(*place));
        let indices: Vec<u64> = indices.map(|place| first + place as u64).collect();
        let mut doubles = pairs_f64::measures(plant, task, &indices).into_iter();
        for (place, pair) in pairs.iter().enumerate() {
            let single = [pair.nominal, pair.perturbed].map(f64::from);
            let double = again(place).then(|| doubles.next()).flatten();
            self.f64_reruns += u64::from(double.is_some());
            let [nominal, perturbed] = match double {
                Some(double) if near(pair) => double,
                Some([_, perturbed]) => [single[0], perturbed],
                None => single,
            };
            let certified = enclosed.map_or(nominal > 0.0, |all| all[place]);
            self.count(certified, perturbed);
        }
    }

    /// Counts a pair: whether its nominal start is certified, and the measure of the perturbed one.
    fn count(&mut self, certified: bool, perturbed: f64) {
        self.reached += u64::from(perturbed > 0.0);
        self.non_finite += u64::from(perturbed == f64::from(NON_FINITE));
        if certified {
            self.accepted += 1;
            // What is no number failed.
            self.failures += u64::from(perturbed.is_nan() || perturbed <= 0.0);
        }
    }
}

/// The band around zero that a measured f32 error asks for.
pub(super) fn band_of(f32_error: f64) -> f64 {
    (BAND_FACTOR * f32_error).max(LEAST_BAND)
}

/// The band around zero within which measures are run again in f64, from the f32 error measured
/// on pairs drawn from the box.
pub fn band(context: Context<'_>, settings: &Settings, tightening: &Tightening) -> Result<f64> {
    Ok(band_of(probed(context, settings, tightening)?.error))
}

/// How far measures with `tightening` lie from f64, on pairs drawn from the box.
pub(super) fn probed(
    context: Context<'_>,
    settings: &Settings,
    tightening: &Tightening,
) -> Result<Probe> {
    let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
    let task = DeviationTask {
        pairs: pairs(settings, purposes)?,
        range: 0..PROBES,
        spec: settings.spec,
        tightening,
        control: settings.deviation.control,
    };
    probe(context, &task)
}
