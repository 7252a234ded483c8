//! The plans of carried models against what any control can do.

use crate::plants::read;

/// Whether the double integrator at a start can reach the middle without leaving the corridor: it does
/// where braking as hard as it can keeps it inside, or crosses the target before; in f64.
fn feasible([mut position, mut velocity]: [f64; 2]) -> bool {
    let side = velocity.signum();
    loop {
        if position.abs() >= 1.0 {
            return false;
        }
        if position.abs() < 0.25 || velocity * side <= 0.0 {
            return true;
        }
        position += 0.1 * velocity;
        velocity -= side * velocity.abs().min(0.1);
    }
}

/// Every run from a start that is not lost succeeds, on both backends.
#[test]
fn the_double_integrator_wins_wherever_that_is_possible() {
    for backend in ["cpu", "gpu"] {
        let options = ["--set", "plan.runs=100", "--set", "plan.steps=60", "--backend", backend];
        let planned = read("configs/models/double_integrator.toml", &options);
        let [position, velocity] = ["x.position", "x.velocity"].map(|name| planned.column(name));
        let mut possible = 0;
        for run in 0..100 {
            let start = planned.rows(run)[0];
            let expected = feasible([position[start], velocity[start]]);
            let said = planned.record["runs"][run]["success"].as_bool().unwrap();
            assert_eq!(said, expected, "{backend}: {} {}", position[start], velocity[start]);
            possible += u64::from(expected);
        }
        assert_eq!(planned.record["success"]["successes"], possible);
        assert!((60..80).contains(&possible), "{possible}");
    }
}
