//! Runs that cannot go on: counted as what they are, and said with term, state and step.

use crate::plants::{LINE, PENDULUM, planned};

/// Where a term stops to be a number, a run stops; the others go on.
#[test]
fn a_run_whose_costs_are_lost_stops_alone() {
    // No number where the state is above 0.25, from where no control within its bounds leads away.
    let text = LINE
        .replace("bounds = [-4.0, 4.0]", "bounds = [-0.001, 0.001]")
        .replace("formula = \"(x - 1)^2\"", "formula = \"log(0.25 - x)\"");
    let planned = planned(&text, &["--set", "plan.runs=40", "--backend", "cpu"]);
    let starts = planned.record["runs"].as_array().unwrap();
    let mut stopped = 0;
    for run in starts {
        let start = run["start"][0].as_f64().unwrap();
        let expected = start > 0.252;
        if (start - 0.25).abs() > 0.01 {
            assert_eq!(run["stopped"].is_object(), expected, "from {start}: {run}");
        }
        if expected {
            assert_eq!(run["success"], false);
            assert_eq!(run["stopped"]["step"], 0);
            let reason = run["stopped"]["reason"].as_str().unwrap();
            assert!(reason.contains("the term `terminal.place` is NaN"), "{reason}");
            stopped += 1;
        }
    }
    assert!(stopped > 3 && stopped < 20, "{stopped} of 40");
    assert!(planned.notes().contains("of 40 runs stopped early"), "{}", planned.notes());
}

/// A state that is not finite ends a run, which has failed.
#[test]
fn a_state_that_is_not_finite_ends_a_run() {
    let text = LINE.replace("x = \"x + u\"", "x = \"if(step < 2, x + u, log(x - 100))\"");
    let planned = planned(&text, &["--set", "model.task.target=0 - 1", "--backend", "cpu"]);
    let run = &planned.record["runs"][0];
    assert_eq!((run["success"].as_bool(), run["stopped"]["step"].as_u64()), (Some(false), Some(2)));
    let reason = run["stopped"]["reason"].as_str().unwrap();
    assert!(reason.contains("x = NaN"), "{reason}");
}

/// What is unusual and works is said.
#[test]
fn notes_say_what_is_unusual() {
    let fixed = PENDULUM.replace(
        "torque = { unit = \"N m\", bounds = [-12.0, 12.0] }",
        "torque = { unit = \"N m\", bounds = [-12.0, 12.0] }\nspare = { bounds = [0.5, 0.5] }",
    );
    let fixed = fixed
        .replace("[policy]\nformula = { torque", "[policy]\nformula = { spare = \"0\", torque");
    let short = ["--set", "plan.steps=2", "--backend", "cpu"];
    let notes = planned(&fixed, &short).notes();
    assert!(notes.contains("`spare` stays at 0.5"), "{notes}");
    let hot = planned(PENDULUM, &[&short[..], &["--set", "plan.temperature=1e6"]].concat()).notes();
    assert!(hot.contains("lower it"), "{hot}");
    let cold =
        planned(PENDULUM, &[&short[..], &["--set", "plan.temperature=1e-6"]].concat()).notes();
    assert!(cold.contains("raise it"), "{cold}");
    let several = planned(PENDULUM, &[&short[..], &["--set", "plan.runs=2"]].concat()).notes();
    assert!(several.contains("plans of 2 runs are improved together"), "{several}");
}
