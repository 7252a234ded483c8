//! How the margins of a step count: what they lose, and what the step is to the task.

use crate::model::{Role, Task};
use crate::real::{Lanes, Real, per_lane};
use crate::rollout::{Effect, RolloutSpec, Tightening};

/// What each step is to the task, `[T + 1]` roles as bits; none where all steps are alike, as in a reach-avoid
/// task without a window.
pub(super) struct Roles(Vec<u32>);

impl Roles {
    /// Those of `task`.
    pub(super) fn of(task: Task, spec: &RolloutSpec) -> Self {
        let roles = || task.roles(spec.horizon).into_iter().map(Role::bits).collect();
        Self(if task.is_plain() { Vec::new() } else { roles() })
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
    /// At the same step for all lanes, which `steps` holds once for each.
    #[inline(always)]
    pub(super) fn at(tightening: &Tightening, roles: &'a Roles, steps: &'a [u32; N]) -> Self {
        Self { loss: Loss::at(tightening, steps[0] as usize), roles: &roles.0, steps }
    }

    /// At a step of its own for each lane.
    #[inline(always)]
    pub(super) fn at_each(tightening: &Tightening, roles: &'a Roles, steps: &'a [u32; N]) -> Self {
        Self { loss: Loss::at_each(tightening, steps), roles: &roles.0, steps }
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
