//! Recorded runs against loops in f64 that are written from the mathematics.

use crate::plants::{PENDULUM, planned};

/// The pendulum of [`PENDULUM`] after a step.
fn pendulum([angle, rate]: [f64; 2], torque: f64) -> [f64; 2] {
    let h = f64::from(0.05_f32);
    let damping = f64::from(0.2_f32);
    let push = torque - f64::from(9.81_f32) * angle.sin() - damping * rate;
    [angle + h * rate, rate + h * push]
}

/// What [`PENDULUM`] pays at a state: place, rate and effort at a stage, place at the end.
fn costs([angle, rate]: [f64; 2], torque: f64) -> [f64; 4] {
    let off = (angle - 1.0).powi(2);
    [10.0 * off, 0.2 * rate * rate, 0.002 * torque * torque, 50.0 * off]
}

/// The recorded controls lead from each recorded state to the next, and all the way from the start.
#[test]
fn recorded_controls_give_the_recorded_states() {
    let planned = planned(PENDULUM, &["--set", "plan.runs=4", "--backend", "cpu"]);
    let [angle, rate, torque, t] =
        ["x.angle", "x.rate", "u.torque", "t"].map(|name| planned.column(name));
    for run in 0..4 {
        let rows = planned.rows(run);
        assert_eq!(rows.len(), 41);
        let mut free = [angle[rows[0]], rate[rows[0]]];
        assert!(free.iter().all(|x| x.abs() <= 0.3), "in the box: {free:?}");
        for (step, pair) in rows.windows(2).enumerate() {
            let [from, to] = [pair[0], pair[1]];
            assert!(torque[from].abs() <= 12.0);
            assert!((t[from] - 0.05 * step as f64).abs() < 1e-9);
            let next = pendulum([angle[from], rate[from]], torque[from]);
            let off = (next[0] - angle[to]).abs().max((next[1] - rate[to]).abs());
            assert!(off < 1e-5, "run {run}, step {step}: {off}");
            free = pendulum(free, torque[from]);
        }
        let end = rows[40];
        let off = (free[0] - angle[end]).abs().max((free[1] - rate[end]).abs());
        assert!(off < 1e-4, "run {run}, all the way: {off}");
        assert!(torque[end].is_nan(), "no control at the last state");
    }
    // Runs are different runs.
    assert_ne!(planned.column("x.angle")[0], planned.column("x.angle")[41]);
}

/// Every term at every state, and the totals of the record.
#[test]
fn terms_are_those_of_the_text() {
    let planned = planned(PENDULUM, &["--set", "plan.runs=2", "--backend", "cpu"]);
    let names = ["stage.place", "stage.rate", "stage.effort", "terminal.place"];
    let columns = names.map(|name| planned.column(name));
    let [angle, rate, torque, cost] =
        ["x.angle", "x.rate", "u.torque", "cost"].map(|name| planned.column(name));
    for run in 0..2 {
        let rows = planned.rows(run);
        let mut totals = [0.0; 4];
        for (step, &row) in rows.iter().enumerate() {
            let last = step == 40;
            let u = if last { 0.0 } else { torque[row] };
            let expected = costs([angle[row], rate[row]], u);
            for (term, expected) in expected.iter().enumerate() {
                let found = columns[term][row];
                if last && term < 3 {
                    assert!(found.is_nan(), "no stage at the last state");
                    continue;
                }
                assert!(
                    (found - expected).abs() <= 1e-5 * expected.abs() + 1e-6,
                    "{found} {expected}"
                );
                totals[term] += if term < 3 || last { *expected } else { 0.0 };
            }
            if !last {
                let stage: f64 = expected[..3].iter().sum();
                assert!((cost[row] - stage).abs() < 1e-4 * stage + 1e-5);
            }
        }
        for (term, total) in totals.iter().enumerate() {
            let found = planned.number(&format!("/runs/{run}/terms/{term}"));
            assert!(
                (found - total).abs() < 1e-4 * total + 1e-5,
                "{}: {found} {total}",
                names[term]
            );
        }
        let found = planned.number(&format!("/runs/{run}/cost"));
        let total: f64 = totals.iter().sum();
        assert!((found - total).abs() < 1e-4 * total, "{found} {total}");
    }
    let mean = (planned.number("/runs/0/cost") + planned.number("/runs/1/cost")) / 2.0;
    assert!((planned.number("/cost/mean") - mean).abs() < 1e-9 * mean);
}

/// A reference that moves is followed at the step that is meant, and one from a file is held at its end.
#[test]
fn references_move_with_the_steps() {
    let moving = PENDULUM.replace("{ value = 1.0 }", "{ formula = \"0.1 * step\" }");
    let planned = planned(&moving, &["--set", "plan.steps=10", "--backend", "cpu"]);
    let (angle, place) = (planned.column("x.angle"), planned.column("stage.place"));
    for step in 0..10 {
        let expected = 10.0 * (angle[step] - 0.1 * step as f64).powi(2);
        assert!((place[step] - expected).abs() < 1e-4, "step {step}: {} {expected}", place[step]);
    }
}

/// A reference of three rows is held from its last one on, which is said.
#[test]
fn a_reference_that_ends_early_is_held() {
    let folder = crate::command::Folder::new();
    let goal = folder.path("goal.csv");
    std::fs::write(&goal, "0.25\n0.5\n0.75\n").unwrap();
    let text = PENDULUM.replace("{ value = 1.0 }", &format!("{{ file = \"{goal}\" }}"));
    let planned = planned(&text, &["--set", "plan.steps=6", "--backend", "cpu"]);
    let (angle, place) = (planned.column("x.angle"), planned.column("stage.place"));
    for (step, goal) in [0.25, 0.5, 0.75, 0.75, 0.75, 0.75].into_iter().enumerate() {
        let expected = 10.0 * (angle[step] - goal).powi(2);
        assert!((place[step] - expected).abs() < 1e-4, "step {step}: {} {expected}", place[step]);
    }
    let notes = planned.notes();
    assert!(notes.contains("`goal` has 3 rows, and plans look up to step 20"), "{notes}");
}
