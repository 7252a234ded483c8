//! `train` from outside: its files, what it refuses, and the program that was built without it.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, refused};

/// A training of a few seconds at most.
#[cfg(feature = "train")]
const CONFIG: &str = "configs/train/double_integrator.toml";

/// Without tensors the command says how to get them, before it touches anything.
#[cfg(not(feature = "train"))]
#[test]
fn a_program_without_training_says_how_to_build_it() {
    let folder = Folder::new();
    let out = folder.path("out");
    let config = "configs/train/race.toml";
    refused(&["train", config, "--out", &out], &["built without training", "--features train"]);
    assert!(folder.entries().is_empty());
    // Wrong settings are refused first.
    refused(&["train", config, "--set", "train.interval=0"], &["train.interval"]);
}

#[cfg(feature = "train")]
#[test]
fn a_policy_a_value_and_an_action_value_with_their_files() {
    let folder = Folder::new();
    for (method, name, widths, scores) in [
        ("analytic", "policy", "[2,32,32,1]", 1),
        ("value", "value", "[2,32,32,1]", 2),
        ("action-value", "action_value", "[3,32,32,1]", 2),
    ] {
        let out = folder.path(name);
        let policy = ["--set", "policy.formula=bang-bang"];
        let few = format!("train.{}.iterations=30", if scores == 1 { "analytic" } else { "value" });
        let few = ["--set", few.as_str(), "--set", "train.interval=10", "--out", &out];
        let run = ["train", CONFIG, "--method", method];
        let policy = if scores == 1 { &[][..] } else { &policy[..] };
        let arguments = [&run[..], &few[..], policy, &["--seed", "7"]].concat();
        let record = crate::command::document(&arguments);
        assert_eq!(record["networks"][0]["widths"].to_string(), widths, "{method}");
        assert_eq!(record["scores"].as_array().unwrap().len(), scores);
        assert_eq!(record["curve"].as_array().unwrap().len(), 4);
        assert_eq!(record["origin"]["provenance"]["seed"], 7);
        let read = |file: &str| std::fs::read_to_string(format!("{out}/{file}")).unwrap();
        assert_eq!(serde_json::from_str::<serde_json::Value>(&read("train.json")).unwrap(), record);
        assert_eq!(read("curve.csv").lines().count(), 5);
        assert!(read("report.html").contains("Learning curves"));
        let file = format!("{out}/{name}.safetensors");
        let inspected = crate::command::document(&["policy", "inspect", &file]);
        assert_eq!(inspected["digest"], record["networks"][0]["sha256"], "{inspected}");
        // A second run has nothing left to do and says the same; another one is refused.
        assert_eq!(crate::command::document(&arguments), record);
        let other = [&run[..], &few[..], policy, &["--seed", "8"]].concat();
        refused(&other, &["another experiment"]);
    }
}

#[cfg(feature = "train")]
#[test]
fn what_is_refused() {
    let folder = Folder::new();
    let out = folder.path("out");
    let run = |more: &[&str], words: &[&str]| {
        refused(&[&["train", CONFIG, "--out", &out], more].concat(), words);
        assert!(folder.entries().is_empty(), "{more:?}");
    };
    run(&["--set", "train.analytic.batch=0"], &["train.analytic.batch", "1..="]);
    let long = ["--set", "train.analytic.batch=30000", "--set", "rollout.horizon=9000"];
    run(&long, &["train.analytic.batch", "30000 rollouts of 9001 states", "smaller batch"]);
    run(&["--set", "train.analytic.bacth=9"], &["unknown key", "`train.analytic.batch`"]);
    run(&["--set", "train.method=guess"], &["guess", "analytic"]);
    run(&["--set", "train.starts=[{ share = 1, boks = {} }]"], &["boks"]);
    run(
        &["--set", "train.starts=[{ share = 1, box = { place = [0, 1] } }]"],
        &["no state `place`"],
    );
    run(&["--set", "train.analytic.scale=nan"], &["train.analytic.scale", "finite"]);
    // A value is of a policy.
    run(&["--method", "value"], &["policy", "formula"]);
    run(&["--method", "guess"], &["guess"]);
}
