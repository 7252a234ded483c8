//! The reach-avoid measure of a trajectory, folded step by step.

use crate::real::{Lanes, Real};

/// Larger than any margin: stands for infinity, which shaders must not count on.
pub const HUGE: f32 = 1.0e30;

/// Measure of a trajectory that met NaN or infinity before it reached the target: a failure.
pub const NON_FINITE: f32 = -HUGE;

/// Reach-avoid measure so far: max over t of `min(gamma^t r_t, min over s <= t of gamma^s c_s)`,
/// section 1 of `docs/method.md`. Twin: `shaders/fold.wgsl`.
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

    /// Adds the margins of the next state.
    #[inline(always)]
    pub fn add(&mut self, target_margin: R, constraint_margin: R, gamma: R) {
        self.safe = self.safe.min(self.discount * constraint_margin);
        self.best = self.best.max(self.safe.min(self.discount * target_margin));
        self.discount = self.discount * gamma;
    }

    /// The measure of the states added so far; only its sign has a meaning.
    #[inline(always)]
    pub fn measure(&self) -> R {
        self.best
    }

    /// The smallest discounted constraint margin so far.
    #[inline(always)]
    pub fn safe(&self) -> R {
        self.safe
    }
}

impl<const N: usize> Fold<Lanes<N>> {
    /// Copies lane `from` of `source` to lane `to`.
    #[inline(always)]
    pub fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        self.discount.0[to] = source.discount.0[from];
        self.safe.0[to] = source.safe.0[from];
        self.best.0[to] = source.best.0[from];
    }
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
    let mut fold = Fold::new();
    for (target, constraint) in margins {
        fold.add(target, constraint, gamma);
    }
    fold.measure()
}
