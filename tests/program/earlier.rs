//! What earlier versions wrote: certificates are checked, the rest is read, as they were.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command;
use std::path::{Path, PathBuf};

use crate::command::{done, reachcast};
use reachcast::files::read_npz;
use reachcast::race::record::RaceRecord;
use reachcast::race::sweep::record::SweepRecord;

/// Results of version 0.1: certificates of `configs/smoke.toml` on the CPU and on lavapipe, three
/// races of two controllers, a sweep of two points.
fn earlier(name: &str) -> String {
    format!("tests/fixtures/schema_1/{name}")
}

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(earlier(name))
}

#[test]
fn certificates_of_both_backends_still_hold() {
    for folder in ["certificate_cpu", "certificate_gpu"] {
        let found = done(&["check", &earlier(folder), "--backend", "cpu"]);
        assert!(found.contains("the certificate holds"), "{folder}: {found}");
        assert!(found.contains("hash of the physics"), "{folder}: {found}");
        assert!(found.contains("not compared"), "{folder}: {found}");
    }
}

/// Certificates of schema 2: one of `configs/smoke.toml`, one of the double integrator whose steps were
/// bounded separately and spent one beta, with its page of then.
#[test]
fn certificates_of_schema_2_still_hold() {
    for folder in ["certificate_cpu", "certificate_separate"] {
        let folder = format!("tests/fixtures/schema_2/{folder}");
        let found = done(&["check", &folder, "--backend", "cpu"]);
        assert!(found.contains("the certificate holds"), "{folder}: {found}");
        assert!(found.contains("fresh pairs beyond the deviation bound"), "{folder}: {found}");
        assert!(!found.contains("not compared"), "{folder}: {found}");
    }
    let states = "configs/race_starts_500.csv";
    let folder = "tests/fixtures/schema_2/certificate_cpu";
    let rows = done(&["query", folder, "--states", states, "--backend", "cpu"]);
    assert!(rows.lines().count() > 500, "{rows}");
}

#[test]
fn certificates_answer_queries() {
    let states = "configs/race_starts_500.csv";
    let rows =
        |folder: &str| done(&["query", &earlier(folder), "--states", states, "--backend", "cpu"]);
    let (cpu, gpu) = (rows("certificate_cpu"), rows("certificate_gpu"));
    assert_eq!(cpu.lines().count(), gpu.lines().count());
    assert!(cpu.lines().count() > 500, "{cpu}");
}

/// Another plant than the certificate's is noticed in spite of the hash that is not compared.
#[test]
fn a_number_that_does_not_follow_is_noticed() {
    let folder = command::Folder::new();
    let copy = folder.path("copy");
    std::fs::create_dir(&copy).unwrap();
    for name in ["certificate.json", "policy.safetensors"] {
        std::fs::copy(file(&format!("certificate_cpu/{name}")), format!("{copy}/{name}")).unwrap();
    }
    let path = format!("{copy}/certificate.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut record: serde_json::Value = serde_json::from_str(&text).unwrap();
    let bound = &mut record["deviation"]["bound"][30];
    *bound = serde_json::json!(bound.as_f64().unwrap() * 0.9);
    std::fs::write(&path, record.to_string()).unwrap();
    let (code, _, message) = reachcast(&["check", &copy, "--backend", "cpu"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("deviation.bound"), "{message}");
}

#[test]
fn races_and_sweeps_are_read() {
    let text = std::fs::read_to_string(file("race/results.json")).unwrap();
    let record: RaceRecord = serde_json::from_str(&text).unwrap();
    assert_eq!((record.schema, record.controllers.len()), (1, 2));
    let logs = read_npz(&file("race/races/hybrid-seed1-from0.npz")).unwrap();
    assert!(!logs.is_empty());
    let text = std::fs::read_to_string(file("sweep/sweep.json")).unwrap();
    let record: SweepRecord = serde_json::from_str(&text).unwrap();
    assert_eq!((record.schema, record.points.len()), (1, 2));
}
