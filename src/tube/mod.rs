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

use crate::model::{Moment, Plant, Role};
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
    /// Of each state that is looked at.
    sets: Vec<Set>,
    /// Per step, where controls are replayed.
    controls: Vec<Vec<Affine>>,
}

impl Nominal {
    /// Intervals that hold the states of real arithmetic that are looked at, `[looks, states]`; they end before
    /// the first of which nothing is known.
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
        nominal.sets.push(Set::ball(&nominal.start, 0.0));
        for step in 0..self.spec.horizon {
            let Some(set) = nominal.sets.last() else { break };
            let mut symbols = set.symbols;
            let u = flow::control(self.plant, &set.forms, step, &mut symbols);
            let period = flow::period(&self.plant.model, set, &u, step, symbols);
            let whole = self.is_whole(&period);
            nominal.controls.push(u.iter().map(alone).collect());
            nominal.sets.extend(period);
            if !whole {
                break;
            }
        }
        nominal
    }

    /// Whether something is known of all that is looked at in a period.
    fn is_whole(&self, period: &[Set]) -> bool {
        period.len() == self.plant.model.points as usize
    }

    /// Sets that hold the states looked at of every trajectory from the Euclidean ball of `radius` around the start of
    /// `nominal`, in turn; they end before the first of which nothing is known.
    fn sets(&self, nominal: &Nominal, radius: f64) -> impl Iterator<Item = Set> {
        let whole = !nominal.sets.is_empty() && radius >= 0.0 && radius.is_finite();
        let first = whole.then(|| Set::ball(&nominal.start, radius));
        let horizon = self.spec.horizon;
        std::iter::successors(first.map(|set| (0, vec![set])), move |(step, period)| {
            let whole = *step == 0 || self.is_whole(period);
            let sample = period.last().filter(|_| whole && *step < horizon)?;
            Some((step + 1, self.after(nominal, sample, *step)?))
        })
        .flat_map(|(_, period)| period)
    }

    /// The sets after that of a sample up to the next one, as far as something is known of them.
    fn after(&self, nominal: &Nominal, set: &Set, step: u32) -> Option<Vec<Set>> {
        let mut symbols = set.symbols;
        let u = match self.control {
            PairControl::Replay => nominal.controls.get(step as usize)?.clone(),
            PairControl::ClosedLoop => flow::control(self.plant, &set.forms, step, &mut symbols),
        };
        Some(flow::period(&self.plant.model, set, &u, step, symbols))
    }

    /// Intervals that hold the states looked at of every trajectory from the ball, `[looks, states]`.
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

    /// Where look number `look` is on a rollout, and what it is to the task.
    fn look(&self, look: usize) -> (Moment, Role) {
        let model = &self.plant.model;
        let moment = model.moment(look);
        (moment, model.task.role_at(moment, self.spec.horizon))
    }

    /// The measure so far, until `decided`.
    fn fold(&self, nominal: &Nominal, radius: f64, decided: impl Fn(&Fold) -> bool) -> f64 {
        let mut fold = Fold::new(self.spec.gamma);
        for (look, set) in self.sets(nominal, radius).enumerate() {
            let (moment, role) = self.look(look);
            fold.begin(moment);
            if role.sees_constraint() {
                fold.hold(self.constraint.below(&set, moment));
            }
            // Where the constraint decides, the target changes nothing.
            if role.sees_target() && !decided(&fold) {
                let target = self.target.below(&set, moment);
                // What may be no number fails the rollout from here on.
                if target == f64::NEG_INFINITY {
                    break;
                }
                fold.target(role, target);
            }
            fold.conclude(role);
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
    /// The sample at or before the state that is looked at.
    step: u32,
    discount: Interval,
    safe: f64,
    best: f64,
}

impl Fold {
    fn new(gamma: f32) -> Self {
        let (gamma, huge) = (Interval::point(f64::from(gamma)), f64::from(HUGE));
        Self { gamma, step: 0, discount: Interval::ONE, safe: huge, best: -huge }
    }

    /// Goes on to a state, which has the discount of the sample at or before it.
    fn begin(&mut self, moment: Moment) {
        if moment.step > self.step {
            self.step = moment.step;
            self.discount = self.discount * self.gamma;
        }
    }

    /// A margin of this state, discounted; what is no number is the lowest there is.
    fn discounted(&self, margin: f64) -> f64 {
        let huge = f64::from(HUGE);
        (self.discount * Interval::point(margin.max(-huge).min(huge))).low
    }

    /// A margin of this state that has to hold.
    fn hold(&mut self, margin: f64) {
        self.safe = self.safe.min(self.discounted(margin));
    }

    /// The target margin of this state, as the task sees it.
    fn target(&mut self, role: Role, margin: f64) {
        if role.has(Role::REQUIREMENT) {
            self.hold(margin);
        }
        if role.has(Role::CHANCE) {
            self.best = self.best.max(self.safe.min(self.discounted(margin)));
        }
    }

    /// What had to hold has held, if this is the last state.
    fn conclude(&mut self, role: Role) {
        if role.has(Role::CONCLUSION) {
            self.best = self.best.max(self.safe);
        }
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
