//! What `race` refuses, and what it takes: controllers, keys, networks, starts, and a spent beta.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::{Path, PathBuf};
use std::process::Command;

use reachcast::race::record::RaceRecord;
use tempfile::TempDir;

const CONFIG: &str = "configs/smoke.toml";
const POLICY: &str = "policies/race_policy.safetensors";

/// What one run of `race` came to.
struct Run {
    /// Keeps the folder.
    _folder: TempDir,
    out: PathBuf,
    code: Option<i32>,
    printed: String,
    message: String,
}

/// `race` with these arguments: two starts and a short race unless they say otherwise.
fn race(config: &str, arguments: &[&str]) -> Run {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
    command.args(["race", config, "--backend", "cpu", "--json", "--out"]).arg(&out);
    if !arguments.contains(&"--starts") {
        command.args(["--starts", "2"]);
    }
    let long = !arguments.iter().any(|argument| argument.starts_with("race.steps="));
    if long && config == CONFIG {
        command.args(["--set", "race.steps=3"]);
    }
    let output = command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let (printed, message) = (text(output.stdout), text(output.stderr));
    Run { _folder: folder, out, code: output.status.code(), printed, message }
}

/// Expects exit code 2 before anything is written, and `words` in the message.
fn refused_by(config: &str, arguments: &[&str], words: &[&str]) {
    // Bound whole: its folder stays until the end.
    let run = race(config, arguments);
    let Run { out, code, printed, message, .. } = &run;
    assert_eq!(*code, Some(2), "{arguments:?}: {message}");
    assert_eq!(printed, "", "{arguments:?}");
    assert!(!out.exists(), "{arguments:?}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: no `{word}` in: {message}");
    }
}

fn refused(arguments: &[&str], words: &[&str]) {
    refused_by(CONFIG, arguments, words);
}

/// Refuses `controllers` with these keys.
fn keys_refused(controllers: &str, keys: &[&str], words: &[&str]) {
    let mut arguments = vec!["--controllers", controllers];
    keys.iter().for_each(|key| arguments.extend(["--set", *key]));
    refused(&arguments, words);
}

/// The record of `controllers` with these keys.
fn record(controllers: &str, keys: &[&str]) -> RaceRecord {
    let mut arguments = vec!["--controllers", controllers];
    keys.iter().for_each(|key| arguments.extend(["--set", *key]));
    let run = race(CONFIG, &arguments);
    assert_eq!(run.code, Some(0), "{keys:?}: {}", run.message);
    serde_json::from_str(&run.printed).unwrap()
}

