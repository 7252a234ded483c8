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
    fold_states(&plant.model, &states(plant, start, spec.horizon), spec, tightening)
}

/// Measures `(nominal, perturbed)` of a pair in f64, as [`super::PairMeasure`] has them.
pub fn pair_measures(
    plant: &Plant,
    [nominal, perturbed]: [&[f32]; 2],
    spec: &RolloutSpec,
    tightening: &Tightening,
    control: PairControl,
) -> (f64, f64) {
    let nominal = states::<f64>(plant, nominal, spec.horizon);
    let mut x: Vec<f64> = perturbed.iter().copied().map(f64::from).collect();
    let mut replayed = vec![x.clone()];
    for (step, state) in (0..spec.horizon).zip(&nominal) {
        let driver = match control {
            PairControl::Replay => state,
            PairControl::ClosedLoop => &x,
        };
        x = plant.model.next(&x, &plant.control(driver, step), step);
        replayed.push(x.clone());
    }
    let plain = Tightening::none(spec);
    let model = &plant.model;
    (fold_states(model, &nominal, spec, tightening), fold_states(model, &replayed, spec, &plain))
}

/// Folds the margins of `states`.
fn fold_states(
    model: &Model,
    states: &[Vec<f64>],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    let margins = (0..).zip(states).map(|(step, x)| Margins {
        target: model.target_at(x, step),
        constraint: model.constraint_at(x, step),
        finite: x.iter().all(|x| x.is_finite()),
    });
    fold(margins, spec, tightening)
}

/// What the fold knows of a state.
pub(super) struct Margins {
    /// Target margin.
    pub(super) target: f64,
    /// Constraint margin.
    pub(super) constraint: f64,
    /// Whether the state is finite.
    pub(super) finite: bool,
}

/// Folds the margins of states in order; a state that is not finite, or a margin that is no number, fails
/// the rollout from there on.
pub(super) fn fold(
    steps: impl Iterator<Item = Margins>,
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    let mut fold = Fold::new();
    for (t, margins) in steps.enumerate() {
        let target = margins.target - f64::from(tightening.target[t]);
        let constraint = margins.constraint - f64::from(tightening.constraint[t]);
        let number = !target.is_nan() && !constraint.is_nan();
        if !(number && margins.finite) {
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
