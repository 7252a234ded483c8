//! What `sweep` refuses, before anything is written.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::sweep_run;
use std::path::Path;

use crate::sweep_run::{Folder, command, done, message_of, sweep, sweep_of};

/// Expects exit code 2, nothing on standard output, no folder, and `words` in the message.
fn refused_by(config: &str, arguments: &[&str], words: &[&str]) {
    let folder = Folder::new();
    let out = folder.path("out");
    let mut command = match config {
        sweep_run::CONFIG if !arguments.contains(&"certificate") => command(&out, arguments),
        _ => sweep_of(config, &out, arguments),
    };
    let output = command.args(["--backend", "cpu", "--json"]).output().unwrap();
    let message = message_of(&output, 2);
    assert!(output.stdout.is_empty() && !out.exists(), "{arguments:?}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: no `{word}` in: {message}");
    }
}

fn refused(arguments: &[&str], words: &[&str]) {
    refused_by(sweep_run::CONFIG, arguments, words);
}

#[test]
fn empty_grids() {
    refused(&[], &["nothing varies", "--samples 64,256,1024"]);
    refused(&["--samples", ""], &["--samples", "no value", "64,256,1024"]);
    refused(&["--samples", " , "], &["--samples", "no value"]);
    refused(&["--vary", "race.mppi.cost.speed="], &["--vary", "no value"]);
    refused(&["--controllers", "mppi"], &["nothing varies"]);
    refused(&["--of", "certificate"], &["nothing varies", "--epsilon"]);
}

#[test]
fn values_that_are_none() {
    refused(&["--samples", "64,many"], &["--samples", "`many`", "a whole number"]);
    refused(&["--samples", "64,1.5"], &["`1.5`", "a whole number"]);
    refused(&["--samples", "-4,8"], &["--samples", "`-4`"]);
    refused(&["--temperature", "1,hot"], &["--temperature", "`hot`", "a number"]);
    refused(&["--temperature", "1,nan"], &["`nan`", "a number"]);
    refused(&["--temperature", "1,inf"], &["`inf`", "a number"]);
    refused(&["--sigma", "0.1,[0.1,x]"], &["--sigma", "`[0.1,x]`"]);
    refused(&["--noise", "pink"], &["--noise", "`pink`", "colored:TIME"]);
    refused(&["--noise", "colored:slow"], &["`colored:slow`"]);
    refused(&["--samples", "8,8"], &["`8` is there twice"]);
    refused(&["--controllers", "mppi,mpi"], &["--controllers", "`mpi`", "did you mean `mppi`"]);
    refused(
        &["--of", "certificate", "--bound", "exact,best"],
        &["--bound", "`best`", "fixed-shape"],
    );
    refused(&["--of", "certificate", "--count", "few"], &["--count", "`few`", "simple"]);
}

#[test]
fn values_out_of_range_are_refused_before_the_first_race() {
    refused(&["--samples", "8,0"], &["race.mppi.samples", "0 is not within"]);
    refused(&["--horizon", "5,513"], &["race.mppi.horizon", "513"]);
    refused(&["--temperature", "1,0"], &["race.mppi.temperature"]);
    refused(&["--sigma", "0.4,-1"], &["race.mppi.sigma", "-1"]);
    refused(&["--noise", "independent,spline:900"], &["race.mppi", "900"]);
    refused(&["--iterations", "1,0"], &["race.mppi.iterations"]);
    refused(&["--vary", "race.steps=5,0"], &["race.steps"]);
    refused(&["--controllers", "mppi,ppo-cbf", "--samples", "8,16"], &["race.networks.ppo"]);
    refused(&["--of", "certificate", "--epsilon", "0.1,2"], &["deviation.epsilon", "2"]);
    refused(
        &["--of", "certificate", "--count", "config", "--epsilon", "0.1,0.001"],
        &["159 scenarios", "need at least"],
    );
}

