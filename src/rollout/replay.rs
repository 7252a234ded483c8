//! One rollout of a plant at a time over any `Real`: the f64 oracle, re-runs of borderline cases,
//! pictures.

use super::fold::{Fold, NON_FINITE};
use super::spec::{PairControl, RolloutSpec, Tightening};
use crate::model::{Model, Plant, Role};
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

/// The measure of `start` in f64, with tightened margins.
pub fn measure(plant: &Plant, start: &[f32], spec: &RolloutSpec, tightening: &Tightening) -> f64 {
    fold_states(&plant.model, &states(plant, start, spec.horizon), spec, tightening)
}

/// The margins of the rollout from `start` in f64, `[T + 1]`.
pub fn states_margins(plant: &Plant, start: &[f32], spec: &RolloutSpec) -> Vec<Margins> {
    let states = states::<f64>(plant, start, spec.horizon);
    margins(&plant.model, spec.horizon, states.iter().map(Vec::as_slice))
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

/// The margins at one step; both NaN where the state is not finite, and 0 else where they do not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// What the step is to the task.
    pub role: Role,
    /// Target margin `r_t`.
    pub target: f64,
    /// Constraint margin `c_t`.
    pub constraint: f64,
}

impl Margins {
    /// The margins `[target, constraint]` of a finite state as far as `role` lets them count.
    pub(super) fn of(role: Role, [target, constraint]: [f64; 2]) -> Self {
        Self {
            role,
            target: if role.sees_target() { target } else { 0.0 },
            constraint: if role.sees_constraint() { constraint } else { 0.0 },
        }
    }

    /// The margins of a state that is not finite.
    pub(super) fn lost(role: Role) -> Self {
        Self { role, target: f64::NAN, constraint: f64::NAN }
    }

    /// Whether state and margins are numbers, as far as they count.
    pub(super) fn are_numbers(&self) -> bool {
        !self.target.is_nan() && !self.constraint.is_nan()
    }

    /// Whether what comes may still be a success, as far as this step tells: the task is not over, and what
    /// has to hold holds.
    pub(super) fn is_open(&self) -> bool {
        let holds = |mark: Role, margin: f64| !self.role.has(mark) || margin > 0.0;
        self.role.has(Role::LIVE)
            && self.are_numbers()
            && holds(Role::CONSTRAINT, self.constraint)
            && holds(Role::REQUIREMENT, self.target)
    }
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
        nominal: margins(&plant.model, spec.horizon, nominal),
        perturbed: margins(&plant.model, spec.horizon, replayed.iter().map(Vec::as_slice)),
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

/// The margins at each of `states`, of rollouts of `horizon` steps.
pub(crate) fn margins<'a>(
    model: &Model,
    horizon: u32,
    states: impl Iterator<Item = &'a [f64]>,
) -> Vec<Margins> {
    let at = |(step, x): (u32, &[f64])| {
        let role = model.task.role(step, horizon);
        match x.iter().all(|x| x.is_finite()) {
            true => Margins::of(role, [model.target_at(x, step), model.constraint_at(x, step)]),
            false => Margins::lost(role),
        }
    };
    (0..).zip(states).map(at).collect()
}

/// The measure of `states`.
pub(crate) fn fold_states(
    model: &Model,
    states: &[Vec<f64>],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    let states = states.iter().map(Vec::as_slice);
    measure_of(&margins(model, spec.horizon, states), spec, tightening)
}

/// The measure of the margins of a rollout, `[T + 1]`, tightened.
pub fn measure_of(margins: &[Margins], spec: &RolloutSpec, tightening: &Tightening) -> f64 {
    fold(margins.iter().copied(), spec, tightening)
}

/// Folds the margins of states in order; a state that is not finite, or a margin that counts and is no
/// number, fails the rollout from there on.
pub(super) fn fold(
    steps: impl Iterator<Item = Margins>,
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    let mut fold = Fold::new();
    for (t, margins) in steps.enumerate() {
        if margins.role == Role::OVER {
            break;
        }
        let target = tightening.acted(margins.target, tightening.target[t]);
        let constraint = tightening.acted(margins.constraint, tightening.constraint[t]);
        if target.is_nan() || constraint.is_nan() {
            let so_far: f64 = fold.measure();
            return if so_far > 0.0 { so_far } else { f64::from(NON_FINITE) };
        }
        let gamma = f64::from(spec.gamma);
        fold.add_as(margins.role, bounded(target), bounded(constraint), gamma);
    }
    fold.measure()
}

/// An infinite margin as the largest number: satisfied, or violated, and never more than finite.
fn bounded(margin: f64) -> f64 {
    margin.clamp(f64::from(f32::MIN), f64::from(f32::MAX))
}
