//! The same seed gives the same runs, on any number of threads.

use crate::command::{Folder, reachcast};
use crate::plants::{PENDULUM, planned, written};

/// The runs of a closed loop of a few steps.
fn bytes(more: &[&str]) -> Vec<u8> {
    let few = ["--set", "plan.runs=3", "--set", "plan.steps=8", "--backend", "cpu"];
    planned(PENDULUM, &[&few[..], more].concat()).bytes
}

#[test]
fn a_seed_has_its_runs_on_any_threads() {
    let one = bytes(&["--threads", "1"]);
    assert_eq!(bytes(&["--threads", "1"]), one);
    assert_eq!(bytes(&["--threads", "3"]), one);
    assert_ne!(bytes(&["--seed", "2"]), one);
}

/// A run is the same whatever is flown beside it: its noise follows from seed, run and step.
#[test]
fn a_run_does_not_depend_on_the_others() {
    let flown = |runs: &str| {
        let runs = format!("plan.runs={runs}");
        planned(PENDULUM, &["--set", &runs, "--set", "plan.steps=6", "--backend", "cpu"])
    };
    let (two, five) = (flown("2"), flown("5"));
    for name in ["x.angle", "x.rate", "u.torque"] {
        let of = |planned: &crate::plants::Planned| planned.column(name)[..14].to_vec();
        let same = of(&two).iter().zip(of(&five)).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{name}");
    }
    // Runs from the same start have noise of their own.
    let point = ["box.angle=[0.1, 0.1000001]", "box.rate=[0, 0]"];
    let sets = point.map(|set| ["--set", set]).concat();
    let near = [&sets[..], &["--set", "plan.runs=2", "--set", "plan.steps=1", "--backend", "cpu"]];
    let near = planned(PENDULUM, &near.concat());
    let torque = near.column("u.torque");
    assert!((torque[0] - torque[2]).abs() > 1e-3, "{torque:?}");
}

/// A folder keeps the runs that it holds, unless it is told.
#[test]
fn a_folder_is_of_one_configuration() {
    let folder = Folder::new();
    let (config, out) = (written(&folder, PENDULUM), folder.path("out"));
    let short = ["plan", &config, "--out", &out, "--set", "plan.steps=2", "--backend", "cpu", "-q"];
    let run = |more: &[&str]| reachcast(&[&short[..], more].concat());
    assert_eq!(run(&[]).0, Some(0));
    assert_eq!(run(&[]).0, Some(0), "the same again");
    let (code, _, message) = run(&["--seed", "5"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("--overwrite") && message.contains("plans in closed loop"),
        "{message}"
    );
    assert_eq!(run(&["--seed", "5", "--overwrite"]).0, Some(0));
    let mut names: Vec<String> = std::fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        ["experiment.json", "plan.json", "report.html", "steps.csv", "trajectories.npz"]
    );
}
