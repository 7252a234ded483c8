//! Systems whose measures show one thing each.

use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::system::{Axis, System};

/// A system whose measure is one coordinate of the start: it leaves for far below at once.
#[derive(Clone)]
pub(crate) struct Reveal<const NX: usize>(pub(crate) usize);

/// Where [`Reveal`] goes.
pub(crate) const FAR_BELOW: f32 = -1.0e6;

impl<const NX: usize> System<NX, 1> for Reveal<NX> {
    fn name(&self) -> &str {
        "reveal"
    }
    fn states(&self) -> [Axis; NX] {
        std::array::from_fn(|_| Axis::new("x", "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, _: [R; NX], [u]: [R; 1]) -> [R; NX] {
        [R::lit(FAR_BELOW) + R::lit(0.0) * u; NX]
    }
    fn target<R: Real>(&self, x: [R; NX]) -> R {
        x[self.0]
    }
    fn constraint<R: Real>(&self, _: [R; NX]) -> R {
        R::lit(-FAR_BELOW)
    }
}

/// Counts its steps in the first state; squares the second, which overflows if above 1 and is
/// finite again one step later.
#[derive(Clone)]
pub(crate) struct Count;

impl System<2, 1> for Count {
    fn name(&self) -> &str {
        "count"
    }
    fn states(&self) -> [Axis; 2] {
        [Axis::new("n", "", 0.0, 1.0), Axis::new("x", "", 0.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [n, x]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        let next = x.if_lt(R::lit(1e30), x * x, R::lit(0.5));
        [n + R::lit(1.0) + R::lit(0.0) * u, next]
    }
    fn target<R: Real>(&self, [n, _]: [R; 2]) -> R {
        n
    }
    fn constraint<R: Real>(&self, _: [R; 2]) -> R {
        R::lit(-FAR_BELOW)
    }
}

/// A formula for any system: the control is 0.
#[derive(Clone)]
pub(crate) struct Idle;

impl<const NX: usize, const NU: usize> Policy<NX, NU> for Idle {
    fn name(&self) -> String {
        "idle".to_owned()
    }
    fn control<R: Real>(&self, _: [R; NX]) -> [R; NU] {
        [R::lit(0.0); NU]
    }
}
