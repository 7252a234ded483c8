//! Plans of one step whose optimum is known in closed form.

use crate::plants::{LINE, planned};

/// Temperature and noise of [`LINE`].
const LAMBDA: f64 = 0.01;
const SIGMA: f64 = 1.0;

/// Gaussian noise around a plan U, weighed by `exp(-(x + v - 1)^2 / lambda)`, is Gaussian again: its mean
/// is near the control that brings x to 1, and the error of a weighted mean falls with the root of the
/// effective samples.
#[test]
fn a_plan_of_one_step_is_the_closed_form() {
    for backend in ["cpu", "gpu"] {
        let planned = planned(LINE, &["--backend", backend]);
        let [x, u, effective] =
            ["x.x", "u.u", "effective_samples"].map(|name| planned.column(name).to_vec());
        assert_eq!((x.len(), u.len()), (5, 5), "four steps and the last state");
        let precision = 2.0 / LAMBDA + 1.0 / (SIGMA * SIGMA);
        let mut nominal = 0.0;
        for step in 0..4 {
            let best = (2.0 / LAMBDA * (1.0 - x[step]) + nominal / (SIGMA * SIGMA)) / precision;
            let error = 6.0 * (1.0 / precision).sqrt() / effective[step].sqrt();
            let off = (u[step] - best).abs();
            assert!(off <= error, "{backend}, step {step}: {} for {best}, within {error}", u[step]);
            // The last control is held, so that the next plan begins with it.
            nominal = u[step];
        }
        assert!((x[1] - 1.0).abs() < 0.05 && u[4].is_nan(), "{backend}: {x:?}");
        assert_eq!(planned.record["success"]["successes"], 1);
        assert_eq!(planned.record["runs"][0]["reached"], 1);
    }
}

/// The cost of a run is that of its end alone; the table has what an end at each state would cost.
#[test]
fn a_terminal_term_is_paid_once() {
    let planned = planned(LINE, &["--backend", "cpu"]);
    let (x, end) = (planned.column("x.x"), planned.column("terminal.place"));
    for (x, end) in x.iter().zip(end) {
        assert!((end - (x - 1.0).powi(2)).abs() < 1e-6, "{end} at {x}");
    }
    assert_eq!(planned.number("/cost/mean"), f64::from(end[4] as f32));
    assert_eq!(planned.number("/runs/0/terms/0"), f64::from(end[4] as f32));
    assert!(planned.column("cost")[..4].iter().all(|cost| *cost == 0.0), "no stage costs");
}

/// Without noise to speak of, a first plan from the policy is the policy.
#[test]
fn the_first_plan_may_be_the_policy_s() {
    let text = format!("{LINE}[policy]\nformula = {{ u = \"0.25 - 0.5 * x\" }}\n");
    let quiet = ["--set", "plan.sigma=1e-4", "--set", "plan.steps=1", "--backend", "cpu"];
    let first = |more: &[&str]| {
        let planned = planned(&text, &[&quiet[..], &["--set", "state.x=0.3"], more].concat());
        planned.column("u.u")[0]
    };
    let policy = first(&["--set", "plan.first_plan=policy"]);
    assert!((policy - 0.1).abs() < 1e-3, "{policy}");
    // The middle of the bounds.
    let middle = first(&[]);
    assert!(middle.abs() < 1e-3, "{middle}");
}

/// A goal that moves by half a metre a step, as a reference and as a formula of the step: the state after
/// a control is at the goal of that step, neither of the one before nor of the plan's own first.
#[test]
fn a_goal_that_moves_is_met_at_its_step() {
    let reference = LINE
        .replace("(x - 1)^2", "(x - goal)^2")
        .replace("[plan]", "[model.references]\ngoal = { formula = \"0.5 * step\" }\n[plan]");
    let formula = LINE.replace("(x - 1)^2", "(x - 0.5 * step)^2");
    for text in [reference, formula] {
        for backend in ["cpu", "gpu"] {
            let planned = planned(&text, &["--backend", backend]);
            for (step, x) in planned.column("x.x").iter().enumerate().skip(1) {
                let off = (x - 0.5 * step as f64).abs();
                assert!(off < 0.06, "{backend}, step {step}: {x}");
            }
        }
    }
}

/// Noise of a fifth of the way takes several improvements to the optimum.
#[test]
fn improvements_add_up_within_a_step() {
    let after = |iterations: &str| {
        let set = format!("plan.iterations={iterations}");
        let options = ["--set", "plan.sigma=0.1", "--set", "plan.steps=1", "--set", &set];
        let planned = planned(LINE, &[&options[..], &["--backend", "cpu"]].concat());
        (planned.column("x.x")[1] - 1.0).abs()
    };
    let [one, many] = ["1", "12"].map(after);
    assert!(one > 0.4 && many < 0.1, "{one} {many}");
}
