//! Sweeps for the tests: a few short races at each point.

#![allow(dead_code, reason = "each test file uses a part of it")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use reachcast::race::sweep::record::SweepRecord;
use tempfile::TempDir;

/// A coarse slice, and balls that are small.
pub(crate) const CONFIG: &str = "configs/smoke.toml";
/// Starts of each point.
pub(crate) const STARTS: &str = "4";
/// Longest race.
pub(crate) const STEPS: &str = "race.steps=20";

/// A folder of its own.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

/// `sweep` of `config` into `out`.
pub(crate) fn sweep_of(config: &str, out: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
    command.args(["sweep", config, "-q", "--out"]).arg(out).args(arguments);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// `sweep` of a few short races into `out`.
pub(crate) fn command(out: &Path, arguments: &[&str]) -> Command {
    let mut command = sweep_of(CONFIG, out, arguments);
    command.args(["--starts", STARTS, "--set", STEPS]);
    command
}

/// What a run said on standard error; its exit code has to be `code`.
pub(crate) fn message_of(output: &Output, code: i32) -> String {
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{message}");
    message
}

/// The record that `out` holds.
pub(crate) fn record(out: &Path) -> SweepRecord {
    let text = std::fs::read_to_string(out.join("sweep.json")).expect("sweep.json");
    serde_json::from_str(&text).expect("a record")
}

/// Sweeps `config` on the CPU; the record.
pub(crate) fn done(config: &str, out: &Path, arguments: &[&str]) -> SweepRecord {
    let output = sweep_of(config, out, arguments).args(["--backend", "cpu"]).output();
    message_of(&output.expect("the program runs"), 0);
    record(out)
}

/// Sweeps a few short races on the CPU; the record.
pub(crate) fn sweep(out: &Path, arguments: &[&str]) -> SweepRecord {
    let output = command(out, arguments).args(["--backend", "cpu"]).output();
    message_of(&output.expect("the program runs"), 0);
    record(out)
}
