//! A system whose controls are clipped before it sees them.

use super::{Axis, Body, Feature, Parameter, System};
use crate::real::Real;

/// A system behind a clip of each control to its bounds, so that its own formulas need none.
#[derive(Clone, Debug)]
pub struct Clipped<S, const NU: usize> {
    system: S,
    /// Lower and upper bound of each control.
    bounds: [[f32; 2]; NU],
}

impl<S, const NU: usize> Clipped<S, NU> {
    /// `system` with its controls clipped to the axes that it has for them; an infinite bound leaves a
    /// side open.
    pub fn new<const NX: usize>(system: S) -> Self
    where
        S: System<NX, NU>,
    {
        let bounds = system.controls().map(|axis| [axis.low, axis.high]);
        Self { system, bounds }
    }
}

impl<S, const NX: usize, const NU: usize> System<NX, NU> for Clipped<S, NU>
where
    S: System<NX, NU>,
{
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
        let clip = |i: usize| {
            let [low, high] = self.bounds[i];
            u[i].clamp(R::lit(low), R::lit(high))
        };
        self.system.step(x, std::array::from_fn(clip))
    }
    #[inline(always)]
    fn target<R: Real>(&self, x: [R; NX]) -> R {
        self.system.target(x)
    }
    #[inline(always)]
    fn constraint<R: Real>(&self, x: [R; NX]) -> R {
        self.system.constraint(x)
    }
    fn parameters(&self) -> Vec<Parameter> {
        self.system.parameters()
    }
    fn bodies(&self) -> Vec<Body> {
        self.system.bodies()
    }
    fn smallest_feature(&self) -> Option<Feature> {
        self.system.smallest_feature()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    /// A sum that leaves its controls as they are: one with bounds, one without an upper one.
    struct Open;

    impl System<1, 2> for Open {
        fn name(&self) -> &str {
            "open"
        }
        fn states(&self) -> [Axis; 1] {
            [Axis::new("x", "m", -1.0, 1.0)]
        }
        fn controls(&self) -> [Axis; 2] {
            [Axis::new("a", "m", -1.0, 2.0), Axis::new("b", "m", 0.0, f32::INFINITY)]
        }
        #[inline(always)]
        fn step<R: Real>(&self, [x]: [R; 1], [a, b]: [R; 2]) -> [R; 1] {
            [x + a + R::lit(10.0) * b]
        }
        #[inline(always)]
        fn target<R: Real>(&self, [x]: [R; 1]) -> R {
            x
        }
        #[inline(always)]
        fn constraint<R: Real>(&self, [x]: [R; 1]) -> R {
            -x
        }
    }

    #[test]
    fn controls_are_within_their_bounds_compiled_and_recorded() {
        let clipped = Clipped::new(Open);
        let model = Model::of(Clipped::new(Open));
        for (given, next) in [([5.0, -1.0], 2.0), ([-5.0, 7.0], 69.0), ([0.5, 1e9], 1e10 + 0.5)] {
            assert_eq!(clipped.step([0.0_f64], given), [next], "{given:?}");
            let inputs = [0.0, given[0], given[1], 0.0, 0.0];
            assert_eq!(model.step.eval(&inputs), [next], "{given:?}");
        }
        assert!(Open.step([0.0_f64], [5.0, -1.0]) != clipped.step([0.0], [5.0, -1.0]));
    }
}
