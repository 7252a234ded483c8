//! A system that a disturbance pushes at each step.

use crate::policy::Mlp;
use crate::real::Real;
use crate::system::{Axis, System};

/// `x` after the disturbance `d` has pushed it: `x + sum_j scale_j d_j` on the named coordinates.
#[inline(always)]
pub fn pushed<R: Real, const NX: usize>(
    mut x: [R; NX],
    entries: &[(usize, f32)],
    d: &[R],
) -> [R; NX] {
    for (&(coordinate, scale), push) in entries.iter().zip(d) {
        x[coordinate] = x[coordinate] + R::lit(scale) * *push;
    }
    x
}

/// `system` under a disturbance that a network decides from the state.
#[derive(Clone, Copy, Debug)]
pub struct Disturbed<'a, S> {
    system: &'a S,
    network: &'a Mlp,
    entries: &'a [(usize, f32)],
}

impl<'a, S> Disturbed<'a, S> {
    /// `system` pushed by `network` on the coordinates `entries`.
    ///
    /// # Panics
    /// If the network has not one output for each of them.
    pub fn new(system: &'a S, network: &'a Mlp, entries: &'a [(usize, f32)]) -> Self {
        assert_eq!(network.widths().last(), Some(&entries.len()), "outputs of the disturbance");
        Self { system, network, entries }
    }
}

impl<S: System<NX, NU>, const NX: usize, const NU: usize> System<NX, NU> for Disturbed<'_, S> {
    fn name(&self) -> &str {
        self.system.name()
    }

    fn states(&self) -> [Axis; NX] {
        self.system.states()
    }

    fn controls(&self) -> [Axis; NU] {
        self.system.controls()
    }

    #[inline(always)]
    fn step<R: Real>(&self, x: [R; NX], u: [R; NU]) -> [R; NX] {
        pushed(self.system.step(x, u), self.entries, &self.network.forward(&x))
    }

    #[inline(always)]
    fn target<R: Real>(&self, x: [R; NX]) -> R {
        self.system.target(x)
    }

    #[inline(always)]
    fn constraint<R: Real>(&self, x: [R; NX]) -> R {
        self.system.constraint(x)
    }
}
