//! Costs: what a plan pays at each stage, written once over `Real`.

mod goal;
mod map;
mod quadratic;

pub use goal::GoalCost;
pub use map::{CostMap, Grid, Lookup, MAX_CELLS};
pub use quadratic::{Obstacle, Quadratic};

use crate::real::Real;

/// The cost of one stage of a plan, `l(x_t, u_t, context_t)`.
///
/// Numbers are recorded as literals; what changes from problem to
/// problem or from step to step comes through the `NC >= 1` numbers of the context. Mark the
/// formula `#[inline(always)]`.
pub trait Cost<const NX: usize, const NU: usize, const NC: usize>: Sync {
    /// The cost of the stage; lower is better.
    fn stage<R: Real>(&self, x: [R; NX], u: [R; NU], context: [R; NC]) -> R;

    /// The cost of the state after the last control of a plan, if it has one; the context is a row of its
    /// own, behind those of the stages. Whether there is one depends on neither.
    #[inline(always)]
    fn terminal<R: Real>(&self, _x: [R; NX], _context: [R; NC]) -> Option<R> {
        None
    }

    /// The map that charges a stage besides, if there is one, and the point where it is looked up;
    /// only the point may depend on the state. A map is data of the kernels, not part of their
    /// text.
    #[inline(always)]
    fn map<R: Real>(&self, _x: [R; NX]) -> Option<Lookup<'_, R>> {
        None
    }
}

/// `x^2`.
#[inline(always)]
pub(crate) fn square<R: Real>(x: R) -> R {
    x * x
}

/// `max(0, x)^2`.
#[inline(always)]
pub(crate) fn hinge<R: Real>(x: R) -> R {
    square(x.max(R::lit(0.0)))
}
