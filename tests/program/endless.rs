//! Pipes and devices in the places of files: refused by name and at once, whoever reads them.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::command::{Folder, done};

const LINE: &str = "configs/double_integrator.toml";
const SMOKE: &str = "configs/smoke.toml";
/// A reader that waits longer waits for ever.
const PATIENCE: Duration = Duration::from_secs(20);
/// What a device would be read to, KiB: far above what the commands need.
const MEMORY: &str = "4000000";

/// Exit code and message of the program, which is stopped where it hangs, and has no memory without
/// end.
fn ended(arguments: &[&str]) -> (Option<i32>, String) {
    let script = format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\"");
    let mut child = Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_reachcast")])
        .args(arguments)
        .args(["--backend", "cpu", "-q"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() && begun.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(10));
    }
    _ = child.kill();
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Puts a pipe, then a link to a device, in the place of `path`, and expects that `arguments` are
/// refused by its name each time.
fn refuses(path: &str, arguments: &[&str]) {
    let kept = fs::read(path).ok();
    for kind in ["pipe", "device"] {
        _ = fs::remove_file(path);
        match kind {
            "pipe" => assert!(Command::new("mkfifo").arg(path).status().unwrap().success()),
            _ => symlink("/dev/zero", path).unwrap(),
        }
        let (code, message) = ended(arguments);
        assert_eq!(code, Some(2), "{kind} as {path}: {message}");
        let name = Path::new(path).file_name().unwrap().to_str().unwrap();
        let told = message.contains(name) && message.contains("a pipe or a device");
        assert!(told, "{kind} as {path}: {message}");
    }
    fs::remove_file(path).unwrap();
    kept.into_iter().for_each(|bytes| fs::write(path, bytes).unwrap());
}

#[test]
fn inputs_are_plain_files() {
    let folder = Folder::new();
    let at = |name: &str| folder.path(name);
    let (config, policy, starts) = (at("c.toml"), at("policy.safetensors"), at("s.csv"));
    let (array, out, measures) = (at("s.npy"), at("out"), at("m.csv"));
    refuses(&config, &["certify", &config, "--out", &out]);
    refuses(&policy, &["policy", "inspect", &policy]);
    let graph = at("graph.onnx");
    refuses(&graph, &["policy", "import", &graph, "--out", &at("p.safetensors")]);
    let text = "system.name = 'drone-race'\npolicy.file = 'policy.safetensors'\n";
    fs::write(&config, text).unwrap();
    refuses(&policy, &["certify", &config, "--out", &out]);
    for starts in [&starts, &array] {
        refuses(starts, &["rollout", LINE, "--starts", starts, "--measures", &measures]);
    }
    assert!(!Path::new(&out).exists() && !Path::new(&measures).exists());
}

#[test]
fn certificates_are_plain_files() {
    let folder = Folder::new();
    let (out, states) = (folder.path("out"), folder.path("s.csv"));
    fs::write(&states, "0,0\n").unwrap();
    let small = "--set global.draws=500 --set slice.x.step=0.5 --set slice.y.step=0.5";
    let mut certify = vec!["certify", LINE, "--backend", "cpu", "-q", "--out", &out];
    certify.extend(small.split_whitespace());
    done(&certify);
    let file = |name: &str| format!("{out}/{name}");
    refuses(&file("certificate.json"), &["query", &out, "--states", &states]);
    refuses(&file("certificate.json"), &["check", &out]);
    refuses(&file("report.html"), &["check", &out]);
    refuses(&file("slice.npy"), &["check", &out]);
    let again: Vec<&str> =
        certify.iter().copied().filter(|a| !["--backend", "cpu", "-q"].contains(a)).collect();
    refuses(&file("experiment.json"), &again);
    done(&["check", &out, "--backend", "cpu", "-q"]);
}

#[test]
fn stored_races_and_points_are_plain_files() {
    let folder = Folder::new();
    let (race, sweep) = (folder.path("race"), folder.path("sweep"));
    let set = "--starts 2 --set race.steps=2 --set race.mppi.samples=16";
    let with = |begin: &[&'static str], out: &str| -> Vec<String> {
        let words = begin.iter().copied().chain(set.split_whitespace());
        words.chain(["--out"]).map(str::to_owned).chain([out.to_owned()]).collect()
    };
    let races = with(&["race", SMOKE, "--controllers", "mppi"], &race);
    let points = with(&["sweep", SMOKE, "--controllers", "mppi", "--samples", "16,32"], &sweep);
    for arguments in [&races, &points] {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        done(&[&arguments[..], &["--backend", "cpu", "-q"]].concat());
    }
    let races: Vec<&str> = races.iter().map(String::as_str).collect();
    let points: Vec<&str> = points.iter().map(String::as_str).collect();
    let inner = |folder: &str| {
        let mut entries = fs::read_dir(folder).unwrap();
        entries.next().unwrap().unwrap().path().to_str().unwrap().to_owned()
    };
    let log = inner(&format!("{race}/races"));
    refuses(&log, &races);
    refuses(&format!("{log}.events.json"), &races);
    refuses(&format!("{race}/experiment.json"), &races);
    refuses(&inner(&format!("{sweep}/points")), &points);
    done(&[&races[..], &["--backend", "cpu", "-q"]].concat());
    done(&[&points[..], &["--backend", "cpu", "-q"]].concat());
}