#[test]
fn keys_that_there_are_not() {
    let nearest = ["--vary race.mppi.cost.spede=1,2", "unknown key", "`race.mppi.cost.speed`"];
    refused(&["--vary", "race.mppi.cost.spede=1,2"], &nearest);
    refused(&["--vary", "speed"], &["--vary speed", "section.key=V1,V2"]);
    refused(&["--vary", "race.mppi.cost.speed=fast,1"], &["\"fast\"", "race.mppi.cost"]);
    refused(&["--vary", "seed=1,2"], &["--vary seed", "same starts and seeds"]);
    refused(&["--vary", "race.starts=a,b"], &["same starts"]);
    refused(
        &["--horizon", "5,10", "--vary", "race.mppi.horizon=5,10"],
        &["--vary", "`race.mppi.horizon` is set by another axis"],
    );
    refused(&["--vary", "race.steps=5,6", "--vary", "race.steps=7,8"], &["is an axis of --vary"]);
}

#[test]
fn options_of_the_other_kind() {
    refused(&["--epsilon", "0.1,0.2"], &["--epsilon", "--of certificate"]);
    let of = ["--of", "certificate", "--radius", "0.1,0.2"];
    for (option, value) in [
        ("--samples", "8,16"),
        ("--controllers", "mppi"),
        ("--starts", "3"),
        ("--noise-seeds", "2"),
        ("--noise", "independent"),
    ] {
        refused(&[&of[..], &[option, value]].concat(), &[option, "--of race"]);
    }
    let key = ["--vary", "deviation.scenarios=200,300"];
    refused(&[&of[..], &key[..]].concat(), &["deviation.scenarios", "--count config"]);
    let integrator = "configs/double_integrator.toml";
    refused_by(integrator, &["--samples", "8,16"], &["drone-race", "--of certificate"]);
    refused_by("configs/none.toml", &["--samples", "8,16"], &["configs/none.toml"]);
}

#[test]
fn too_many_points() {
    let many = (1..=200).map(|k| k.to_string()).collect::<Vec<_>>().join(",");
    refused(&["--samples", &many, "--horizon", &many], &["40000 points", "at most 10000"]);
}

/// Expects that the sweep refuses what is in `out`.
fn occupied(out: &Path, config: &str, arguments: &[&str], words: &[&str]) {
    let mut command = match config {
        sweep_run::CONFIG => command(out, arguments),
        _ => sweep_of(config, out, arguments),
    };
    let message = message_of(&command.args(["--backend", "cpu"]).output().unwrap(), 2);
    for word in words {
        assert!(message.contains(word), "{arguments:?}: no `{word}` in: {message}");
    }
}

#[test]
fn a_folder_with_something_else_in_it() {
    let folder = Folder::new();
    let out = folder.path("out");
    sweep(&out, &["--samples", "8,16"]);
    let table = std::fs::read(out.join("sweep.csv")).unwrap();
    let words = ["experiment.json", "another experiment", "--out", "remove"];
    let refuse = |arguments: &[&str]| occupied(&out, sweep_run::CONFIG, arguments, &words);
    refuse(&["--horizon", "5,10"]);
    refuse(&["--samples", "8,16", "--seed", "2"]);
    refuse(&["--samples", "8,16", "--noise-seeds", "2"]);
    refuse(&["--samples", "8,16", "--set", "race.mppi.horizon=5"]);
    let integrator = "configs/double_integrator.toml";
    occupied(&out, integrator, &["--of", "certificate", "--radius", "0.1,0.2"], &words);
    assert_eq!(std::fs::read(out.join("sweep.csv")).unwrap(), table);

    let other = folder.path("certificates");
    let of = ["--of", "certificate", "--set", "global.draws=500", "--radius", "0.01,0.02"];
    done(integrator, &other, &of);
    occupied(&other, sweep_run::CONFIG, &["--samples", "8,16"], &words);

    let page = folder.path("page");
    std::fs::create_dir(&page).unwrap();
    std::fs::write(page.join("report.html"), "a report").unwrap();
    let words = ["report.html", "something else", "--out"];
    occupied(&page, sweep_run::CONFIG, &["--samples", "8,16"], &words);
    assert_eq!(std::fs::read(page.join("report.html")).unwrap(), b"a report");
}

#[test]
fn a_folder_that_cannot_be_written_to() {
    let folder = Folder::new();
    let file = folder.path("file");
    std::fs::write(&file, "not a folder").unwrap();
    let output =
        command(&file, &["--samples", "8,16"]).args(["--backend", "cpu"]).output().unwrap();
    let message = message_of(&output, 1);
    assert!(message.contains("file is in the way"), "{message}");
}
