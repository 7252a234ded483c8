//! Points inside a period: where on a rollout a state is looked at, and the parts of a step between them.

use std::borrow::Cow;

use super::{Model, Role, Task};
use crate::formula::record;
use crate::real::Real;

/// Where on a rollout a state is looked at: at sample `step`, or at a point of the period that begins there.
///
/// ```
/// use reachcast::model::Moment;
/// // Two points in each period: sample 0, its points, sample 1, and so on.
/// let moments: Vec<Moment> = (0..5).map(|look| Moment::of_look(look, 3)).collect();
/// let [first, .., last] = moments[..] else { unreachable!("five") };
/// assert_eq!((first, last), (Moment::from(0), Moment { step: 1, point: 1 }));
/// assert_eq!([first, last].map(Moment::sample), [0, 2]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Moment {
    /// The sample, or the one before the point.
    pub step: u32,
    /// Number of the point in its period, from 1 on; 0 at a sample.
    pub point: u32,
}

impl From<u32> for Moment {
    fn from(step: u32) -> Self {
        Self { step, point: 0 }
    }
}

impl Moment {
    /// The look number `look` of a rollout whose periods have `points` parts; sample 0 is look 0.
    pub fn of_look(look: usize, points: u32) -> Self {
        let look = look as u32;
        Self { step: look / points, point: look % points }
    }

    /// The looks that lead to sample `sample` from the one before it: the points between, then the sample; of
    /// sample 0 itself alone.
    pub(crate) fn arriving(sample: u32, points: u32) -> impl Iterator<Item = Self> {
        let last = sample as usize * points as usize;
        let first = if sample == 0 { 0 } else { last + 1 - points as usize };
        (first..=last).map(move |look| Self::of_look(look, points))
    }

    /// The sample itself, or the one after the point: what margins lose and distances count up to.
    pub fn sample(self) -> usize {
        self.step as usize + usize::from(self.point > 0)
    }

    /// Periods since the start where they have `points` parts, rounded to f32 in the same way everywhere.
    pub(crate) fn elapsed(self, points: u32) -> f32 {
        self.step as f32 + share(self.point, points)
    }
}

/// The part of a period before its point number `point`.
pub(crate) fn share(point: u32, points: u32) -> f32 {
    point as f32 / points as f32
}

impl Task {
    /// What a point between step `step` of a rollout of `horizon` steps and the next one is to it: what both
    /// are, without a conclusion.
    ///
    /// ```
    /// use reachcast::model::{Role, Task};
    /// let task = Task::ReachStay { by: Some(3) };
    /// let required = |step: u32| task.role_between(step, 5).has(Role::REQUIREMENT);
    /// assert_eq!([2, 3, 4, 5].map(required), [false, true, true, false]);
    /// ```
    pub fn role_between(&self, step: u32, horizon: u32) -> Role {
        self.role(step, horizon).and(self.role(step + 1, horizon))
    }

    /// What a state that is looked at is to it, in a rollout of `horizon` steps.
    pub fn role_at(&self, moment: Moment, horizon: u32) -> Role {
        match moment.point {
            0 => self.role(moment.step, horizon),
            _ => self.role_between(moment.step, horizon),
        }
    }
}

impl Model {
    /// States of a rollout of `horizon` steps that are looked at: samples, and the points between them.
    pub fn looks(&self, horizon: u32) -> usize {
        horizon as usize * self.points as usize + 1
    }

    /// The number of the look number `look` as a place of the rollout.
    pub fn moment(&self, look: usize) -> Moment {
        Moment::of_look(look, self.points)
    }

    /// The state a part of a period after `x`, which is that of `from`, `[states]`.
    pub fn part<R: Real>(&self, x: &[R], u: &[R], from: Moment) -> Vec<R> {
        self.step.eval(&self.arguments(x, u, from))
    }

    /// The states after `x` under the control `u` that are looked at: the points of the period, then the next
    /// sample, `[points, states]`.
    pub fn parts<R: Real>(&self, x: &[R], u: &[R], step: u32) -> Vec<Vec<R>> {
        let mut states = Vec::with_capacity(self.points as usize);
        for point in 0..self.points {
            let from = states.last().map_or(x, |x: &Vec<R>| x);
            states.push(self.part(from, u, Moment { step, point }));
        }
        states
    }

    /// The inputs of the formulas at point number `point` of the period that begins at `step`, where each lane may
    /// be at a step of its own.
    #[cfg(feature = "cli")]
    pub(crate) fn part_inputs<R: Real>(&self, x: &[R], u: &[R], step: R, point: u32) -> Vec<R> {
        self.arguments_at(x, u, [self.elapsed_at(step, point), step])
    }

    /// Periods since the start at a point of the period that begins at `step`.
    pub(crate) fn elapsed_at<R: Real>(&self, step: R, point: u32) -> R {
        if point == 0 { step } else { step + R::lit(share(point, self.points)) }
    }

    /// The same model of samples alone: its step is a whole period. What asks for the next sample and looks at
    /// nothing between takes it.
    pub(crate) fn sampled(&self) -> Cow<'_, Self> {
        if self.points == 1 {
            return Cow::Borrowed(self);
        }
        let states = self.states.len();
        let step = record(self.inputs(), |inputs| {
            let mut inputs = inputs.to_vec();
            let [time, step] = [inputs.len() - 2, inputs.len() - 1];
            let mut x = inputs[..states].to_vec();
            for point in 0..self.points {
                inputs[..states].copy_from_slice(&x);
                let elapsed = self.elapsed_at(inputs[step], point);
                inputs[time] = elapsed * Real::lit(self.period.unwrap_or(0.0));
                x = self.step.recorded_at(&inputs);
            }
            x
        });
        Cow::Owned(Self { step, points: 1, native: None, ..self.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Window;

    #[test]
    fn points_are_what_both_ends_of_their_period_are() {
        let chance = Role::LIVE.with(Role::CHANCE);
        let safe = Role::LIVE.with(Role::CONSTRAINT);
        let between = |task: Task| (0..=3).map(|t| task.role_between(t, 3)).collect::<Vec<Role>>();
        let over = Role::OVER;
        assert_eq!(
            between(Task::default()),
            [Role::REACH_AVOID; 3].into_iter().chain([over]).collect::<Vec<_>>()
        );
        assert_eq!(between(Task::Avoid), [safe, safe, safe, over]);
        assert_eq!(between(Task::AtEnd), [safe, safe, safe, over]);
        let window = Window { from: 1, to: Some(2) };
        assert_eq!(between(Task::Reach(window)), [Role::LIVE, chance, over, over]);
        let required = safe.with(Role::REQUIREMENT);
        assert_eq!(between(Task::ReachStay { by: Some(2) }), [safe, safe, required, over]);
    }

    #[test]
    fn looks_are_counted_part_by_part() {
        let looks =
            |points: u32| (0..4).map(|look| Moment::of_look(look, points)).collect::<Vec<_>>();
        assert_eq!(looks(1), [0, 1, 2, 3].map(Moment::from));
        let two = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(step, point)| Moment { step, point });
        assert_eq!(looks(2), two);
        assert_eq!(two.map(Moment::sample), [0, 1, 1, 2]);
        assert_eq!(Moment { step: 4, point: 1 }.elapsed(4), 4.25);
    }
}
