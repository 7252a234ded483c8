//! Costs of plans as text through the commands: no part of certificates, kept in their records, set from
//! outside.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::Path;

use crate::command::{Folder, done, reachcast, refused};
use reachcast::config::{Config, Overrides};
use reachcast::files::npy_bytes;
use serde_json::Value;

/// What makes a certificate small.
const SMALL: [&str; 6] = [
    "deviation.radius=0.05",
    "deviation.pilot=100",
    "global.draws=2000",
    "growth.radius=0.2",
    "growth.rounds=5",
    "rollout.horizon=20",
];

/// What the double integrator costs; its files are `goal.csv` and `ground.npy`.
const COSTS: &str = r#"
[model.costs]
stage.place = { weight = 1.0, formula = "(position - goal)^2 + ground(position, velocity)" }
stage.effort = { weight = 0.01, formula = "acceleration^2" }
terminal.place = { weight = 10.0, formula = "position^2" }
[model.references]
goal = { file = "goal.csv" }
[model.maps]
ground = { file = "ground.npy", origin = [-1.0, -1.0], cell = 0.5 }
"#;

/// The double integrator with `more` behind it, in the file `name`.
fn written(folder: &Folder, name: &str, more: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("configs/models/double_integrator.toml")).unwrap();
    // It has costs of its own.
    let costs = |line: &&str| line.starts_with("[model.costs]");
    let ours = |line: &&str| !line.starts_with("stage.") && !line.starts_with("terminal.");
    let text: String = text
        .lines()
        .filter(|line| !costs(line) && ours(line))
        .map(|line| format!("{line}\n"))
        .collect();
    let path = folder.path(name);
    std::fs::write(&path, text + more).unwrap();
    path
}

/// The certificate of `config` with `set` over it.
fn certificate(config: &str, set: &[&str], out: &str) -> Value {
    let mut arguments = vec!["certify", config, "--backend", "cpu", "--out", out, "-q"];
    SMALL.iter().chain(set).for_each(|set| arguments.extend(["--set", set]));
    let (code, _, message) = reachcast(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{config}: {message}");
    let text = std::fs::read_to_string(format!("{out}/certificate.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// No file of them is there, neither when the certificate is made nor when it is checked.
#[test]
fn certificates_keep_costs_and_do_not_depend_on_them() {
    let folder = Folder::new();
    let (with, without) = (written(&folder, "c.toml", COSTS), written(&folder, "p.toml", ""));
    let out = [folder.path("c"), folder.path("p")];
    let set = ["model.costs.stage.effort.weight=0.25"];
    let (costly, plain) = (certificate(&with, &set, &out[0]), certificate(&without, &[], &out[1]));
    // Random streams, and so all numbers, follow from the hash.
    for field in ["deviation", "global", "growth", "constants", "statements", "system"] {
        assert!(!plain[field].is_null(), "{field}");
        assert_eq!(costly[field], plain[field], "{field}");
    }
    for field in ["physics_sha256", "policy_sha256"] {
        assert_eq!(costly["provenance"][field], plain["provenance"][field], "{field}");
    }
    let kept = |at: &str| costly.pointer(&format!("/provenance/config/model/{at}")).cloned();
    assert_eq!(kept("costs/stage/effort/weight"), Some(Value::from(0.25)));
    assert_eq!(kept("references/goal/file"), Some(Value::from("goal.csv")));
    assert!(done(&["check", &out[0], "--backend", "cpu"]).contains("the certificate holds"));
    let states = folder.path("states.csv");
    std::fs::write(&states, "position,velocity\n0.1,0.0\n").unwrap();
    done(&["query", &out[0], "--states", &states, "--backend", "cpu"]);
}

#[test]
fn weights_are_set_from_outside() {
    let folder = Folder::new();
    let path = written(&folder, "c.toml", COSTS);
    let load = |set: &str| {
        let overrides = Overrides { set: vec![set.to_owned()], ..Overrides::default() };
        Config::load(Path::new(&path), &overrides).unwrap()
    };
    let at = Path::new(&path).parent().unwrap();
    let config = load("model.costs.stage.effort.weight=0.5");
    let missing = config.costs(at).unwrap_err().to_string();
    for part in ["c.toml:", "model.maps.ground", "ground.npy"] {
        assert!(missing.contains(part), "{missing}");
    }
    std::fs::write(folder.path("goal.csv"), "0.5\n0.25\n").unwrap();
    std::fs::write(folder.path("ground.npy"), npy_bytes(&[0.0, 1.0, 2.0, 3.0], [2, 2])).unwrap();
    let costs = config.costs(at).unwrap().unwrap();
    // In the second column of the second row; the end lies at 0.25.
    assert_eq!(costs.shares(&[-0.25, -0.25], &[2.0], 1), [3.25, 2.0, 0.625]);
    assert_eq!(costs.contexts(0, 2), [0.5, 0.25, 0.25]);
    let plain = written(&folder, "p.toml", "");
    let plain = Config::load(Path::new(&plain), &Overrides::default()).unwrap();
    assert!(plain.costs(at).unwrap().is_none());
    let out = folder.path("out");
    let set = |set: &str, words: &[&str]| {
        refused(&["certify", &path, "--out", &out, "--set", set], words);
    };
    set(
        "model.costs.stage.efort.weight=1",
        &["`model.costs.stage.efort`", "`model.costs.stage.effort`"],
    );
    set(
        "model.costs.stage.effort.weight=nan",
        &["weight=nan: model.costs.stage.effort.weight", "not a finite"],
    );
}