/// A file in a folder of its own.
fn file(folder: &TempDir, name: &str, text: &str) -> String {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn controllers_are_known_by_name() {
    refused(&["--controllers", "hybrd"], &["--controllers", "`hybrd`", "did you mean `hybrid`"]);
    refused(&["--controllers", "mppi,mpi-soft"], &["`mpi-soft`", "did you mean `mppi-soft`"]);
    refused(&["--controllers", ""], &["--controllers", "``"]);
    let names = |list: &str| -> Vec<String> {
        let samples = ["race.mppi.samples=8", "race.soft.samples=8"];
        record(list, &samples).controllers.into_iter().map(|c| c.name).collect()
    };
    assert_eq!(names("mppi,policy,mppi"), ["mppi", "policy"]);
    let ablations = [
        "hybrid",
        "hybrid-no-global",
        "hybrid-no-local",
        "hybrid-no-recovery",
        "hybrid-no-policy",
        "hybrid-no-safety",
    ];
    assert_eq!(names("ablations"), ablations);
}

#[test]
fn values_out_of_range_name_their_key() {
    for (key, word) in [
        ("race.judge=foo", "`foo`"),
        ("race.steps=0", "0 is not within 1..=10000"),
        ("race.steps=10001", "10001 is not within 1..=10000"),
        ("race.steps=soon", "soon"),
        ("race.beta=2", "2 is not strictly between 0 and 1"),
        ("race.beta=0", "0 is not strictly between 0 and 1"),
        ("race.mppi.samples=0", "0 is not within"),
        ("race.mppi.samples=-1", "-1"),
        ("race.mppi.horizon=0", "0 is not within"),
        ("race.mppi.horizon=513", "513 is not within 1..=512"),
        ("race.mppi.iterations=0", "expected 1 or more"),
        ("race.mppi.temperature=0", "not a positive number"),
        ("race.mppi.temperature=nan", "NaN is not a finite number"),
        ("race.mppi.sigma=-1", "-1; expected 0 or more"),
        ("race.mppi.sigma=wide", "a number, three numbers or a 3 x 3 matrix"),
        ("race.mppi.sigma=[1, 2]", "a number, three numbers or a 3 x 3 matrix"),
        ("race.mppi.sigma=[[1, 2, 0], [2, 1, 0], [0, 0, 1]]", "positive definite"),
        ("race.mppi.sigma=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]", "symmetric"),
        ("race.mppi.speed=inf", "inf is not a finite number"),
        ("race.mppi.cost.lane=nan", "NaN is not a finite number"),
        ("race.mppi.cost.lane=1e39", "not a finite number"),
        ("race.mppi.cost.safety.radius=-inf", "-inf is not a finite number"),
        ("race.hybrid.plan_gain=nan", "NaN is not a finite number"),
        ("race.hybrid.first_plan=stop", "`stop`"),
        ("race.filter.rate=0", "0 is outside (0, 1]"),
        ("race.filter.slack_weight=0", "0 is not a positive number"),
        ("race.networks=none", "section"),
    ] {
        let (name, _) = key.split_once('=').unwrap();
        keys_refused("mppi", &[key], &[name, word]);
    }
    let noise = ["race.mppi.noise_cost=true", "race.mppi.noise={kind='colored',time=2}"];
    keys_refused("mppi", &noise, &["race.mppi.noise_cost", "independent"]);
    // Each step and round of growth takes a random stream.
    let streams = ["race.steps=10000", "growth.rounds=9999", "growth.method=shrinking"];
    keys_refused("mppi", &streams, &["growth.rounds", "race.steps", "16777216"]);
}

#[test]
fn misspelt_keys_name_the_nearest() {
    for (key, nearest) in [
        ("race.mppi.samplse=3", "`race.mppi.samples`"),
        ("race.stesp=3", "`race.steps`"),
        ("race.hybrid.lach=true", "`race.hybrid.latch`"),
        ("race.hybrid.fast.cost.safety.wieght=1", "`race.hybrid.fast.cost.safety.weight`"),
        ("race.filter.rat=0.5", "`race.filter.rate`"),
        ("race.networks.values=x", "`race.networks.value`"),
    ] {
        let unknown = format!("`{}`", key.split_once('=').unwrap().0);
        keys_refused("mppi", &[key], &["unknown key", &unknown, nearest]);
    }
}

#[test]
fn kinds_are_switched_with_all_they_need() {
    keys_refused("mppi", &["race.mppi.noise.kind=colored"], &["`time`", "race.mppi.noise"]);
    keys_refused("mppi", &["race.mppi.noise.kind=pink"], &["`pink`", "race.mppi.noise"]);
    keys_refused("mppi", &["race.mppi.cost.family=centerline"], &["missing", "race.mppi.cost"]);
    let knots = ["race.mppi.noise={kind='spline',knots=26}"];
    keys_refused("mppi", &knots, &["race.mppi.noise.knots", "26 is not within 1..=25"]);
    // A term that the other family does not have.
    let odd = ["race.mppi.cost={family='recovery',position=1,velocity=1,control=1,away=3}"];
    keys_refused("mppi", &odd, &["away", "race.mppi.cost"]);

    let mppi = |keys: &[&str]| record("mppi", &[&["race.mppi.samples=16"], keys].concat());
    let config = |record: &RaceRecord| record.provenance.config["race"]["mppi"].clone();
    let colored = mppi(&["race.mppi.noise.kind=colored", "race.mppi.noise.time=3"]);
    let noise = serde_json::json!({ "kind": "colored", "time": 3.0 });
    assert_eq!(config(&colored)["noise"], noise);
    let spline = mppi(&["race.mppi.noise={kind='spline',knots=4}"]);
    assert_eq!(config(&spline)["noise"], serde_json::json!({ "kind": "spline", "knots": 4 }));
    let family = "race.mppi.cost={family='centerline',lane=100,speed=2,control=0.5}";
    let cost = config(&mppi(&[family]))["cost"].clone();
    assert_eq!((&cost["family"], &cost["lane"]), (&"centerline".into(), &100.0.into()));
    let weights = "[1,1,1,1,1,1,0,0,0,0,0,0]";
    let quadratic = |states: &str| {
        format!(
            "race.mppi.cost={{family='quadratic',state={weights},control=[1,1,1],last={weights},\
             obstacle={{states={states},center=[0.1,-0.5],radius=0.2,weight=9}}}}"
        )
    };
    let named = config(&mppi(&[&quadratic("[0,2]")]))["cost"].clone();
    assert_eq!(named["obstacle"]["states"], serde_json::json!([0, 2]));
    keys_refused("mppi", &[&quadratic("[0,12]")], &["race.mppi.cost.obstacle.states", "12"]);
    // What both families have stays; what one alone has is gone.
    assert!(cost["safety"].is_object() && cost.get("away").is_none(), "{cost}");
}

#[test]
fn settings_of_the_last_controller_are_read_before_the_first_races() {
    for (controllers, key, word) in [
        ("mppi,hybrid", "race.hybrid.fast.samples=0", "race.hybrid.fast.samples"),
        ("policy,mppi-cbf", "race.cbf.sigma=-1", "race.cbf.sigma"),
        ("policy,mppi-cbf", "race.filter.radius=0", "race.filter.radius"),
        ("mppi,hybrid", "growth.scenarios=5", "5 scenarios"),
        ("mppi,hybrid-no-global", "deviation.scenarios=5", "5 scenarios"),
    ] {
        keys_refused(controllers, &[key], &[word]);
    }
    // Certificates that nobody asks for may be as they like.
    let record = record("policy,hybrid-no-policy", &["growth.scenarios=5"]);
    assert_eq!(record.controllers.len(), 2);
}

#[test]
fn networks_have_to_fit() {
    let network = |key: &str, file: &str, words: &[&str]| {
        let assignment = format!("race.networks.{key}={file}");
        keys_refused("policy", &[&assignment], words);
    };
    network("value", "gone.safetensors", &["gone.safetensors", "No such file"]);
    let shape = ["race_policy.safetensors", "12 inputs to 3 outputs", "1 "];
    network("value", POLICY, &shape);
    let shape = ["race_value.safetensors", "12 inputs to 1 outputs"];
    network("ppo", "policies/race_value.safetensors", &shape);
    network("disturbance", "policies/race_value.safetensors", &shape);
    network("ppo", "race.toml", &["race.toml", "safetensors"]);

    let absent = record("ppo-cbf,policy", &[]);
    assert_eq!((absent.controllers.len(), absent.absent.len()), (1, 1));
    let reason = &absent.absent[0].reason;
    assert!(reason.contains("PPO") && reason.contains("race.networks.ppo"), "{reason}");
    let ppo = record("ppo-cbf", &[&format!("race.networks.ppo={POLICY}")]);
    assert!(ppo.absent.is_empty());
    // Two races of three steps, each of which asks the filter.
    assert_eq!(ppo.controllers[0].filter.map(|filter| filter.calls), Some(6));
    let disturbed = record("hybrid", &[&format!("race.networks.disturbance={POLICY}")]);
    assert_eq!(disturbed.controllers.len(), 1);
}

#[test]
fn starts_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let good = "0.1,0,-2,0.5,0,0,-0.5,0,-2,0.3,0,0\n";
    let starts = |text: &str, words: &[&str]| {
        refused(&["--starts", &file(&folder, "starts.csv", text)], words);
    };
    starts(&good.replace(",0,0\n", ",0\n"), &["starts.csv", "line 1", "11 numbers", "12"]);
    starts(&(good.to_owned() + &good.replace("0.5", "NaN")), &["state 1", "not a finite"]);
    starts("", &["starts.csv", "no state"]);
    refused(&["--starts", "gone.csv"], &["gone.csv", "No such file"]);
    refused(&["--starts", "many"], &["many", ".npy or .csv"]);
    refused(&["--starts", "0"], &["--starts", "0 is not within"]);
    refused(&["--starts", "1000001"], &["--starts", "1000001"]);
    refused(&["--noise-seeds", "0"], &["--noise-seeds", "0 is not within 1..=1000"]);
    refused(&["--noise-seeds", "1001"], &["--noise-seeds", "1001"]);
    let drawn = |corners: &str, words: &[&str]| {
        refused(&["--set", &format!("race.start_box=[{corners}]")], words);
    };
    drawn(&["[0, 1]"; 11].join(","), &["race.start_box", "11 intervals, expected 12"]);
    drawn(&["[1, 0]"; 12].join(","), &["race.start_box", "empty interval"]);
    drawn(&["[1, 1]"; 12].join(","), &["race.start_box", "empty"]);
    drawn(&["[0, inf]"; 12].join(","), &["race.start_box", "not a finite"]);
    drawn("[0, 1, 2]", &["race.start_box"]);
    refused_by("configs/double_integrator.toml", &[], &["double_integrator.toml", "drone-race"]);
    let steps = ["--set", "race.steps=3"];
    refused_by("configs/double_integrator.toml", &steps, &["race.steps", "unknown key `race`"]);
    refused_by("configs/gone.toml", &[], &["gone.toml"]);

    // A start past the gate, or not to be saved, is lost, not an error.
    let text = good.to_owned() + &good.replace("-2,0.5", "0.5,0.5") + &good.replace("0.1", "1e30");
    let path = file(&folder, "odd.csv", &text);
    let run = race(CONFIG, &["--controllers", "policy,mppi,hybrid,mppi-cbf", "--starts", &path]);
    assert_eq!(run.code, Some(0), "{}", run.message);
    let record: RaceRecord = serde_json::from_str(&run.printed).unwrap();
    assert_eq!(record.starts.count, 3);
    assert!(Path::new(&run.out).join("report.html").exists());
}

