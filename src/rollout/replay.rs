//! One rollout of a plant at a time over any `Real`: the f64 oracle, re-runs of borderline cases,
//! pictures.

use super::fold::{Fold, NON_FINITE};
use super::spec::{PairControl, RolloutSpec, Tightening};
use crate::model::{Model, Moment, Plant, Role};
use crate::real::Real;

/// The states x_0..=x_T from `start` at the samples, `[T + 1, states]`.
pub fn states<R: Real>(plant: &Plant, start: &[f32], horizon: u32) -> Vec<Vec<R>> {
    let mut x: Vec<R> = start.iter().copied().map(R::lit).collect();
    let mut states = vec![x.clone()];
    for step in 0..horizon {
        x = plant.model.next(&x, &plant.control(&x, step), step);
        states.push(x.clone());
    }
    states
}

/// The states from `start` that are looked at, samples and the points between them, `[looks, states]`; as
/// many as [`Model::looks`] says.
pub fn looks<R: Real>(plant: &Plant, start: &[f32], horizon: u32) -> Vec<Vec<R>> {
    let mut states: Vec<Vec<R>> = vec![start.iter().copied().map(R::lit).collect()];
    for step in 0..horizon {
        let x = states.last().map_or(&[][..], Vec::as_slice);
        let parts = plant.model.parts(x, &plant.control(x, step), step);
        states.extend(parts);
    }
    states
}

/// The measure of `start` in f64, with tightened margins.
pub fn measure(plant: &Plant, start: &[f32], spec: &RolloutSpec, tightening: &Tightening) -> f64 {
    fold_looks(&plant.model, &looks(plant, start, spec.horizon), spec, tightening)
}

/// The margins of the rollout from `start` in f64, `[looks]`.
pub fn states_margins(plant: &Plant, start: &[f32], spec: &RolloutSpec) -> Vec<Margins> {
    let states = looks::<f64>(plant, start, spec.horizon);
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

/// The margins of both rollouts of a pair in f64, `[looks]` each.
#[derive(Clone, Debug, PartialEq)]
pub struct PairMargins {
    /// Of the nominal rollout.
    pub nominal: Vec<Margins>,
    /// Of the perturbed one.
    pub perturbed: Vec<Margins>,
}

/// The margins of one state; both NaN where it is not finite, and 0 else where they do not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Where on the rollout it is.
    pub moment: Moment,
    /// What it is to the task.
    pub role: Role,
    /// Target margin `r_t`.
    pub target: f64,
    /// Constraint margin `c_t`.
    pub constraint: f64,
}

impl Margins {
    /// The margins `[target, constraint]` of a finite state as far as `role` lets them count.
    pub(super) fn of(moment: Moment, role: Role, [target, constraint]: [f64; 2]) -> Self {
        Self {
            moment,
            role,
            target: if role.sees_target() { target } else { 0.0 },
            constraint: if role.sees_constraint() { constraint } else { 0.0 },
        }
    }

    /// The margins of a state that is not finite.
    pub(super) fn lost(moment: Moment, role: Role) -> Self {
        Self { moment, role, target: f64::NAN, constraint: f64::NAN }
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
    let start = |x: &[f32]| vec![x.iter().copied().map(f64::from).collect::<Vec<f64>>()];
    let (mut nominal, mut replayed) = (start(nominal), start(perturbed));
    for step in 0..spec.horizon {
        let at = step as usize * plant.model.points as usize;
        let (x, y) = (&nominal[at], &replayed[at]);
        let driven = plant.control(x, step);
        let beside = match control {
            PairControl::Replay => plant.model.parts(y, &driven, step),
            PairControl::ClosedLoop => plant.model.parts(y, &plant.control(y, step), step),
        };
        let along = plant.model.parts(x, &driven, step);
        nominal.extend(along);
        replayed.extend(beside);
    }
    let [nominal, perturbed] = [nominal, replayed]
        .map(|states| margins(&plant.model, spec.horizon, states.iter().map(Vec::as_slice)));
    PairMargins { nominal, perturbed }
}

/// The margins at each of `states`, the looks of a rollout of `horizon` steps.
pub(crate) fn margins<'a>(
    model: &Model,
    horizon: u32,
    states: impl Iterator<Item = &'a [f64]>,
) -> Vec<Margins> {
    let at = |(look, x): (usize, &[f64])| {
        let moment = model.moment(look);
        let role = model.task.role_at(moment, horizon);
        match x.iter().all(|x| x.is_finite()) {
            true => {
                let both = [model.target_at(x, moment), model.constraint_at(x, moment)];
                Margins::of(moment, role, both)
            }
            false => Margins::lost(moment, role),
        }
    };
    states.enumerate().map(at).collect()
}

/// The measure of `states`, the looks of a rollout.
pub(crate) fn fold_looks(
    model: &Model,
    states: &[Vec<f64>],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    let states = states.iter().map(Vec::as_slice);
    measure_of(&margins(model, spec.horizon, states), spec, tightening)
}

/// The measure of the margins of a rollout, `[looks]`, tightened.
pub fn measure_of(margins: &[Margins], spec: &RolloutSpec, tightening: &Tightening) -> f64 {
    fold(margins.iter().copied(), spec, tightening)
}

/// Folds the margins of states in order; a state that is not finite, or a margin that counts and is no
/// number, fails the rollout from there on.
pub(super) fn fold(
    looks: impl Iterator<Item = Margins>,
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f64 {
    let (mut fold, mut step) = (Fold::new(), 0);
    for margins in looks {
        if margins.role == Role::OVER {
            break;
        }
        // A point has the discount of the sample before it, and loses what the one after it does.
        if margins.moment.step > step {
            fold.advance(f64::from(spec.gamma));
            step = margins.moment.step;
        }
        let t = margins.moment.sample();
        let target = tightening.acted(margins.target, tightening.target[t]);
        let constraint = tightening.acted(margins.constraint, tightening.constraint[t]);
        if target.is_nan() || constraint.is_nan() {
            let so_far: f64 = fold.measure();
            return if so_far > 0.0 { so_far } else { f64::from(NON_FINITE) };
        }
        fold.look(margins.role, bounded(target), bounded(constraint));
    }
    fold.measure()
}

/// An infinite margin as the largest number: satisfied, or violated, and never more than finite.
fn bounded(margin: f64) -> f64 {
    margin.clamp(f64::from(f32::MIN), f64::from(f32::MAX))
}
