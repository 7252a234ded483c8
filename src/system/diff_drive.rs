//! A differential drive among round obstacles, on its way to a goal.

use super::{Axis, Body, System};
use crate::real::Real;

/// Step of the explicit Euler integration, seconds.
const DT: f32 = 0.02;

/// A disc in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Centre, m.
    pub center: [f32; 2],
    /// Radius, m.
    pub radius: f32,
}

impl Disc {
    /// Distance of a point from the rim, m: negative inside.
    #[inline(always)]
    pub fn clearance<R: Real>(&self, x: R, y: R) -> R {
        (x - R::lit(self.center[0])).hypot(y - R::lit(self.center[1])) - R::lit(self.radius)
    }
}

/// Two driven wheels on one axle: state `(x, y, yaw)` of the axle's centre in m and rad, controls
/// forward speed in m/s and turn rate in rad/s, both clipped to their bounds.
///
/// The wheels that give these controls turn as [`DiffDrive::wheel_speeds`] says, so their size does
/// not enter the motion. The target is the goal, the constraint the rectangle and the obstacles;
/// both margins are distances in m. The drive is a point to them: obstacles are to be given as wide
/// as its body needs.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffDrive {
    /// Radius of a wheel, m.
    pub wheel_radius: f32,
    /// Distance between the wheels, m.
    pub wheel_separation: f32,
    /// Least and greatest forward speed, m/s.
    pub speed: [f32; 2],
    /// Greatest turn rate to either side, rad/s.
    pub turn_rate: f32,
    /// Lower corner of the rectangle to stay in, m.
    pub low: [f32; 2],
    /// Its upper corner, m.
    pub high: [f32; 2],
    /// What to keep clear of.
    pub obstacles: Vec<Disc>,
    /// Where to go.
    pub goal: Disc,
}

/// The drive of the published comparison of MPPI libraries (MPPI-Generic, Vlahov et al. 2024), with
/// discs in place of its square obstacles, each within its square.
impl Default for DiffDrive {
    fn default() -> Self {
        let obstacle = |x, y, radius| Disc { center: [x, y], radius };
        Self {
            wheel_radius: 1.0,
            wheel_separation: 1.0,
            speed: [-0.35, 0.5],
            turn_rate: 0.5,
            low: [0.0; 2],
            high: [11.0; 2],
            obstacles: vec![
                obstacle(8.2, 8.2, 0.2),
                obstacle(4.25, 6.25, 0.25),
                obstacle(6.15, 5.15, 0.15),
            ],
            goal: Disc { center: [10.0; 2], radius: 0.25 },
        }
    }
}

impl DiffDrive {
    /// Angular speeds of the left and the right wheel, rad/s, that give forward speed `v` and turn
    /// rate `w` without slip: `(v - w L / 2) / r` and `(v + w L / 2) / r`.
    #[inline(always)]
    pub fn wheel_speeds<R: Real>(&self, [speed, turn_rate]: [R; 2]) -> [R; 2] {
        let across = R::lit(0.5 * self.wheel_separation) * turn_rate;
        let radius = R::lit(self.wheel_radius);
        [(speed - across) / radius, (speed + across) / radius]
    }
}

/// Distance from the nearer end of an interval, m: negative outside.
#[inline(always)]
fn within<R: Real>(x: R, low: f32, high: f32) -> R {
    (x - R::lit(low)).min(R::lit(high) - x)
}

impl System<3, 2> for DiffDrive {
    fn name(&self) -> &str {
        "diff-drive"
    }

    fn states(&self) -> [Axis; 3] {
        let pi = std::f32::consts::PI;
        [
            Axis::new("x", "m", self.low[0], self.high[0]),
            Axis::new("y", "m", self.low[1], self.high[1]),
            Axis::new("yaw", "rad", -pi, pi),
        ]
    }

    fn controls(&self) -> [Axis; 2] {
        let [slowest, fastest] = self.speed;
        [
            Axis::new("speed", "m/s", slowest, fastest),
            Axis::new("turn_rate", "rad/s", -self.turn_rate, self.turn_rate),
        ]
    }

    #[inline(always)]
    fn step<R: Real>(&self, [x, y, yaw]: [R; 3], [speed, turn_rate]: [R; 2]) -> [R; 3] {
        let (slowest, fastest) = (R::lit(self.speed[0]), R::lit(self.speed[1]));
        let fastest_turn = R::lit(self.turn_rate);
        let dt = R::lit(DT);
        let ahead = dt * speed.clamp(slowest, fastest);
        [
            x + ahead * yaw.cos(),
            y + ahead * yaw.sin(),
            yaw + dt * turn_rate.clamp(-fastest_turn, fastest_turn),
        ]
    }

    #[inline(always)]
    fn target<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        -self.goal.clearance(x, y)
    }

    #[inline(always)]
    fn constraint<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        let [low, high] = [self.low, self.high];
        let mut margin = within(x, low[0], high[0]).min(within(y, low[1], high[1]));
        for obstacle in &self.obstacles {
            margin = margin.min(obstacle.clearance(x, y));
        }
        margin
    }

    fn bodies(&self) -> Vec<Body> {
        vec![Body { name: "drive".to_owned(), x: 0, y: 1 }]
    }
}
