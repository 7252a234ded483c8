//! The double integrator in one dimension, whose reach-avoid set has a closed form.

use super::{Axis, Feature, Parameter, System};
use crate::policy::Policy;
use crate::real::Real;

/// Step of the explicit Euler integration, seconds.
const DT: f32 = 0.1;

/// A unit mass on a line: state `(position, velocity)` in m and m/s, control the acceleration.
///
/// The target is `|position| < target`, the constraint `|position| < corridor`. Accelerating
/// toward the origin is the best answer to both, so the reach-avoid set is that of [`BangBang`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleIntegrator {
    /// Half width of the target interval, metres.
    pub target: f32,
    /// Half width of the constraint interval, metres.
    pub corridor: f32,
    /// Bound on the acceleration, m/s^2.
    pub acceleration: f32,
}

impl Default for DoubleIntegrator {
    fn default() -> Self {
        Self { target: 0.25, corridor: 1.0, acceleration: 1.0 }
    }
}

impl System<2, 1> for DoubleIntegrator {
    fn name(&self) -> &str {
        "double-integrator"
    }

    fn states(&self) -> [Axis; 2] {
        [Axis::new("position", "m", -1.2, 1.2), Axis::new("velocity", "m/s", -1.5, 1.5)]
    }

    fn controls(&self) -> [Axis; 1] {
        [Axis::new("acceleration", "m/s^2", -self.acceleration, self.acceleration)]
    }

    #[inline(always)]
    fn step<R: Real>(&self, [position, velocity]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        let u = u.clamp(R::lit(-self.acceleration), R::lit(self.acceleration));
        let dt = R::lit(DT);
        [position + dt * velocity, velocity + dt * u]
    }

    #[inline(always)]
    fn target<R: Real>(&self, [position, _]: [R; 2]) -> R {
        R::parameter("target", self.target) - position.abs()
    }

    #[inline(always)]
    fn constraint<R: Real>(&self, [position, _]: [R; 2]) -> R {
        R::parameter("corridor", self.corridor) - position.abs()
    }

    fn parameters(&self) -> Vec<Parameter> {
        let parameter = Parameter::new;
        vec![parameter("target", "m", self.target), parameter("corridor", "m", self.corridor)]
    }

    fn smallest_feature(&self) -> Option<Feature> {
        let (name, half) = match self.target < self.corridor {
            true => ("the target", self.target),
            false => ("the corridor", self.corridor),
        };
        Some(Feature { name: name.to_owned(), width: 2.0 * half })
    }
}

/// Full acceleration toward the origin: time-optimal for reaching and for staying inside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BangBang {
    /// Acceleration used, m/s^2.
    pub acceleration: f32,
}

impl Policy<2, 1> for BangBang {
    fn name(&self) -> String {
        "bang-bang".to_owned()
    }

    #[inline(always)]
    fn control<R: Real>(&self, [position, _]: [R; 2]) -> [R; 1] {
        let full = self.acceleration;
        [position.if_lt(R::lit(0.0), R::lit(full), R::lit(-full))]
    }
}
