//! What flies: a quadrotor in a plane, one in space, the two drones of the race.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::network::network;
use super::truth::{Dynamics, Goal, Truth};

/// Two rotors on an arm.
pub(crate) fn planar_quadrotor() -> Truth {
    let (mass, inertia, arm, gravity) = (0.486, 0.00383, 0.25, 9.81);
    let slope = move |x: &[f64], u: &[f64]| {
        let push = (u[0] + u[1]) / mass;
        let turn = arm * (u[0] - u[1]) / inertia;
        vec![x[3], x[4], x[5], -push * x[2].sin(), push * x[2].cos() - gravity, turn]
    };
    let policy = |x: &[f64], _: f64| {
        let both = 0.486 * 9.81 / 2.0 - 2.685 * x[1] - 1.423 * x[4];
        let apart = 1.112 * x[0] + 0.748 * x[3] - 1.924 * x[2] - 0.179 * x[5];
        vec![both + apart, both - apart]
    };
    Truth {
        file: "planar_quadrotor.toml",
        period: 0.05,
        dynamics: Dynamics::Rk4(Box::new(slope)),
        bounds: vec![[0.0, 4.8]; 2],
        policy: Box::new(policy),
        target: |x, _| {
            let squares = x[0].powi(2) + x[1].powi(2) + 0.09 * (x[3].powi(2) + x[4].powi(2));
            0.2 - squares.sqrt()
        },
        constraint: |x, _| f64::min(x[1] + 1.0, 1.0 - x[2].abs()),
        goal: Goal::AtEnd,
    }
}

/// The body's axes in the world: turned about z, then y, then x.
fn attitude(roll: f64, pitch: f64, yaw: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), yaw)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), roll)
}

/// The derivatives of the angles, from those of the body about its axes: the inverse of what turns
/// about three axes, one after the other, come to.
fn angle_rates(roll: f64, pitch: f64, rates: Vector3<f64>) -> Vector3<f64> {
    let to_body = Matrix3::new(
        1.0,
        0.0,
        -pitch.sin(),
        0.0,
        roll.cos(),
        roll.sin() * pitch.cos(),
        0.0,
        -roll.sin(),
        roll.cos() * pitch.cos(),
    );
    to_body.try_inverse().expect("pitch below a quarter turn") * rates
}

/// A rigid body under a thrust along its own z and three torques.
fn rigid_body(x: &[f64], u: &[f64]) -> Vec<f64> {
    let (mass, drag) = (0.468, 0.25);
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.004856, 0.004856, 0.008801));
    let vector = |from: usize| Vector3::new(x[from], x[from + 1], x[from + 2]);
    let (velocity, rates) = (vector(3), vector(9));
    let thrust = attitude(x[6], x[7], x[8]) * Vector3::new(0.0, 0.0, u[0]);
    let acceleration = (thrust - drag * velocity) / mass - Vector3::new(0.0, 0.0, 9.81);
    let torque = Vector3::new(u[1], u[2], u[3]) - rates.cross(&(inertia * rates));
    let turn = inertia.try_inverse().expect("a diagonal") * torque;
    let angles = angle_rates(x[6], x[7], rates);
    let parts = [velocity, acceleration, angles, turn];
    parts.iter().flat_map(|part| part.iter().copied()).collect()
}

/// The policy in the frame that is turned by the yaw alone.
fn hover(x: &[f64], _: f64) -> Vec<f64> {
    let level = attitude(0.0, 0.0, x[8]).inverse();
    let place = level * Vector3::new(x[0], x[1], 0.0);
    let speed = level * Vector3::new(x[3], x[4], 0.0);
    let lean = |place: f64, speed: f64| 0.0736 * place + 0.0606 * speed;
    let right = |angle: f64, rate: f64| 0.248 * angle + 0.0505 * rate;
    vec![
        0.468 * 9.81 - 3.854 * x[2] - 2.473 * x[5],
        lean(place.y, speed.y) - right(x[6], x[9]),
        -lean(place.x, speed.x) - right(x[7], x[10]),
        -0.0454 * x[8] - 0.0317 * x[11],
    ]
}

/// The quadrotor in space.
pub(crate) fn quadrotor() -> Truth {
    Truth {
        file: "quadrotor.toml",
        period: 0.05,
        dynamics: Dynamics::Rk4(Box::new(rigid_body)),
        bounds: vec![[0.0, 9.2], [-0.3, 0.3], [-0.3, 0.3], [-0.1, 0.1]],
        policy: Box::new(hover),
        target: |x, _| {
            let place = Vector3::new(x[0], x[1], x[2]).norm_squared();
            let speed = Vector3::new(x[3], x[4], x[5]).norm_squared();
            0.3 - (place + 0.09 * speed).sqrt()
        },
        constraint: |x, _| (x[2] + 1.0).min(1.0 - x[6].abs()).min(1.0 - x[7].abs()),
        goal: Goal::ReachStay { by: 60 },
    }
}

/// The ego ahead of the opponent in the gate.
fn ahead(x: &[f64], _: f64) -> f64 {
    let ahead = (x[2] - x[8]).min(x[3] - x[9]);
    10.0 * ahead.min(0.3 - x[0].abs()).min(0.3 - x[4].abs())
}

/// The ego out of the opponent's cone, between the fences that lead to the gate.
fn apart(x: &[f64], _: f64) -> f64 {
    let cone = 0.2 * (1.0 + (x[10] - x[4]).max(0.0));
    let fences = 0.05 - x[2] - x[0].abs().max(x[4].abs());
    10.0 * ((x[0] - x[6]).hypot(x[2] - x[8]) - cone).min(fences)
}

/// Both drones: double integrators, the opponent under feedback.
fn two_drones(x: &[f64], u: &[f64]) -> Vec<f64> {
    let mut next = x.to_vec();
    for (axis, acceleration) in (0..3).map(|axis| (axis, 0.5 * u[axis])) {
        next[2 * axis] += 0.1 * x[2 * axis + 1];
        next[2 * axis + 1] += 0.1 * acceleration;
    }
    let toward = |place: f64, speed: f64| -9.1704 * place - 16.8205 * speed;
    let opponent = [toward(x[6], x[7]), 3.1127 * (0.3 - x[9]), toward(x[10], x[11])];
    for (axis, acceleration) in (0..3).zip(opponent) {
        next[6 + 2 * axis] += 0.1 * x[7 + 2 * axis];
        next[7 + 2 * axis] += 0.1 * acceleration;
    }
    next
}

/// The race under its trained policy.
pub(crate) fn drone_race() -> Truth {
    let network = network("policies/race_policy.safetensors");
    Truth {
        file: "drone_race.toml",
        period: 0.1,
        dynamics: Dynamics::Next(Box::new(two_drones)),
        bounds: vec![[-1.0, 1.0]; 3],
        policy: Box::new(move |x, _| network(x)),
        target: ahead,
        constraint: apart,
        goal: Goal::ReachAvoid,
    }
}
