//! `race` from outside on the CPU: results, the same ones however they came about, and bad input.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use reachcast::files::{Array, npz_bytes, read_npz};
use reachcast::race::DroneRace;
use reachcast::race::judge::{Judge, verdict};
use reachcast::race::record::RaceRecord;
use reachcast::system::System;
use tempfile::TempDir;

/// A coarse slice, and balls that are small.
const CONFIG: &str = "configs/smoke.toml";
/// Longest race.
const STEPS: usize = 25;
/// Few samples in each plan.
const SMALL: [&str; 9] = [
    "race.steps=25",
    "race.hybrid.recovery.samples=24",
    "race.hybrid.fast.samples=24",
    "race.no_policy.recovery.samples=24",
    "race.no_policy.fast.samples=24",
    "race.mppi.samples=24",
    "race.soft.samples=24",
    "race.cbf.samples=24",
    "race.warmstart.samples=24",
];

/// A folder of its own.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes `bytes` to the file `name`; its path.
    fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    }

    /// The starts `from..to` of the study in a file.
    fn starts(&self, name: &str, from: usize, to: usize) -> String {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let all = std::fs::read_to_string(root.join("configs/race_starts_500.csv")).unwrap();
        let rows: Vec<&str> = all.lines().skip(1 + from).take(to - from).collect();
        self.file(name, rows.join("\n") + "\n")
    }
}

/// A race of `controllers` from the file `starts` into `out`.
fn command(controllers: &str, starts: &str, out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
    command.args(["race", CONFIG, "--backend", "cpu", "--controllers", controllers]);
    command.args(["--starts", starts, "--out"]).arg(out);
    SMALL.iter().for_each(|assignment| _ = command.args(["--set", assignment]));
    command.args(more).current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Races and expects exit code 0; standard output.
fn done(controllers: &str, starts: &str, out: &Path, more: &[&str]) -> String {
    let output = command(controllers, starts, out, more).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{controllers} {more:?}: {}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    text(&output.stdout)
}

/// Expects exit code 2 of `output`, nothing on standard output, and `words` in the message.
fn expect_refusal(output: &Output, case: &str, words: &[&str]) {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{case}: {message}");
    assert_eq!(text(&output.stdout), "", "{case}");
    for word in words {
        assert!(message.contains(word), "{case}: no `{word}` in: {message}");
    }
}

fn results(out: &Path) -> String {
    std::fs::read_to_string(out.join("results.json")).unwrap()
}

fn record(out: &Path) -> RaceRecord {
    serde_json::from_str(&results(out)).unwrap()
}

/// Sorted names of the files in `folder`; none where there is no folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Names of the stored races, without what a stopped run may have left beside them.
fn races(out: &Path) -> Vec<String> {
    names(&out.join("races")).into_iter().filter(|name| name.ends_with(".npz")).collect()
}

fn arrays(out: &Path, name: &str) -> BTreeMap<String, Array> {
    read_npz(&out.join("races").join(name)).unwrap()
}

/// The bytes of a file of races but for the time that they took, and the digest over it.
fn untimed(out: &Path, name: &str) -> Vec<u8> {
    let all = arrays(out, name);
    let kept = all.iter().filter(|(array, _)| *array != "seconds" && *array != "sha256");
    let kept: Vec<_> = kept.map(|(array, numbers)| (array.as_str(), numbers.clone())).collect();
    assert_eq!(kept.len(), all.len() - 2);
    npz_bytes(&kept).unwrap()
}

/// Bytes and time of each file in `folder`.
fn snapshot(folder: &Path) -> Vec<(String, Vec<u8>, SystemTime)> {
    let file = |name: String| {
        let path = folder.join(&name);
        let time = path.metadata().unwrap().modified().unwrap();
        (name, std::fs::read(path).unwrap_or_default(), time)
    };
    names(folder).into_iter().map(file).collect()
}

/// States `[T + 1]` and controls `[T]` of each race of a file.
type Races = Vec<(Vec<[f32; 12]>, Vec<[f32; 3]>)>;

/// The races of a file, read array by array.
fn unpacked(arrays: &BTreeMap<String, Array>) -> Races {
    let steps = arrays["steps"].data.as_u32().unwrap();
    let (states, controls) = (&arrays["states"], &arrays["controls"]);
    assert_eq!(states.shape, [steps.len(), STEPS + 1, 12]);
    assert_eq!(controls.shape, [steps.len(), STEPS, 3]);
    let (states, _) = states.data.as_f32().unwrap().as_chunks::<12>();
    let (controls, _) = controls.data.as_f32().unwrap().as_chunks::<3>();
    let race = |(number, steps): (usize, &u32)| {
        let (steps, nan) = (*steps as usize, |row: &[f32]| row.iter().all(|x| x.is_nan()));
        let states = &states[number * (STEPS + 1)..][..STEPS + 1];
        let controls = &controls[number * STEPS..][..STEPS];
        assert!(states[steps + 1..].iter().all(|x| nan(x)));
        assert!(controls[steps..].iter().all(|u| nan(u)));
        (states[..=steps].to_vec(), controls[..steps].to_vec())
    };
    steps.iter().enumerate().map(race).collect()
}

#[test]
fn results_say_what_the_races_were() {
    let folder = Folder::new();
    let (starts, out) = (folder.starts("starts.csv", 0, 5), folder.path("out"));
    let printed = done("all", &starts, &out, &["--json", "--noise-seeds", "2"]);
    assert_eq!(printed, results(&out));
    let files = ["experiment.json", "races", "report.html", "results.json", "timing.json"];
    assert_eq!(names(&out), files);
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("hybrid"));
    let record = record(&out);
    assert_eq!((record.steps, record.starts.count), (STEPS as u32, 5));
    assert_eq!(
        (record.starts.source.as_str(), &record.noise_seeds[..]),
        ("starts.csv", &[1, 2][..])
    );
    let ran: Vec<&str> = record.controllers.iter().map(|c| c.name.as_str()).collect();
    let expected =
        ["hybrid", "hybrid-no-policy", "mppi", "mppi-soft", "mppi-cbf", "mppi-warmstart", "policy"];
    assert_eq!(ran, expected);
    assert_eq!((record.absent.len(), record.absent[0].name.as_str()), (1, "ppo-cbf"));
    assert!(record.absent[0].reason.contains("race.networks.ppo"), "{:?}", record.absent);
    let timing = std::fs::read_to_string(out.join("timing.json")).unwrap();
    let timing: serde_json::Value = serde_json::from_str(&timing).unwrap();
    assert_eq!(timing["controllers"].as_array().unwrap().len(), 7);

    assert_eq!(races(&out).len(), 14);
    let system = DroneRace::default();
    for controller in &record.controllers {
        for (number, seed) in record.noise_seeds.iter().enumerate() {
            let name = format!("{}-seed{seed}-from0.npz", controller.name);
            let all = unpacked(&arrays(&out, &name));
            assert_eq!(all.len(), 5);
            for (states, controls) in &all {
                assert!(states.len() > 10);
                for (t, u) in controls.iter().enumerate() {
                    assert!(u.iter().all(|u| u.abs() <= 1.0), "{name}: {u:?}");
                    let next = system.step(states[t], *u).map(f32::to_bits);
                    assert_eq!(next, states[t + 1].map(f32::to_bits), "{name}, step {t}");
                }
                let last = states.last().unwrap();
                assert!(controls.len() == STEPS || last[2] >= 0.0, "{name}: {last:?}");
            }
            for (i, judge) in Judge::ALL.into_iter().enumerate() {
                let won = all.iter().filter(|(states, _)| verdict(judge, states).is_none());
                assert_eq!(controller.judged[i].successes[number], won.count() as u64, "{name}");
            }
        }
    }
    // Some race was over early, and some controller differs between its seeds.
    let early = |name: &String| unpacked(&arrays(&out, name)).iter().any(|(_, u)| u.len() < STEPS);
    assert!(races(&out).iter().any(early));
    let seeds = ["mppi-seed1-from0.npz", "mppi-seed2-from0.npz"].map(|name| untimed(&out, name));
    assert!(seeds[0] != seeds[1]);

    // The picture is one of the stored races.
    let picture = record.picture.unwrap();
    let drawn = &unpacked(&arrays(&out, "hybrid-seed1-from0.npz"))[picture.start as usize].0;
    let frames: Vec<&[f32]> = picture.frames.iter().map(|frame| frame.x.as_slice()).collect();
    assert_eq!(frames, drawn.iter().map(|x| x.as_slice()).collect::<Vec<_>>());
}

