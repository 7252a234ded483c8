//! One rollout at a time over any `Real`: the f64 oracle, re-runs of borderline cases, pictures.

use super::fold::{Fold, NON_FINITE};
use super::spec::{PairControl, Plant, RolloutSpec, Tightening};
use crate::policy::Policy;
use crate::real::Real;
use crate::system::System;

/// The states x_0..=x_T from `start` under the policy, `[T + 1, NX]`.
pub fn trajectory<R: Real, S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    start: [f32; NX],
    horizon: u32,
) -> Vec<[R; NX]>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let mut x = start.map(R::lit);
    let mut states = vec![x];
    for _ in 0..horizon {
        x = plant.system.step(x, plant.policy.control(x));
        states.push(x);
    }
    states
}

/// Reach-avoid measure of `start` in f64, with tightened margins.
pub fn measure<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    start: [f32; NX],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let states = trajectory::<f64, S, P, NX, NU>(plant, start, spec.horizon);
    fold(plant.system, &states, spec, tightening)
}

/// Measures `(nominal, perturbed)` of a pair in f64, as [`super::PairMeasure`] has them.
pub fn pair_measures<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    [nominal, perturbed]: [[f32; NX]; 2],
    spec: &RolloutSpec,
    tightening: &Tightening,
    control: PairControl,
) -> (f64, f64)
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let nominal = trajectory::<f64, S, P, NX, NU>(plant, nominal, spec.horizon);
    let mut x = perturbed.map(f64::lit);
    let mut replayed = vec![x];
    for state in &nominal[..spec.horizon as usize] {
        let driver = match control {
            PairControl::Replay => *state,
            PairControl::ClosedLoop => x,
        };
        x = plant.system.step(x, plant.policy.control(driver));
        replayed.push(x);
    }
    let plain = Tightening::none(spec);
    (fold(plant.system, &nominal, spec, tightening), fold(plant.system, &replayed, spec, &plain))
}

/// Folds the margins of `states`; a state that is not finite fails the rollout from there on.
fn fold<S, const NX: usize, const NU: usize>(
    system: &S,
    states: &[[f64; NX]],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64
where
    S: System<NX, NU>,
{
    let mut fold = Fold::new();
    for (t, x) in states.iter().enumerate() {
        let target = system.target(*x) - f64::from(tightening.target[t]);
        let constraint = system.constraint(*x) - f64::from(tightening.constraint[t]);
        let finite =
            x.iter().all(|x| x.is_finite()) && target.is_finite() && constraint.is_finite();
        if !finite {
            let so_far: f64 = fold.measure();
            return if so_far > 0.0 { so_far } else { f64::from(NON_FINITE) };
        }
        fold.add(target, constraint, f64::from(spec.gamma));
    }
    fold.measure()
}
