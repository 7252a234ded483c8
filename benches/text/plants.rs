//! Plants that formulas are timed on: few states with angles, and many with six sines and cosines.

use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::system::{Axis, System};

/// Acceleration of gravity, m/s^2.
const GRAVITY: f32 = 9.81;

/// `N` axes of one kind.
fn axes<const N: usize>(low: f32, high: f32) -> [Axis; N] {
    std::array::from_fn(|i| Axis::new(&format!("x{i}"), "1", low, high))
}

/// A car of unit speed; state (x, y, heading), control the turn rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dubins;

impl System<3, 1> for Dubins {
    fn name(&self) -> &str {
        "dubins"
    }
    fn states(&self) -> [Axis; 3] {
        axes(-1.0, 1.0)
    }
    fn controls(&self) -> [Axis; 1] {
        axes(-1.0, 1.0)
    }
    #[inline(always)]
    fn step<R: Real>(&self, [x, y, heading]: [R; 3], [turn]: [R; 1]) -> [R; 3] {
        let dt = R::lit(0.1);
        let turn = turn.clamp(R::lit(-1.0), R::lit(1.0));
        [x + dt * heading.cos(), y + dt * heading.sin(), heading + dt * turn]
    }
    #[inline(always)]
    fn target<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        R::lit(0.5) - (x - R::lit(2.0)).hypot(y)
    }
    #[inline(always)]
    fn constraint<R: Real>(&self, [x, y, _]: [R; 3]) -> R {
        x.hypot(y) - R::lit(0.5)
    }
}

/// A quadrotor: position, velocity, roll, pitch and yaw, body rates; thrust and three torques.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quadrotor;

impl System<12, 4> for Quadrotor {
    fn name(&self) -> &str {
        "quadrotor"
    }
    fn states(&self) -> [Axis; 12] {
        axes(-0.3, 0.3)
    }
    fn controls(&self) -> [Axis; 4] {
        axes(-1.0, 1.0)
    }
    #[inline(always)]
    fn step<R: Real>(&self, state: [R; 12], u: [R; 4]) -> [R; 12] {
        let [x, y, z, vx, vy, vz, roll, pitch, yaw, p, q, r] = state;
        let dt = R::lit(0.02);
        let [lift, ul, um, un] = u.map(|u| u.clamp(R::lit(-1.0), R::lit(1.0)));
        let thrust = R::lit(GRAVITY) * (R::lit(1.0) + lift);
        let [sin_roll, cos_roll] = [roll.sin(), roll.cos()];
        let [sin_pitch, cos_pitch] = [pitch.sin(), pitch.cos()];
        let [sin_yaw, cos_yaw] = [yaw.sin(), yaw.cos()];
        let across = q * sin_roll + r * cos_roll;
        [
            x + dt * vx,
            y + dt * vy,
            z + dt * vz,
            vx + dt * (thrust * (cos_yaw * sin_pitch * cos_roll + sin_yaw * sin_roll)),
            vy + dt * (thrust * (sin_yaw * sin_pitch * cos_roll - cos_yaw * sin_roll)),
            vz + dt * (thrust * (cos_pitch * cos_roll) - R::lit(GRAVITY)),
            roll + dt * (p + across * (sin_pitch / cos_pitch)),
            pitch + dt * (q * cos_roll - r * sin_roll),
            yaw + dt * (across / cos_pitch),
            p + dt * (R::lit(-0.7) * q * r + R::lit(10.0) * ul),
            q + dt * (R::lit(0.7) * p * r + R::lit(10.0) * um),
            r + dt * (R::lit(0.05) * p * q + R::lit(5.0) * un),
        ]
    }
    #[inline(always)]
    fn target<R: Real>(&self, x: [R; 12]) -> R {
        R::lit(0.5) - x[0].hypot(x[1]).hypot(x[2] - R::lit(1.0))
    }
    #[inline(always)]
    fn constraint<R: Real>(&self, x: [R; 12]) -> R {
        (R::lit(0.6) - x[6].abs()).min(R::lit(0.6) - x[7].abs())
    }
}

/// Linear feedback of each control on a state of its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Feedback;

impl<const NX: usize, const NU: usize> Policy<NX, NU> for Feedback {
    fn name(&self) -> String {
        "feedback".to_owned()
    }
    #[inline(always)]
    fn control<R: Real>(&self, x: [R; NX]) -> [R; NU] {
        let mut u = [R::lit(0.0); NU];
        for (i, u) in u.iter_mut().enumerate() {
            *u = R::lit(-0.5) * x[NX - 1 - i];
        }
        u
    }
}
