//! What is balanced: pendulum, learned pendulum, cart-pole.

use std::f64::consts::PI;

use super::network::network;
use super::truth::{Dynamics, Goal, Truth, none};

/// An angle between half a turn to either side.
fn lean(angle: f64) -> f64 {
    angle - 2.0 * PI * (angle / (2.0 * PI)).round()
}

/// How far the rod is from upright at rest.
fn upright(x: &[f64], _: f64) -> f64 {
    0.3 - lean(x[0]).hypot(0.3 * x[1])
}

/// From 0 to 1 through a half at 0.
fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// A share of the first, and the rest of the second.
fn mixed(share: f64, first: f64, second: f64) -> f64 {
    share * first + (1.0 - share) * second
}

/// A rod of 1 kg and 1 m on a hinge, m l^2 / 3 about it.
pub(crate) fn pendulum() -> Truth {
    let (mass, length, gravity) = (1.0, 1.0, 9.81);
    let inertia = mass * length * length / 3.0;
    let weight = mass * gravity * length / 2.0;
    let slope = move |x: &[f64], u: &[f64]| vec![x[1], (weight * x[0].sin() + u[0]) / inertia];
    let policy = move |x: &[f64], _: f64| {
        let held = -9.616 * lean(x[0]) - 2.548 * x[1];
        let energy = weight * x[0].cos() + inertia * x[1] * x[1] / 2.0;
        let pumped = ((weight - energy) * x[1]).clamp(-2.0, 2.0);
        vec![mixed(logistic(10.0 * (2.0 - held.abs())), held, pumped)]
    };
    Truth {
        file: "pendulum.toml",
        period: 0.05,
        dynamics: Dynamics::Rk4(Box::new(slope)),
        bounds: vec![[-2.0, 2.0]],
        policy: Box::new(policy),
        target: upright,
        constraint: |x, _| 8.0 - x[1].abs(),
        goal: Goal::ReachStay { by: 80 },
    }
}

/// Angular acceleration of the pendulum that the network was fitted to, rad/s^2.
fn friction(angle: f64, rate: f64, torque: f64) -> f64 {
    14.715 * angle.sin() + 3.0 * torque - 0.3 * rate - 0.6 * (20.0 * rate).tanh()
}

/// Angle and rate 0.05 s later, in many short steps of Heun.
pub(crate) fn with_friction([mut angle, mut rate]: [f64; 2], torque: f64) -> [f64; 2] {
    let h = 0.05 / 2000.0;
    for _ in 0..2000 {
        let first = friction(angle, rate, torque);
        let second = friction(angle + h * rate, rate + h * first, torque);
        angle += h * (rate + h * first / 2.0);
        rate += h * (first + second) / 2.0;
    }
    [angle, rate]
}

/// The learned pendulum: a network says how angle and rate grow in a step.
pub(crate) fn learned_pendulum() -> Truth {
    let network = network("models/learned_pendulum.safetensors");
    let next = move |x: &[f64], u: &[f64]| {
        let grown = network(&[x[0].sin(), x[0].cos(), x[1], u[0]]);
        vec![x[0] + grown[0], x[1] + grown[1]]
    };
    let policy = |x: &[f64], _: f64| {
        let lacks = 4.905 - (4.905 * x[0].cos() + x[1] * x[1] / 6.0);
        let near = logistic(20.0 * (0.6 - lean(x[0]).hypot(0.3 * x[1])));
        let pumped = ((lacks + 0.5) * x[1]).clamp(-2.0, 2.0);
        vec![mixed(near, -9.6 * lean(x[0]) - 2.5 * x[1], pumped)]
    };
    Truth {
        file: "learned_pendulum.toml",
        period: 0.05,
        dynamics: Dynamics::Next(Box::new(next)),
        bounds: vec![[-2.0, 2.0]],
        policy: Box::new(policy),
        target: upright,
        constraint: none,
        goal: Goal::Reach,
    }
}

/// Cart of 1 kg, pole of 0.1 kg and 1 m: the two equations of motion, solved as a linear system.
pub(crate) fn cart_pole() -> Truth {
    let (cart, pole, half) = (1.0, 0.1, 0.5);
    let slope = move |x: &[f64], u: &[f64]| {
        let [_, v, angle, rate] = x else { panic!("four states") };
        // (M + m) a + m l cos(angle) alpha = F + m l rate^2 sin(angle)
        // m l cos(angle) a + 4/3 m l^2 alpha = m g l sin(angle)
        let coupling = pole * half * angle.cos();
        let [total, swing] = [cart + pole, 4.0 / 3.0 * pole * half * half];
        let push = u[0] + pole * half * rate * rate * angle.sin();
        let fall = pole * 9.81 * half * angle.sin();
        let determinant = total * swing - coupling * coupling;
        let pull = (push * swing - coupling * fall) / determinant;
        let turn = (total * fall - coupling * push) / determinant;
        vec![*v, pull, *rate, turn]
    };
    let gains = [3.915, 6.137, 48.377, 12.524];
    Truth {
        file: "cart_pole.toml",
        period: 0.02,
        dynamics: Dynamics::Rk4(Box::new(slope)),
        bounds: vec![[-10.0, 10.0]],
        policy: Box::new(move |x, _| vec![x.iter().zip(gains).map(|(x, gain)| x * gain).sum()]),
        target: none,
        constraint: |x, _| f64::min(0.3 - x[2].abs(), 2.0 - x[0].abs()),
        goal: Goal::Avoid,
    }
}
