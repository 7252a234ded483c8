//! Pairs of a certificate as starts of a search: a perturbed start, and behind it the nominal one.

use rayon::prelude::*;

use crate::error::Result;
use crate::model::Plant;
use crate::rollout::{
    Keep, PairControl, Query, ReachAvoidTask, RolloutSpec, Starts, StateList, Tightening, replay,
};
use crate::scenario::Context;

/// Measure of a pair whose nominal start is not certified, less its `V_check`: above that of any pair
/// that counts, and sloping to the certified set.
pub(super) const NOT_CERTIFIED: f32 = 1e4;

/// What makes a start and one beside it a pair of a certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct PairSettings {
    /// Radius of the ball around the nominal start.
    pub radius: f32,
    /// What drives the perturbed rollout.
    pub control: PairControl,
    /// What the margins lose: the nominal start is certified where the measure that is left is positive.
    pub tightening: Tightening,
}

/// The perturbed start of a pair, and its nominal one.
pub(super) fn halves(pair: &[f32]) -> [&[f32]; 2] {
    let (perturbed, nominal) = pair.split_at(pair.len() / 2);
    [perturbed, nominal]
}

/// Measure of the perturbed start of each pair whose nominal one is certified; of others more than
/// half of [`NOT_CERTIFIED`].
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn measures(
    context: Context<'_>,
    settings: &PairSettings,
    spec: &RolloutSpec,
    pairs: &[Vec<f32>],
) -> Result<Vec<f32>> {
    let nominal: Vec<&[f32]> = pairs.iter().map(|pair| halves(pair)[1]).collect();
    let check = rolled_out(context, spec, &settings.tightening, &nominal)?;
    let perturbed = match settings.control {
        PairControl::ClosedLoop => {
            let starts: Vec<&[f32]> = pairs.iter().map(|pair| halves(pair)[0]).collect();
            rolled_out(context, spec, &Tightening::none(spec), &starts)?
        }
        // No task of a backend has listed pairs.
        PairControl::Replay => {
            let plant = context.plant();
            let measure = |pair: &Vec<f32>| in_f64(plant, settings, spec, pair) as f32;
            let measures = pairs.par_iter().map(measure).collect();
            context.watch.advance(pairs.len() as u64)?;
            measures
        }
    };
    let either = |(check, perturbed): (&f32, f32)| {
        if *check > 0.0 { perturbed } else { NOT_CERTIFIED - check.max(-NOT_CERTIFIED) }
    };
    Ok(check.iter().zip(perturbed).map(either).collect())
}

/// Measure of the perturbed start in f64; [`NOT_CERTIFIED`] where the nominal one is not certified.
pub(super) fn in_f64(
    plant: &Plant,
    settings: &PairSettings,
    spec: &RolloutSpec,
    pair: &[f32],
) -> f64 {
    let [perturbed, nominal] = halves(pair);
    let PairSettings { control, tightening, .. } = settings;
    let both = replay::pair_measures(plant, [nominal, perturbed], spec, tightening, *control);
    if both.0 > 0.0 { both.1 } else { f64::from(NOT_CERTIFIED) }
}

/// The measure of each of `starts` on the backend.
///
/// # Errors
/// Those of the backend and of the watch.
pub(super) fn rolled_out(
    context: Context<'_>,
    spec: &RolloutSpec,
    tightening: &Tightening,
    starts: &[impl AsRef<[f32]>],
) -> Result<Vec<f32>> {
    let list = StateList::new(context.model().states.len()).with(starts);
    let range = 0..list.len() as u64;
    let task = ReachAvoidTask {
        starts: Starts::Listed(list.view()),
        range: range.clone(),
        spec: *spec,
        tightening,
        query: Query::Measure,
    };
    let advance = &mut |count| context.watch.advance(count);
    Ok(context.program.tally_told(&task, Keep::Measures, advance)?.finish(range)?.values)
}
