//! Tubes: sets that hold every trajectory from a ball of starts, in real arithmetic, and the margins over them.
//!
//! A set is a zonotope over the ball itself: each coordinate is an affine form of the place in the ball and of
//! symbols for what is not linear, f64 rounded outward (`docs/method.md`, section 13).

mod affine;
mod choice;
mod convex;
mod curve;
mod evaluate;
mod flow;
mod lipschitz;
mod margin;
mod piece;
mod state;

use crate::model::{Plant, Role};
use crate::real::bound::Interval;
use crate::rollout::{HUGE, PairControl, RolloutSpec};
use affine::Affine;
use margin::Margin;
use state::Set;

/// What rolls out as a tube, and how.
#[derive(Clone, Debug)]
pub struct Tube<'a> {
    plant: &'a Plant,
    spec: RolloutSpec,
    control: PairControl,
    target: Margin<'a>,
    constraint: Margin<'a>,
}

/// The nominal trajectory of a start, enclosed, and the controls along it.
#[derive(Clone, Debug)]
pub struct Nominal {
    start: Vec<f64>,
    sets: Vec<Set>,
    /// Per step, where controls are replayed.
    controls: Vec<Vec<Affine>>,
}

impl Nominal {
    /// Intervals that hold the states x_0, x_1, ... of real arithmetic, `[steps, states]`; they end before the
    /// first of which nothing is known.
    pub fn states(&self) -> Vec<Vec<Interval>> {
        self.sets.iter().map(ranges).collect()
    }
}

/// Intervals that hold the states of a set.
fn ranges(set: &Set) -> Vec<Interval> {
    set.forms.iter().map(|form| form.range).collect()
}

impl<'a> Tube<'a> {
    /// Tubes of `plant`: perturbed trajectories under the nominal's controls, or under the policy.
    pub fn new(plant: &'a Plant, spec: RolloutSpec, control: PairControl) -> Self {
        let model = &*plant.model;
        let target = Margin::new(model, &model.target);
        let constraint = Margin::new(model, &model.constraint);
        Self { plant, spec, control, target, constraint }
    }

    /// Steps T.
    pub fn horizon(&self) -> u32 {
        self.spec.horizon
    }

    /// The nominal trajectory from `start`, `[states]`; none of a start that is not finite.
    pub fn nominal(&self, start: &[f32]) -> Nominal {
        let start: Vec<f64> = start.iter().copied().map(f64::from).collect();
        let mut nominal = Nominal { start, sets: Vec::new(), controls: Vec::new() };
        if !nominal.start.iter().all(|x| x.is_finite()) {
            return nominal;
        }
        let mut set = Set::ball(&nominal.start, 0.0);
        for step in 0..self.spec.horizon {
            let mut symbols = set.symbols;
            let u = flow::control(self.plant, &set.forms, step, &mut symbols);
            let next = flow::next(&self.plant.model, &set, &u, step, symbols);
            nominal.controls.push(u.iter().map(alone).collect());
            nominal.sets.push(std::mem::replace(&mut set, next));
            if !set.known() {
                return nominal;
            }
        }
        nominal.sets.push(set);
        nominal
    }

    /// Sets that hold x_0, x_1, ... of every trajectory from the Euclidean ball of `radius` around the start of
    /// `nominal`, in turn; they end before the first of which nothing is known.
    fn sets(&self, nominal: &Nominal, radius: f64) -> impl Iterator<Item = Set> {
        let whole = !nominal.sets.is_empty() && radius >= 0.0 && radius.is_finite();
        let first = whole.then(|| Set::ball(&nominal.start, radius));
        let horizon = self.spec.horizon;
        std::iter::successors(first.map(|set| (0, set)), move |(step, set)| {
            let next = (*step < horizon).then(|| self.after(nominal, set, *step)).flatten();
            next.map(|set| (step + 1, set))
        })
        .map(|(_, set)| set)
    }

