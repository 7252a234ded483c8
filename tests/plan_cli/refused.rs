//! What `plan` refuses, with the remedy.

use crate::command::{Folder, refused};
use crate::plants::{LINE, PENDULUM, written};

/// `text` with `more` options is refused in these words, and nothing is written.
fn says(text: &str, more: &[&str], words: &[&str]) {
    let folder = Folder::new();
    let (config, out) = (written(&folder, text), folder.path("out"));
    let arguments = [&["plan", &config, "--out", &out, "--backend", "cpu"], more].concat();
    refused(&arguments, words);
    assert_eq!(folder.entries(), ["model.toml"], "{words:?}");
}

#[test]
fn bounds_that_no_plan_can_use() {
    let open = LINE.replace("[-4.0, 4.0]", "[-inf, 4.0]");
    says(
        &open,
        &[],
        &["model.toml:7", "model.controls.u.bounds", "is open", "[-10.0, 10.0]", "plan.sigma"],
    );
    let fixed = LINE.replace("[-4.0, 4.0]", "[1.0, 1.0]");
    says(&fixed, &[], &["model.controls", "nothing to plan"]);
}

#[test]
fn models_without_costs() {
    let (before, rest) = LINE.split_once("[model.costs]").unwrap();
    let plain =
        format!("{before}{}", rest.split_once("[plan]").unwrap().1.replacen("", "[plan]", 1));
    says(&plain, &[], &["model.costs", "stage.effort = {", "\"u^2\"", "\"(x - 1)^2\""]);
    let folder = Folder::new();
    let out = folder.path("out");
    let carried = ["plan", "configs/double_integrator.toml", "--out", &out];
    refused(&carried, &["comes with the program", "configs/models/double_integrator.toml"]);
}

#[test]
fn costs_that_are_never_a_number() {
    let lost = LINE.replace("(x - 1)^2", "log(0 - 1 - x^2)");
    says(
        &lost,
        &[],
        &["no run takes a step", "cost of every sample", "the term `terminal.place` is NaN", "x 0"],
    );
    // It is there at first, and gone three steps on.
    let reference = PENDULUM.replace("{ value = 1.0 }", "{ formula = \"log(2.5 - step)\" }");
    says(&reference, &[], &["no run takes a step", "reference `goal` is NaN at stage 3"]);
    let cost = PENDULUM.replace("torque^2", "log(0.5 - step - torque^2 * 0)");
    says(&cost, &[], &["no run takes a step", "the term `stage.effort` is NaN at stage 1"]);
}

#[test]
fn keys_of_plans() {
    let cases: [(&str, &[&str]); 8] = [
        ("plan.runs=0", &["plan.runs"]),
        ("plan.steps=0", &["plan.steps", "not within 1..=10000"]),
        ("plan.horizon=513", &["plan.horizon", "1..=512"]),
        ("plan.samples=0", &["plan.samples"]),
        ("plan.sigma=[1.0, 2.0]", &["plan.sigma", "2 numbers; expected 1", "torque"]),
        ("plan.sample=5", &["unknown key `plan.sample`", "plan.samples"]),
        ("plan.temperature=-1", &["plan.temperature"]),
        ("plan.first_plan=zero", &["zero"]),
    ];
    for (set, words) in cases {
        says(PENDULUM, &["--set", set], words);
    }
    let (no_policy, _) = PENDULUM.split_once("[policy]").unwrap();
    says(no_policy, &["--set", "plan.first_plan=policy"], &["no policy; give `file`"]);
    let late = PENDULUM.replace("kind = \"reach-avoid\"", "kind = \"reach-avoid\"\nfrom = 30");
    says(&late, &["--set", "plan.steps=20"], &["step 30 lies beyond the horizon of 20 steps"]);
}
