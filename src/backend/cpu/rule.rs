//! How the margins of a step count: what they lose, and what the step is to the task.

use crate::model::{Moment, Role, Task};
use crate::real::{Lanes, Real, per_lane};
use crate::rollout::{Effect, RolloutSpec, Tightening};

/// What each step, and the points behind it, are to the task, `[T + 1]` roles as bits each; none where all are
/// alike, as in a reach-avoid task without a window.
pub(super) struct Roles {
    samples: Vec<u32>,
    between: Vec<u32>,
}

impl Roles {
    /// Those of `task`.
    pub(super) fn of(task: Task, spec: &RolloutSpec) -> Self {
        let bits = |role: &dyn Fn(u32) -> Role| {
            let steps = if task.is_plain() { 0..0 } else { 0..spec.horizon + 1 };
            steps.map(|step| role(step).bits()).collect()
        };
        Self {
            samples: bits(&|step| task.role(step, spec.horizon)),
            between: bits(&|step| task.role_between(step, spec.horizon)),
        }
    }

    /// Those of the states that are number `point` of their period.
    #[inline(always)]
    fn of_point(&self, point: u32) -> &[u32] {
        if point == 0 { &self.samples } else { &self.between }
    }
}

/// How the margins of the next states of a group count.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule<'a, const N: usize> {
    loss: Loss<N>,
    /// Roles as bits, and the step of each lane; asked for where steps differ alone.
    roles: &'a [u32],
    steps: &'a [u32; N],
}

impl<'a, const N: usize> Rule<'a, N> {
    /// At the same step for all lanes, which `steps` holds once for each, or at point number `point` of its
    /// period.
    #[inline(always)]
    pub(super) fn at(
        tightening: &Tightening,
        roles: &'a Roles,
        steps: &'a [u32; N],
        point: u32,
    ) -> Self {
        let sample = Moment { step: steps[0], point }.sample();
        Self { loss: Loss::at(tightening, sample), roles: roles.of_point(point), steps }
    }

    /// At a step of its own for each lane, or at point number `point` of its period.
    #[inline(always)]
    pub(super) fn at_each(
        tightening: &Tightening,
        roles: &'a Roles,
        steps: &'a [u32; N],
        point: u32,
    ) -> Self {
        let loss = match point {
            0 => Loss::at_each(tightening, steps),
            _ => {
                // An empty lane runs on behind the last step.
                let last = tightening.target.len() as u32 - 1;
                Loss::at_each(tightening, &per_lane!(N, i => (steps[i] + 1).min(last)))
            }
        };
        Self { loss, roles: roles.of_point(point), steps }
    }

    /// The same for margins that lose nothing.
    #[inline(always)]
    pub(super) fn without_loss(self) -> Self {
        Self { loss: Loss::NONE, ..self }
    }

    /// The margins `[target, constraint]` after what they lose.
    #[inline(always)]
    pub(super) fn act(&self, margins: [Lanes<N>; 2]) -> [Lanes<N>; 2] {
        self.loss.act(margins)
    }

    /// The margins as far as the step of each lane lets them count, where steps differ.
    #[inline(always)]
    pub(super) fn seen(&self, target: Lanes<N>, constraint: Lanes<N>) -> [Lanes<N>; 2] {
        let roles = self.roles();
        let target = seen(&roles, Role::CHANCE.with(Role::REQUIREMENT), target);
        [target, seen(&roles, Role::CONSTRAINT, constraint)]
    }

    /// What the step of each lane is to the task, as bits, where steps differ.
    #[inline(always)]
    pub(super) fn roles(&self) -> [u32; N] {
        per_lane!(N, i => self.roles[self.steps[i] as usize])
    }
}

/// The margin where its step has one of the marks, 0 elsewhere.
#[inline(always)]
fn seen<const N: usize>(roles: &[u32; N], marks: Role, margin: Lanes<N>) -> Lanes<N> {
    Lanes(per_lane!(N, i => if roles[i] & marks.bits() != 0 { margin.0[i] } else { 0.0 }))
}

/// What both margins lose, per lane: off the target margin, off the constraint margin; or their factors.
#[derive(Clone, Copy, Debug)]
struct Loss<const N: usize> {
    numbers: [Lanes<N>; 2],
    effect: Effect,
}

impl<const N: usize> Loss<N> {
    /// Nothing.
    const NONE: Self = Self { numbers: [Lanes([0.0; N]); 2], effect: Effect::Subtracted };

    /// At step `t`, the same for all lanes.
    #[inline(always)]
    fn at(tightening: &Tightening, t: usize) -> Self {
        let (target, constraint) = (tightening.target[t], tightening.constraint[t]);
        Self { numbers: [Lanes::lit(target), Lanes::lit(constraint)], effect: tightening.effect }
    }

    /// At a step of its own for each lane.
    #[inline(always)]
    fn at_each(tightening: &Tightening, steps: &[u32; N]) -> Self {
        let Tightening { target, constraint, effect } = tightening;
        let numbers = [
            Lanes(per_lane!(N, i => target[steps[i] as usize])),
            Lanes(per_lane!(N, i => constraint[steps[i] as usize])),
        ];
        Self { numbers, effect: *effect }
    }

    /// The margins `[target, constraint]` with it taken off, or multiplied with it.
    #[inline(always)]
    fn act(&self, [target, constraint]: [Lanes<N>; 2]) -> [Lanes<N>; 2] {
        let [of_target, of_constraint] = self.numbers;
        match self.effect {
            Effect::Subtracted => [target - of_target, constraint - of_constraint],
            Effect::Multiplied => [target * of_target, constraint * of_constraint],
        }
    }
}
