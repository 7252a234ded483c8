//! The program where no adapter opens, and where a configuration asks for more than there is.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, document, done, reachcast, refused};
use crate::common;
use serde_json::Value;

const STARTS: &str = "configs/race_starts_500.csv";
/// An adapter that is nowhere.
const NOWHERE: [&str; 2] = ["--device", "no such adapter"];
/// A race small enough for a moment.
const SMALL: [&str; 6] =
    ["--starts", "3", "--set", "race.steps=5", "--set", "race.networks.value=''"];

/// The arguments with an adapter that is nowhere, and the CPU allowed in its place.
fn elsewhere<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    [arguments, &NOWHERE, &["--fallback"]].concat()
}

/// Whether `events` are that no adapter opened, and nothing else.
fn says_so(events: &Value) {
    let events = events.as_array().unwrap();
    assert_eq!(events.len(), 1, "{events:?}");
    assert_eq!(
        (events[0]["fault"].as_str(), events[0]["action"].as_str()),
        (Some("absent"), Some("cpu"))
    );
    assert!(events[0]["problem"].as_str().unwrap().contains("no such adapter"), "{events:?}");
}

#[test]
fn a_certificate_falls_back_and_says_so() {
    let folder = Folder::new();
    let out = folder.path("out");
    let certify = ["certify", "configs/smoke.toml", "--out", &out];
    refused(&[&certify[..], &NOWHERE].concat(), &["no such adapter", "CPU backend"]);
    let (code, output, message) = reachcast(&elsewhere(&[&certify[..], &["--json"]].concat()));
    assert_eq!(code, Some(0), "{message}");
    assert!(message.contains("note: no adapter") && message.contains("went on on the CPU"));
    let record: Value = serde_json::from_str(&output).unwrap();
    says_so(&record["events"]);
    assert_eq!(record["provenance"]["backend"], "cpu");
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("What failed on the adapter") && page.contains("no such adapter"));
    // It is a certificate like any other.
    done(&["check", &out, "--backend", "cpu"]);
    done(&elsewhere(&["check", &out]));
    let rows = done(&elsewhere(&["query", &out, "--states", STARTS]));
    assert_eq!(rows, done(&["query", &out, "--states", STARTS, "--backend", "cpu"]));
    let quiet = reachcast(&elsewhere(&["query", &out, "--states", STARTS, "-q"]));
    assert_eq!(quiet, (Some(0), String::new(), String::new()));
}

#[test]
fn races_and_sweeps_fall_back_and_say_so() {
    let folder = Folder::new();
    let [race, sweep] = ["race", "sweep"].map(|name| folder.path(name));
    let small = ["configs/race.toml", "--controllers", "mppi"];
    let arguments = [&["race"], &small[..], &SMALL, &["--out", &race]].concat();
    says_so(&document(&elsewhere(&arguments))["events"]);
    // Gone on with, not flown again.
    says_so(&document(&elsewhere(&arguments))["events"]);
    let page = std::fs::read_to_string(folder.path("race/report.html")).unwrap();
    assert!(page.contains("What failed on the adapter"));
    let arguments =
        [&["sweep"], &small[..], &SMALL, &["--samples", "8,16", "--out", &sweep]].concat();
    let record = document(&elsewhere(&arguments));
    for point in record["points"].as_array().unwrap() {
        says_so(&point["events"]);
    }
    let page = std::fs::read_to_string(folder.path("sweep/report.html")).unwrap();
    assert_eq!(page.matches("no such adapter").count(), 1, "each event once");
}

#[test]
fn measures_fall_back_and_say_so() {
    let folder = Folder::new();
    let measures = folder.path("measures.npy");
    let rollout = ["rollout", "configs/race.toml", "--starts", STARTS, "--measures", &measures];
    says_so(&document(&elsewhere(&rollout))["events"]);
    let bench = ["bench", "--quick", "--workload", "no such workload"];
    refused(&elsewhere(&bench), &["part of no workload's name"]);
}

/// Refused at once, on the CPU and on an adapter, with the figure that was too large.
#[test]
fn absurd_sizes_are_refused_before_the_work() {
    let folder = Folder::new();
    let out = folder.path("out");
    let gpu = common::adapter().map(|_| "gpu");
    for backend in ["cpu"].into_iter().chain(gpu) {
        let common = ["--backend", backend, "--out", &out];
        let certify = ["certify", "configs/smoke.toml"];
        for (set, figure) in [
            ("global.draws=1000000000000000000", "1000000000000000000 is not within 1.."),
            ("deviation.scenarios=1000000000000000000", "1000000000000000000 is not within 1.."),
            ("deviation.pilot=2000000000000", "2000000000000 is not within 1.."),
            ("growth.scenarios=1000000000000000000", "1000000000000000000 is not within 1.."),
            ("growth.rounds=4000000000", "4000000000 is not within 1.."),
            ("rollout.horizon=4000000000", "4000000000 is not within 1..=10000 steps"),
            ("slice.x.step=1e-9", "1800000000 values"),
        ] {
            refused(&[&certify[..], &["--set", set], &common].concat(), &[set_key(set), figure]);
        }
        let fine = ["--set", "slice.x.step=0.001", "--set", "slice.y.step=0.001"];
        refused(&[&certify[..], &fine, &common].concat(), &["slice", "1800 x 2600", "4680000"]);
        let race = ["race", "configs/race.toml"];
        for (flags, figure) in [
            (["--starts", "1000000000000"], "1000000000000 is not within"),
            (["--noise-seeds", "1000000000000"], "1000000000000 is not within"),
            (["--set", "race.mppi.samples=1000000000"], "1000000000 is not within 1..=1000000"),
            (["--set", "race.mppi.horizon=10000"], "10000 is not within 1..=512"),
            (["--set", "race.steps=1000000000"], "1000000000 is not within"),
        ] {
            refused(&[&race[..], &flags, &common].concat(), &[figure]);
        }
        let sweep = ["sweep", "configs/race.toml", "--samples", "16,1000000000"];
        refused(&[&sweep[..], &common].concat(), &["1000000000 is not within 1..=1000000"]);
        refused(&[&certify[..], &["--threads", "65535"], &common].concat(), &["65535", "1024"]);
    }
    assert_eq!(folder.entries(), [""; 0], "nothing is left");
}

/// The key that an assignment sets.
fn set_key(assignment: &str) -> &str {
    assignment.split('=').next().unwrap().trim_end_matches(".step")
}
