//! What is filled: two tanks in a row.

use super::truth::{Dynamics, Goal, Truth};

/// Speed of what runs out below `height` of water, cm/s.
fn outflow(height: f64) -> f64 {
    (2.0 * 981.0 * height).sqrt()
}

/// Two tanks of 154 cm2, a pipe of 0.6 cm2 between them and a hole of 0.5 cm2 below the second.
pub(crate) fn two_tanks() -> Truth {
    let slope = |x: &[f64], u: &[f64]| {
        let ahead = x[0] - x[1];
        let across = 0.6 * outflow(ahead.abs()).copysign(ahead);
        let drained = 0.5 * outflow(x[1].max(0.0));
        vec![(u[0] - across) / 154.0, (across - drained) / 154.0]
    };
    // At rest as much comes as goes: 12 cm drain through the hole, and 25 / 36 of them drive that through the pipe.
    let policy = |x: &[f64], _: f64| {
        vec![0.5 * outflow(12.0) + 20.0 * (12.0 * 61.0 / 36.0 - x[0]) + 20.0 * (12.0 - x[1])]
    };
    Truth {
        file: "two_tanks.toml",
        period: 2.0,
        dynamics: Dynamics::Rk4(Box::new(slope)),
        bounds: vec![[0.0, 100.0]],
        policy: Box::new(policy),
        target: |x, _| 1.0 - (x[1] - 12.0).abs(),
        constraint: |x, _| (30.0 - x[0]).min(25.0 - x[1]),
        goal: Goal::ReachStay { by: 45 },
    }
}