#[test]
fn seeds_go_round() {
    let run = race(
        CONFIG,
        &["--controllers", "policy", "--seed", &u64::MAX.to_string(), "--noise-seeds", "2"],
    );
    assert_eq!(run.code, Some(0), "{}", run.message);
    let record: RaceRecord = serde_json::from_str(&run.printed).unwrap();
    assert_eq!(record.noise_seeds, [u64::MAX, 0]);
}

#[test]
fn beta_of_a_race_is_not_overdrawn() {
    // 1e-3 a call: two of them fit.
    let keys = ["race.steps=12", "race.beta=0.0025", "race.hybrid.recovery.samples=16"];
    let tiers = |keys: &[&str]| record("hybrid", keys).controllers[0].tiers.clone().unwrap();
    let spent = tiers(&keys);
    assert_eq!(spent.beta_call, 1e-3);
    let calls = spent.growth_calls;
    assert!((2..=4).contains(&calls), "at most two calls in each of two races: {calls}");
    let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(close(spent.beta_race, spent.beta_deviation + 2e-3), "{spent:?}");
    assert!(close(spent.beta_total, spent.beta_deviation + 1e-3 * calls as f64), "{spent:?}");
    // With room for more, more is spent.
    assert!(tiers(&["race.steps=12", "race.hybrid.recovery.samples=16"]).growth_calls > 4);
}

#[test]
fn plans_of_two_lengths_are_handed_over() {
    let keys = ["race.steps=40", "race.no_policy.fast.horizon=7", "race.no_policy.fast.samples=16"];
    let tiers = record("hybrid-no-policy", &keys).controllers[0].tiers.clone().unwrap();
    // Both plans flew.
    assert!(tiers.shares[0] > 0.0 && tiers.shares[3] > 0.0, "{:?}", tiers.shares);
}

#[test]
fn every_profile_races() {
    // Beta of a call: without a split each of five rounds spends its own.
    for (profile, beta_call) in [("study", 5e-3), ("paper", 5e-3), ("rigorous", 1e-3)] {
        let few = "race.hybrid.recovery.samples=16";
        let run =
            race(CONFIG, &["--profile", profile, "--controllers", "hybrid,mppi-cbf", "--set", few]);
        assert_eq!(run.code, Some(0), "{profile}: {}", run.message);
        let record: RaceRecord = serde_json::from_str(&run.printed).unwrap();
        assert_eq!(record.provenance.config["profile"], profile);
        let tiers = record.controllers[0].tiers.as_ref().unwrap();
        assert!((tiers.beta_call - beta_call).abs() < 1e-15, "{profile}: {}", tiers.beta_call);
    }
}