    /// The set after `set`, if something is known of it.
    fn after(&self, nominal: &Nominal, set: &Set, step: u32) -> Option<Set> {
        let mut symbols = set.symbols;
        let u = match self.control {
            PairControl::Replay => nominal.controls.get(step as usize)?.clone(),
            PairControl::ClosedLoop => flow::control(self.plant, &set.forms, step, &mut symbols),
        };
        let next = flow::next(&self.plant.model, set, &u, step, symbols);
        next.known().then_some(next)
    }

    /// Intervals that hold the states of every trajectory from the ball, `[steps, states]`.
    pub fn states(&self, nominal: &Nominal, radius: f64) -> Vec<Vec<Interval>> {
        self.sets(nominal, radius).map(|set| ranges(&set)).collect()
    }

    /// A number that the measure is nowhere below over the ball of `radius` around the start of `nominal`: the
    /// measure of the lower bounds of both margins over the tube. Positive: every trajectory does the task; where
    /// it may choose when to be in the target, at one common step.
    pub fn measure(&self, nominal: &Nominal, radius: f64) -> f64 {
        self.fold(nominal, radius, |fold| fold.safe <= fold.best)
    }

    /// Whether [`Self::measure`] is positive, told as soon as that shows.
    pub fn certifies(&self, nominal: &Nominal, radius: f64) -> bool {
        self.fold(nominal, radius, |fold| fold.best > 0.0 || fold.safe <= 0.0) > 0.0
    }

    /// The measure so far, until `decided`.
    fn fold(&self, nominal: &Nominal, radius: f64, decided: impl Fn(&Fold) -> bool) -> f64 {
        let mut fold = Fold::new(self.spec.gamma);
        for (step, set) in self.sets(nominal, radius).enumerate() {
            let step = step as u32;
            let role = self.plant.model.task.role(step, self.spec.horizon);
            if role.sees_constraint() {
                fold.hold(self.constraint.below(&set, step));
            }
            // Where the constraint decides, the target changes nothing.
            if role.sees_target() && !decided(&fold) {
                let target = self.target.below(&set, step);
                // What may be no number fails the rollout from here on.
                if target == f64::NEG_INFINITY {
                    break;
                }
                fold.target(role, target);
            }
            fold.end_step(role);
            if decided(&fold) || role == Role::OVER {
                break;
            }
        }
        fold.best
    }
}

/// Lower ends of the measure so far.
struct Fold {
    gamma: Interval,
    discount: Interval,
    safe: f64,
    best: f64,
}

impl Fold {
    fn new(gamma: f32) -> Self {
        let (gamma, huge) = (Interval::point(f64::from(gamma)), f64::from(HUGE));
        Self { gamma, discount: Interval::ONE, safe: huge, best: -huge }
    }

    /// A margin of this step, discounted; what is no number is the lowest there is.
    fn discounted(&self, margin: f64) -> f64 {
        let huge = f64::from(HUGE);
        (self.discount * Interval::point(margin.max(-huge).min(huge))).low
    }

    /// A margin of this step that has to hold.
    fn hold(&mut self, margin: f64) {
        self.safe = self.safe.min(self.discounted(margin));
    }

    /// The target margin of this step, as the task sees it.
    fn target(&mut self, role: Role, margin: f64) {
        if role.has(Role::REQUIREMENT) {
            self.hold(margin);
        }
        if role.has(Role::CHANCE) {
            self.best = self.best.max(self.safe.min(self.discounted(margin)));
        }
    }

    /// Ends this step.
    fn end_step(&mut self, role: Role) {
        if role.has(Role::CONCLUSION) {
            self.best = self.best.max(self.safe);
        }
        self.discount = self.discount * self.gamma;
    }
}

/// A control by itself: what it may be, whatever it depends on.
fn alone(control: &Affine) -> Affine {
    if !control.known() {
        return Affine::unknown();
    }
    let Interval { low, high } = control.range;
    let middle = 0.5 * low + 0.5 * high;
    let away = (control.range - Interval::point(middle)).magnitude();
    Affine::new(middle, Vec::new(), Vec::new(), away)
}
