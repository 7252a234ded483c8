//! The plants whose certificates are repeated.

use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::system::{Axis, System};
use std::f64::consts::PI;

/// A unit mass in two wells, pushed towards the right one by a controller that saturates.
#[derive(Clone, Copy)]
pub(crate) struct Duffing;

impl System<2, 1> for Duffing {
    fn name(&self) -> &str {
        "duffing"
    }
    fn states(&self) -> [Axis; 2] {
        [Axis::new("x", "m", -1.8, 1.8), Axis::new("v", "m/s", -1.2, 1.2)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m/s^2", -0.4, 0.4)]
    }
    fn step<R: Real>(&self, [x, v]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        let dt = R::lit(0.1);
        let force = x - x * x * x - R::lit(0.3) * v + u;
        let v = v + dt * force;
        [x + dt * v, v]
    }
    fn target<R: Real>(&self, [x, v]: [R; 2]) -> R {
        let (x, half) = (x - R::lit(1.0), R::lit(0.5));
        R::lit(0.35) - x.abs().max(half * v.abs())
    }
    fn constraint<R: Real>(&self, [x, v]: [R; 2]) -> R {
        (R::lit(1.7) - x.abs()).min(R::lit(1.3) - v.abs())
    }
}

/// Twice the distance from the right well, at most 0.4.
pub(crate) struct Saturated;

impl Policy<2, 1> for Saturated {
    fn name(&self) -> String {
        "saturated".to_owned()
    }
    fn control<R: Real>(&self, [x, v]: [R; 2]) -> [R; 1] {
        let wanted = R::lit(2.0) * (R::lit(1.0) - x) - v;
        [wanted.clamp(R::lit(-0.4), R::lit(0.4))]
    }
}

/// A car of constant speed around a disc in its way.
#[derive(Clone, Copy)]
pub(crate) struct Dubins;

impl System<3, 1> for Dubins {
    fn name(&self) -> &str {
        "dubins"
    }
    fn states(&self) -> [Axis; 3] {
        [
            Axis::new("x", "m", -2.0, 0.0),
            Axis::new("y", "m", -1.0, 1.0),
            Axis::new("heading", "rad", -1.0, 1.0),
        ]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("turn", "rad/s", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x, y, heading]: [R; 3], [turn]: [R; 1]) -> [R; 3] {
        let dt = R::lit(0.1);
        let (sin, cos) = (heading.sin(), heading.cos());
        [x + dt * cos, y + dt * sin, heading + dt * turn]
    }
    fn target<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        let x = x - R::lit(1.5);
        R::lit(0.6) - (x * x + y * y).sqrt()
    }
    fn constraint<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        let y = y - R::lit(0.1);
        (x * x + y * y).sqrt() - R::lit(0.35)
    }
}

/// Full steering towards the target.
pub(crate) struct BangBangSteering;

impl Policy<3, 1> for BangBangSteering {
    fn name(&self) -> String {
        "bang-bang".to_owned()
    }
    fn control<R: Real>(&self, [x, y, heading]: [R; 3]) -> [R; 1] {
        let (sin, cos) = (heading.sin(), heading.cos());
        let across = cos * (R::lit(0.0) - y) - sin * (R::lit(1.5) - x);
        [R::lit(0.0).select_lt(across, R::lit(1.0), R::lit(-1.0))]
    }
}

/// No control.
pub(crate) struct Idle;

impl<const NX: usize> Policy<NX, 1> for Idle {
    fn name(&self) -> String {
        "idle".to_owned()
    }
    fn control<R: Real>(&self, _x: [R; NX]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// Hands the next state's value to the first one, sixteen times as large, step after step.
///
/// The distance at step t = 1, 2, 3 is 16 times the offset of state t but for a hundredth: three
/// steps, three nearly independent directions, so a bound on all three has three support scenarios
/// and the scenario theory holds with equality.
#[derive(Clone, Copy)]
pub(crate) struct Relay;

impl System<4, 1> for Relay {
    fn name(&self) -> &str {
        "relay"
    }
    fn states(&self) -> [Axis; 4] {
        ["a", "b", "c", "d"].map(|name| Axis::new(name, "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("none", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [a, b, c, d]: [R; 4], [u]: [R; 1]) -> [R; 4] {
        [R::lit(16.0) * b, c, d, R::lit(0.0625) * a + u]
    }
    fn target<R: Real>(&self, [a, ..]: [R; 4]) -> R {
        R::lit(1.0) - a.abs()
    }
    fn constraint<R: Real>(&self, [a, ..]: [R; 4]) -> R {
        R::lit(2.0) - a.abs()
    }
}

/// What of the plane fails.
#[derive(Clone, Copy)]
pub(crate) enum Fails {
    /// A wedge with its tip at the origin, that share of every ball around it: every round of a growth is as
    /// likely as the first to come out clean by luck.
    Wedge(f64),
    /// What is farther than 1 from the origin: `1 - 1 / r^2` of a ball of radius r above 1.
    Rim,
}

/// A state that stays where it is.
#[derive(Clone, Copy)]
pub(crate) struct Still(pub(crate) Fails);

impl System<2, 1> for Still {
    fn name(&self) -> &str {
        "still"
    }
    fn states(&self) -> [Axis; 2] {
        ["x", "y"].map(|name| Axis::new(name, "m", -2.0, 2.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("none", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, x: [R; 2], _u: [R; 1]) -> [R; 2] {
        x
    }
    fn target<R: Real>(&self, _x: [R; 2]) -> R {
        R::lit(10.0)
    }
    fn constraint<R: Real>(&self, [x, y]: [R; 2]) -> R {
        match self.0 {
            Fails::Wedge(share) => y.abs() - R::lit((PI * share).tan() as f32) * x,
            Fails::Rim => R::lit(1.0) - x * x - y * y,
        }
    }
}
