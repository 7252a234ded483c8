//! Tasks through the commands: certificates, rollouts and searches in the words of each task, checked
//! as stored.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, document, done, reachcast, refused};
use serde_json::Value;

/// Two masses on springs, pulled to the middle; the task is put behind it.
const SPRING: &str = r#"
[model]
name = "spring"
[model.states]
x = { unit = "m", box = [-1.2, 1.2] }
v = { unit = "m/s", box = [-1.2, 1.2] }
[model.controls]
force = { unit = "N", bounds = [-1.0, 1.0] }
[model.next]
x = "x + 0.1 * v"
v = "v + 0.1 * (force - x)"
[model.time]
period = 0.1
[policy]
formula = { force = "-0.6 * v" }
[model.task]
"#;
const TARGET: &str = "target = \"0.5 - abs(x)\"\n";
const CONSTRAINT: &str = "constraint = \"1.1 - abs(x)\"\n";
/// What makes a certificate small.
const SMALL: [&str; 8] = [
    "deviation.radius=0.02",
    "deviation.pilot=100",
    "global.draws=2000",
    "growth.radius=0.1",
    "rollout.horizon=20",
    "slice.x.step=0.3",
    "slice.y.step=0.3",
    "state.x=0.1",
];

/// A task, as text and in the words of its certificate.
struct Case {
    lines: &'static str,
    margins: [&'static str; 2],
    /// What a rollout does.
    words: &'static str,
    /// What starts do.
    many: &'static str,
}

const CASES: [Case; 4] = [
    Case {
        lines: "kind = \"avoid\"\n",
        margins: [CONSTRAINT, ""],
        words: "stays safe for 20 steps",
        many: "stay safe for 20 steps",
    },
    Case {
        lines: "kind = \"reach-stay\"\nby = \"1.5 s\"\n",
        margins: [TARGET, CONSTRAINT],
        words: "stays safe for 20 steps, in the target from step 15 on",
        many: "stay safe for 20 steps, in the target from step 15 on",
    },
    Case {
        lines: "kind = \"reach\"\nfrom = 5\nto = 12\n",
        margins: [TARGET, ""],
        words: "reaches the target at a step from 5 to 12",
        many: "reach the target at a step from 5 to 12",
    },
    Case {
        lines: "kind = \"at-end\"\n",
        margins: [TARGET, CONSTRAINT],
        words: "stays safe for 20 steps, in the target at the last of them",
        many: "stay safe for 20 steps, in the target at the last of them",
    },
];

impl Case {
    fn text(&self) -> String {
        let [one, other] = self.margins;
        format!("{SPRING}{}{one}{other}", self.lines)
    }
}

/// The certificate of `config` in `out`, with `set` over it.
fn certificate(config: &str, set: &[&str], out: &str) -> Value {
    let mut arguments = vec!["certify", config, "--backend", "cpu", "--out", out, "-q"];
    SMALL.iter().chain(set).for_each(|set| arguments.extend(["--set", set]));
    let (code, _, message) = reachcast(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{config}: {message}");
    let text = std::fs::read_to_string(format!("{out}/certificate.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Certified sets by distances and by drops, and tubes, are of the task, and hold.
#[test]
fn certificates_speak_of_their_task_and_hold() {
    let folder = Folder::new();
    for (i, case) in CASES.iter().enumerate() {
        let (config, out) = (folder.path(&format!("{i}.toml")), folder.path(&format!("{i}")));
        std::fs::write(&config, case.text()).unwrap();
        let record = certificate(&config, &["deterministic.kind=\"tube\""], &out);
        let statements = record["statements"].to_string();
        assert!(statements.contains(case.words), "no `{}` in: {statements}", case.words);
        assert!(record["global"]["accepted"].as_u64().unwrap() > 100, "{}", record["global"]);
        assert!(record["deterministic"]["certified"].as_u64().unwrap() > 10, "{}", case.lines);
        assert_ne!(record["state"]["tier"], 0, "no task of these is done at its first state");
        let page = std::fs::read_to_string(format!("{out}/report.html")).unwrap();
        let has = |words: &str| page.contains(words);
        assert!(has(&format!("a rollout that {}", case.words)), "{}", case.lines);
        assert_eq!(has("L_r of the target margin"), case.margins.contains(&TARGET));
        assert_eq!(has("L_c of the constraint margin"), case.margins.contains(&CONSTRAINT));
        assert!(!has("reaches the target safely") && !has("reached the target safely"));
        assert!(done(&["check", &out, "--backend", "cpu"]).contains("the certificate holds"));
    }
}

/// A task is part of what is claimed: another one draws other samples and has another hash.
#[test]
fn tasks_have_samples_and_hashes_of_their_own() {
    let folder = Folder::new();
    let record = |name: &str, by: &str| {
        let config = folder.path(&format!("{name}.toml"));
        let text = format!("{SPRING}kind = \"reach-stay\"\n{by}{TARGET}{CONSTRAINT}");
        std::fs::write(&config, text).unwrap();
        certificate(&config, &[], &folder.path(name))
    };
    let [first, second] = [record("a", "by = 15\n"), record("b", "by = 16\n")];
    let hash = |record: &Value| record["provenance"]["physics_sha256"].clone();
    assert_ne!(hash(&first), hash(&second));
    assert_eq!(first["system"]["task"]["by"], 15);
    assert_ne!(first["deviation"]["largest"], second["deviation"]["largest"]);
}

#[test]
fn rollouts_speak_of_their_task() {
    let folder = Folder::new();
    std::fs::write(folder.path("starts.csv"), "x,v\n0,0\n1.0,1.0\n1.15,0\n").unwrap();
    for (i, case) in CASES.iter().enumerate() {
        let config = folder.path(&format!("{i}.toml"));
        std::fs::write(&config, case.text()).unwrap();
        let (starts, out) = (folder.path("starts.csv"), folder.path(&format!("{i}.npy")));
        let horizon = ["--set", "rollout.horizon=20", "--backend", "cpu"];
        let arguments = ["rollout", &config, "--starts", &starts, "--measures", &out];
        let said = done(&[&arguments[..], &horizon].concat());
        assert!(said.contains(&format!("of 3 starts {}:", case.many)), "{said}");
        assert!(said.contains(&format!("positive where a start {})", case.words)), "{said}");
        let again = [&arguments[..], &horizon, &["--overwrite"]].concat();
        assert_eq!(document(&again)["successes"].as_u64().unwrap(), 1, "{}", case.lines);
    }
}

/// A start that fails its task is found, and fails again where it is rolled out from the file.
#[test]
fn searches_find_starts_that_fail_the_task() {
    let folder = Folder::new();
    for (i, case) in CASES.iter().enumerate() {
        let (config, out) = (folder.path(&format!("{i}.toml")), folder.path(&format!("{i}")));
        std::fs::write(&config, case.text()).unwrap();
        let horizon = ["--set", "rollout.horizon=20", "--backend", "cpu"];
        let search = ["falsify", &config, "--budget", "5000", "--out", &out];
        let (code, _, message) = reachcast(&[&search[..], &horizon].concat());
        assert_eq!(code, Some(3), "{}: {message}", case.lines);
        let (starts, measures) = (format!("{out}/counterexamples.csv"), folder.path("m.npy"));
        let replay = ["rollout", &config, "--starts", &starts, "--measures", &measures];
        let again = document(&[&replay[..], &horizon, &["--overwrite"]].concat());
        assert!(again["starts"].as_u64().unwrap() > 0);
        assert_eq!(again["successes"].as_u64().unwrap(), 0, "{}", case.lines);
    }
}

#[test]
fn times_beyond_the_horizon_are_refused_before_the_work() {
    let folder = Folder::new();
    let config = folder.path("late.toml");
    let text = format!("{SPRING}kind = \"reach\"\nto = 31\n{TARGET}");
    std::fs::write(&config, text).unwrap();
    let out = folder.path("out");
    let set = ["--set", "rollout.horizon=30", "--backend", "cpu"];
    let words = ["model.task.to: step 31 lies beyond the horizon of 30 steps"];
    refused(&[&["certify", &config, "--out", &out][..], &set].concat(), &words);
}