#[test]
fn threads_and_repetition_change_nothing() {
    let folder = Folder::new();
    let starts = folder.starts("starts.csv", 0, 7);
    let run = |name: &str, more: &[&str]| {
        let out = folder.path(name);
        done("hybrid,mppi-cbf,hybrid-no-policy", &starts, &out, more);
        out
    };
    let one = run("one", &["--threads", "1"]);
    let two = run("two", &["--threads", "2"]);
    assert_eq!(results(&one), results(&two));
    assert_eq!(races(&one).len(), 3);
    for name in races(&one) {
        assert!(untimed(&one, &name) == untimed(&two, &name), "{name}");
    }
    // Once more in the same folder, with other threads: nothing is flown.
    let (before, text) = (snapshot(&two.join("races")), results(&two));
    run("two", &["--threads", "1"]);
    assert!(snapshot(&two.join("races")) == before && results(&two) == text);
    let other = run("other", &["--seed", "2"]);
    assert_ne!(record(&other).controllers, record(&one).controllers);
}

#[test]
fn a_killed_run_is_taken_up_where_it_stopped() {
    let folder = Folder::new();
    let starts = folder.starts("starts.csv", 0, 6);
    let controllers = "hybrid,mppi,hybrid-no-global,hybrid-no-safety,hybrid-no-local,policy";
    let (whole, out) = (folder.path("whole"), folder.path("killed"));
    done(controllers, &starts, &whole, &[]);
    let mut child =
        command(controllers, &starts, &out, &["-q"]).stdout(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while races(&out).is_empty() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(1));
    }
    // SIGKILL on Unix: nothing of the program runs any more.
    child.kill().unwrap();
    child.wait().unwrap();
    let stored = races(&out);
    assert!(!stored.is_empty() && stored.len() < 6, "{stored:?}");
    assert!(!out.join("results.json").exists());
    let kept = |name: &String| out.join("races").join(name).metadata().unwrap().modified().unwrap();
    let times: Vec<SystemTime> = stored.iter().map(kept).collect();
    // What a run that is killed while it writes leaves behind.
    let stale = ["killed/.reachcast-a1b2c3.part", "killed/races/.reachcast-d4e5f6.part"];
    for name in stale {
        folder.file(name, "half of a fi");
    }
    done(controllers, &starts, &out, &[]);
    assert!(stale.iter().all(|name| !folder.path(name).exists()));
    assert_eq!(results(&out), results(&whole));
    assert_eq!(races(&out), races(&whole));
    for name in races(&out) {
        assert!(untimed(&out, &name) == untimed(&whole, &name), "{name}");
    }
    assert_eq!(stored.iter().map(kept).collect::<Vec<_>>(), times);
}

