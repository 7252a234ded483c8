//! The measure of a trajectory by its task, folded step by step.

use crate::model::Role;
use crate::real::{Lanes, Real, per_lane};

/// Larger than any margin: stands for infinity, which shaders must not count on.
pub const HUGE: f32 = 1.0e30;

/// Measure of a trajectory that met NaN or infinity before it reached the target: a failure.
pub const NON_FINITE: f32 = -HUGE;

/// The measure so far: of a reach-avoid task max over t of `min(gamma^t r_t, min over s <= t of gamma^s c_s)`;
/// of any task the largest margin by which it holds, section 1 of `docs/method.md`. Twin: `shaders/fold.wgsl`.
#[derive(Clone, Copy, Debug)]
pub struct Fold<R> {
    discount: R,
    safe: R,
    best: R,
}

impl<R: Real> Fold<R> {
    /// The fold before the first state.
    #[inline(always)]
    pub fn new() -> Self {
        Self { discount: R::lit(1.0), safe: R::lit(HUGE), best: R::lit(-HUGE) }
    }

    /// Adds the margins of the next state of a reach-avoid task without a window.
    #[inline(always)]
    pub fn add(&mut self, target_margin: R, constraint_margin: R, gamma: R) {
        self.add_as(Role::REACH_AVOID, target_margin, constraint_margin, gamma);
    }

    /// Adds the margins of the next state, which is `role` to the task.
    #[inline(always)]
    pub fn add_as(&mut self, role: Role, target_margin: R, constraint_margin: R, gamma: R) {
        self.look(role, target_margin, constraint_margin);
        self.advance(gamma);
    }

    /// Adds the margins of a state under the discount of the sample at or before it.
    #[inline(always)]
    pub fn look(&mut self, role: Role, target_margin: R, constraint_margin: R) {
        if role.has(Role::CONSTRAINT) {
            self.safe = self.safe.min(self.discount * constraint_margin);
        }
        if role.has(Role::REQUIREMENT) {
            self.safe = self.safe.min(self.discount * target_margin);
        }
        if role.has(Role::CHANCE) {
            self.best = self.best.max(self.safe.min(self.discount * target_margin));
        }
        if role.has(Role::CONCLUSION) {
            self.best = self.best.max(self.safe);
        }
    }

    /// Goes on to the discount of the next sample.
    #[inline(always)]
    pub fn advance(&mut self, gamma: R) {
        self.discount = self.discount * gamma;
    }

    /// The measure of the states added so far; only its sign has a meaning.
    #[inline(always)]
    pub fn measure(&self) -> R {
        self.best
    }

    /// The smallest discounted margin so far of those that have to hold.
    #[inline(always)]
    pub fn safe(&self) -> R {
        self.safe
    }
}

impl<const N: usize> Fold<Lanes<N>> {
    /// Adds the margins of the next states, each of which has a role of its own, as bits.
    #[inline(always)]
    pub(crate) fn add_each(
        &mut self,
        roles: &[u32; N],
        target: Lanes<N>,
        constraint: Lanes<N>,
        gamma: f32,
    ) {
        let [target, constraint] = [self.discount * target, self.discount * constraint];
        let none = Lanes::lit(HUGE);
        self.safe = self.safe.min(marked(roles, Role::CONSTRAINT, constraint, none));
        self.safe = self.safe.min(marked(roles, Role::REQUIREMENT, target, none));
        let reached = marked(roles, Role::CHANCE, self.safe.min(target), -none);
        self.best = self.best.max(marked(roles, Role::CONCLUSION, self.safe, reached));
        self.discount = self.discount * Lanes::lit(gamma);
    }

    /// Copies lane `from` of `source` to lane `to`.
    #[inline(always)]
    pub fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        self.discount.0[to] = source.discount.0[from];
        self.safe.0[to] = source.safe.0[from];
        self.best.0[to] = source.best.0[from];
    }
}

/// `then` in the lanes whose role has the mark, `otherwise` in the others.
#[inline(always)]
fn marked<const N: usize>(
    roles: &[u32; N],
    mark: Role,
    then: Lanes<N>,
    otherwise: Lanes<N>,
) -> Lanes<N> {
    Lanes(per_lane!(N, i => if roles[i] & mark.bits() != 0 { then.0[i] } else { otherwise.0[i] }))
}

impl<R: Real> Default for Fold<R> {
    fn default() -> Self {
        Self::new()
    }
}

/// Reach-avoid measure of margins `(r_t, c_t)` for t = 0..=T.
///
/// Margins mix metres and metres per second; only the sign has a meaning.
///
/// ```
/// use reachcast::rollout::reach_avoid;
/// // Reaches at t = 1, safe until then; the violation afterwards does not matter.
/// assert!(reach_avoid([(-1.0, 2.0), (0.5, 1.0), (1.0, -1.0)], 0.95) > 0.0_f64);
/// // Violates first.
/// assert!(reach_avoid([(-1.0, -0.1), (0.5, 1.0)], 0.95) < 0.0_f64);
/// ```
pub fn reach_avoid<R: Real>(margins: impl IntoIterator<Item = (R, R)>, gamma: R) -> R {
    measure_as(std::iter::repeat(Role::REACH_AVOID), margins, gamma)
}

/// Measure of margins `(r_t, c_t)` for t = 0..=T, by what each step is to the task.
///
/// ```
/// use reachcast::model::Task;
/// use reachcast::rollout::measure_as;
/// // Safe at all steps; the target does not count.
/// let roles = Task::Avoid.roles(1);
/// assert_eq!(measure_as(roles, [(-1.0, 2.0), (-1.0, 0.5)], 1.0), 0.5_f64);
/// ```
pub fn measure_as<R: Real>(
    roles: impl IntoIterator<Item = Role>,
    margins: impl IntoIterator<Item = (R, R)>,
    gamma: R,
) -> R {
    let mut fold = Fold::new();
    for (role, (target, constraint)) in roles.into_iter().zip(margins) {
        fold.add_as(role, target, constraint, gamma);
    }
    fold.measure()
}
