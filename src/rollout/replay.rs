//! One rollout of a plant at a time over any `Real`: the f64 oracle, re-runs of borderline cases,
//! pictures.

use super::fold::{Fold, NON_FINITE};
use super::spec::{PairControl, RolloutSpec, Tightening};
use crate::model::{Model, Plant};
use crate::real::Real;

/// The states x_0..=x_T from `start`, `[T + 1, states]`.
pub fn states<R: Real>(plant: &Plant, start: &[f32], horizon: u32) -> Vec<Vec<R>> {
    let mut x: Vec<R> = start.iter().copied().map(R::lit).collect();
    let mut states = vec![x.clone()];
    for step in 0..horizon {
        x = plant.model.next(&x, &plant.control(&x, step), step);
        states.push(x.clone());
    }
    states
}

/// Reach-avoid measure of `start` in f64, with tightened margins.
pub fn measure(plant: &Plant, start: &[f32], spec: &RolloutSpec, tightening: &Tightening) -> f64 {
    fold(&plant.model, &states(plant, start, spec.horizon), spec, tightening)
}

/// The margins of the rollout from `start` in f64, `[T + 1]`.
pub fn states_margins(plant: &Plant, start: &[f32], spec: &RolloutSpec) -> Vec<Margins> {
    let states = states::<f64>(plant, start, spec.horizon);
    margins(&plant.model, states.iter().map(Vec::as_slice))
}

/// Measures `(nominal, perturbed)` of a pair in f64, as [`super::PairMeasure`] has them.
pub fn pair_measures(
    plant: &Plant,
    [nominal, perturbed]: [&[f32]; 2],
    spec: &RolloutSpec,
    tightening: &Tightening,
    control: PairControl,
) -> (f64, f64) {
    let PairMargins { nominal, perturbed } =
        pair_margins(plant, [nominal, perturbed], spec, control);
    (measure_of(&nominal, spec, tightening), measure_of(&perturbed, spec, &Tightening::none(spec)))
}

/// The margins of both rollouts of a pair in f64, `[T + 1]` each.
#[derive(Clone, Debug, PartialEq)]
pub struct PairMargins {
    /// Of the nominal rollout.
    pub nominal: Vec<Margins>,
    /// Of the perturbed one.
    pub perturbed: Vec<Margins>,
}

/// The margins at one step; both NaN where the state is not finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Target margin `r_t`.
    pub target: f64,
    /// Constraint margin `c_t`.
    pub constraint: f64,
}

/// The margins of the pair `[nominal, perturbed]` in f64.
pub fn pair_margins(
    plant: &Plant,
    [nominal, perturbed]: [&[f32]; 2],
    spec: &RolloutSpec,
    control: PairControl,
) -> PairMargins {
    let nominal = driven(plant, nominal, spec.horizon);
    let mut x: Vec<f64> = perturbed.iter().copied().map(f64::from).collect();
    let mut replayed = vec![x.clone()];
    for (step, Driven { controls, .. }) in (0..spec.horizon).zip(&nominal) {
        x = match control {
            PairControl::Replay => plant.model.next(&x, controls, step),
            PairControl::ClosedLoop => plant.model.next(&x, &plant.control(&x, step), step),
        };
        replayed.push(x.clone());
    }
    let nominal = nominal.iter().map(|driven| &*driven.state);
    PairMargins {
        nominal: margins(&plant.model, nominal),
        perturbed: margins(&plant.model, replayed.iter().map(Vec::as_slice)),
    }
}

/// A state and the controls there.
struct Driven {
    state: Vec<f64>,
    /// None after the last step.
    controls: Vec<f64>,
}

/// The states x_0..=x_T from `start` with the controls that lead on.
fn driven(plant: &Plant, start: &[f32], horizon: u32) -> Vec<Driven> {
    let mut state: Vec<f64> = start.iter().copied().map(f64::from).collect();
    let mut all = Vec::with_capacity(horizon as usize + 1);
    for step in 0..horizon {
        let controls = plant.control(&state, step);
        let next = plant.model.next(&state, &controls, step);
        all.push(Driven { state, controls });
        state = next;
    }
    all.push(Driven { state, controls: Vec::new() });
    all
}

/// The margins at each of `states`.
fn margins<'a>(model: &Model, states: impl Iterator<Item = &'a [f64]>) -> Vec<Margins> {
    let at = |(step, x): (u32, &[f64])| match x.iter().all(|x| x.is_finite()) {
        true => {
            Margins { target: model.target_at(x, step), constraint: model.constraint_at(x, step) }
        }
        false => Margins { target: f64::NAN, constraint: f64::NAN },
    };
    (0..).zip(states).map(at).collect()
}

/// Folds the margins of `states`; a state that is not finite, or a margin that is no number, fails
/// the rollout from there on.
pub(crate) fn fold(
    model: &Model,
    states: &[Vec<f64>],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    measure_of(&margins(model, states.iter().map(Vec::as_slice)), spec, tightening)
}

/// Reach-avoid measure of the margins of a rollout, `[T + 1]`, tightened.
pub fn measure_of(margins: &[Margins], spec: &RolloutSpec, tightening: &Tightening) -> f64 {
    let mut fold = Fold::new();
    for (t, margins) in margins.iter().enumerate() {
        let target = tightening.acted(margins.target, tightening.target[t]);
        let constraint = tightening.acted(margins.constraint, tightening.constraint[t]);
        if target.is_nan() || constraint.is_nan() {
            let so_far: f64 = fold.measure();
            return if so_far > 0.0 { so_far } else { f64::from(NON_FINITE) };
        }
        fold.add(bounded(target), bounded(constraint), f64::from(spec.gamma));
    }
    fold.measure()
}

/// An infinite margin as the largest number: satisfied, or violated, and never more than finite.
fn bounded(margin: f64) -> f64 {
    margin.clamp(f64::from(f32::MIN), f64::from(f32::MAX))
}