#[test]
fn an_experiment_grows_by_controllers_and_seeds() {
    let folder = Folder::new();
    let starts = folder.starts("starts.csv", 0, 3);
    let (out, fresh) = (folder.path("out"), folder.path("fresh"));
    done("mppi", &starts, &out, &[]);
    let first = snapshot(&out.join("races"));
    done("policy,mppi", &starts, &out, &["--noise-seeds", "2"]);
    assert_eq!(races(&out).len(), 4);
    let second = snapshot(&out.join("races"));
    assert_eq!(second.iter().filter(|file| first.contains(file)).count(), 1);
    done("policy,mppi", &starts, &fresh, &["--noise-seeds", "2"]);
    assert_eq!(results(&out), results(&fresh));
    // And less is a part of it.
    done("mppi", &starts, &out, &[]);
    assert!(snapshot(&out.join("races")) == second);
    assert_eq!(record(&out).noise_seeds, [1]);
}

#[test]
fn another_experiment_is_not_mixed_in() {
    let folder = Folder::new();
    let (starts, out) = (folder.starts("starts.csv", 0, 2), folder.path("out"));
    done("policy", &starts, &out, &[]);
    let before = [snapshot(&out), snapshot(&out.join("races"))];
    let others = folder.starts("others.csv", 2, 4);
    let refuse = |starts: &str, more: &[&str]| {
        let output = command("policy,mppi", starts, &out, more).output().unwrap();
        let words = ["experiment.json", "another experiment", "--out", "remove"];
        expect_refusal(&output, &format!("{more:?}"), &words);
    };
    refuse(&starts, &["--set", "race.mppi.samples=25"]);
    refuse(&starts, &["--seed", "9"]);
    refuse(&starts, &["--set", "race.networks.ppo=policies/race_policy.safetensors"]);
    refuse(&others, &[]);
    folder.file("out/experiment.json", "{}\n");
    refuse(&starts, &[]);
    folder.file("out/experiment.json", &before[0][0].1);
    // Written again by this test, it has another time.
    assert!(snapshot(&out)[1..] == before[0][1..]);
    assert!(snapshot(&out.join("races")) == before[1]);
}

#[test]
fn damaged_races_are_not_counted() {
    let folder = Folder::new();
    let (starts, out) = (folder.starts("starts.csv", 0, 3), folder.path("out"));
    done("policy", &starts, &out, &[]);
    let path = out.join("races/policy-seed1-from0.npz");
    let whole = std::fs::read(&path).unwrap();
    let text_before = results(&out);
    let refuse = |bytes: &[u8], words: &str| {
        std::fs::write(&path, bytes).unwrap();
        let output = command("policy", &starts, &out, &[]).output().unwrap();
        let remedy = "remove the file, and the races are flown again";
        expect_refusal(&output, words, &["policy-seed1-from0.npz", words, remedy]);
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        assert_eq!(results(&out), text_before);
    };
    refuse(&whole[..whole.len() / 2], "not a whole .npz file");
    refuse(&[], "not a whole .npz file");
    refuse(b"not an archive", "not a whole .npz file");
    // In the numbers of the first array, the states.
    let mut flipped = whole.clone();
    flipped[300] ^= 1;
    refuse(&flipped, "states.npy");
    let others = folder.path("others");
    done("policy", &folder.starts("others.csv", 3, 6), &others, &[]);
    let foreign = std::fs::read(others.join("races/policy-seed1-from0.npz")).unwrap();
    refuse(&foreign, "its starts are others");
    let fewer = folder.path("fewer");
    done("policy", &folder.starts("fewer.csv", 0, 2), &fewer, &[]);
    refuse(&std::fs::read(fewer.join("races/policy-seed1-from0.npz")).unwrap(), "its starts");
    // As the message says.
    std::fs::remove_file(&path).unwrap();
    done("policy", &starts, &out, &[]);
    assert_eq!(results(&out), text_before);
}
