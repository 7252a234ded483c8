//! What moves on the ground: a mass on a line, a Dubins car, a bicycle, a differential drive.

use super::truth::{Dynamics, Goal, Truth};

/// The unit mass that accelerates toward the origin.
pub(crate) fn double_integrator() -> Truth {
    Truth {
        file: "double_integrator.toml",
        period: 0.1,
        dynamics: Dynamics::Euler(Box::new(|x, u| vec![x[1], u[0]])),
        bounds: vec![[-1.0, 1.0]],
        policy: Box::new(|x, _| vec![if x[0] < 0.0 { 1.0 } else { -1.0 }]),
        target: |x, _| 0.25 - x[0].abs(),
        constraint: |x, _| 1.0 - x[0].abs(),
        goal: Goal::ReachAvoid,
    }
}

/// The car of unit speed; it turns by the sine of the angle to the way that it wants.
pub(crate) fn dubins() -> Truth {
    let policy = |x: &[f64], _: f64| {
        let side = if x[1] < 0.0 { -1.0 } else { 1.0 };
        let way = [2.0 - x[0], 8.0 * (1.3 - x[0].hypot(x[1])).max(0.0) * side - x[1]];
        let along = [x[2].cos(), x[2].sin()];
        vec![3.0 * (along[0] * way[1] - along[1] * way[0]) / way[0].hypot(way[1])]
    };
    Truth {
        file: "dubins.toml",
        period: 0.1,
        dynamics: Dynamics::Euler(Box::new(|x, u| vec![x[2].cos(), x[2].sin(), u[0]])),
        bounds: vec![[-1.0, 1.0]],
        policy: Box::new(policy),
        target: |x, _| 0.5 - (x[0] - 2.0).hypot(x[1]),
        constraint: |x, _| x[0].hypot(x[1]) - 0.5,
        goal: Goal::ReachAvoid,
    }
}

/// Where the slower car is.
fn obstacle(t: f64) -> [f64; 2] {
    [25.0 + 6.0 * t, 0.3 * (0.8 * t).sin()]
}

/// The bicycle about its centre of mass, without a slip angle: the point at the rear axle moves along the
/// heading, and the centre by `rear` times the yaw rate across it.
pub(crate) fn bicycle() -> Truth {
    let slope = |x: &[f64], u: &[f64]| {
        let [_, _, heading, speed] = x else { panic!("four states") };
        let across = 1.738 / (1.105 + 1.738) * u[0].tan();
        // The speed of the centre is that along the heading, drawn out by the part across it.
        let along = speed / 1_f64.hypot(across);
        let (sine, cosine) = heading.sin_cos();
        let yaw_rate = along * across / 1.738;
        vec![along * (cosine - across * sine), along * (sine + across * cosine), yaw_rate, u[1]]
    };
    let policy = |x: &[f64], t: f64| {
        let behind = (x[0] - obstacle(t)[0] + 5.0) / 14.0;
        let lane = 3.5 * (-behind * behind).exp();
        vec![0.08 * (lane - x[1]) - 0.9 * x[2], 12.0 - x[3]]
    };
    Truth {
        file: "bicycle.toml",
        period: 0.1,
        dynamics: Dynamics::Rk4(Box::new(slope)),
        bounds: vec![[-0.4, 0.4], [-4.0, 2.0]],
        policy: Box::new(policy),
        target: |x, t| f64::min(x[0] - obstacle(t)[0] - 10.0, 0.8 - x[1].abs()),
        constraint: |x, t| {
            let [front, side] = obstacle(t);
            let clear = (x[0] - front).hypot(x[1] - side) - 2.6;
            clear.min(x[1] + 1.5).min(5.0 - x[1])
        },
        goal: Goal::ReachAvoid,
    }
}

/// Centres and radii of the pillars, m.
const PILLARS: [[f64; 3]; 3] = [[2.6, 1.3, 0.3], [2.8, 2.9, 0.3], [4.2, 2.0, 0.35]];

/// The unit vector to the dock, bent by the pillars.
fn way([x, y]: [f64; 2]) -> [f64; 2] {
    let (dx, dy) = (5.3 - x, 2.0 - y);
    let mut way = [dx / dx.hypot(dy), dy / dx.hypot(dy)];
    for ([a, b, radius], steep) in PILLARS.into_iter().zip([6.0, 6.0, 4.0]) {
        let distance = (x - a).hypot(y - b);
        let push = 2.0 * (-steep * (distance - radius - 0.22)).exp() / distance;
        way = [way[0] + push * (x - a), way[1] + push * (y - b)];
        if a == 4.2 {
            way[1] += 0.4 * push * if y < 2.0 { -1.0 } else { 1.0 };
        }
    }
    way
}

/// The drive whose wheels roll without slip.
pub(crate) fn diff_drive() -> Truth {
    let (wheel, track) = (0.033, 0.287);
    let slope = move |x: &[f64], u: &[f64]| {
        let [left, right] = [wheel * u[0], wheel * u[1]];
        let speed = 0.5 * (left + right);
        vec![speed * x[2].cos(), speed * x[2].sin(), (right - left) / track]
    };
    let policy = move |x: &[f64], _: f64| {
        let want = way([x[0], x[1]]);
        let error = want[1].atan2(want[0]) - x[2];
        let (speed, turn) = (0.25 * error.cos().max(0.0), 2.0 * error.sin().atan2(error.cos()));
        let half = 0.5 * track * turn.clamp(-1.4, 1.4);
        vec![(speed - half) / wheel, (speed + half) / wheel]
    };
    Truth {
        file: "diff_drive.toml",
        period: 0.1,
        dynamics: Dynamics::Rk4(Box::new(slope)),
        bounds: vec![[-7.8, 7.8]; 2],
        policy: Box::new(policy),
        target: |x, _| 0.3 - (x[0] - 5.3).hypot(x[1] - 2.0),
        constraint: |x, _| {
            let room = x[0].min(6.0 - x[0]).min(x[1]).min(4.0 - x[1]);
            let pillar = |[a, b, radius]: [f64; 3]| (x[0] - a).hypot(x[1] - b) - radius;
            PILLARS.map(pillar).into_iter().fold(room, f64::min) - 0.22
        },
        goal: Goal::ReachAvoid,
    }
}
