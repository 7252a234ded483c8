//! The command line from outside: exit codes, messages, files, and what bad input meets.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use npyz::WriterBuilder;
use safetensors::tensor::{Dtype, TensorView};
use tempfile::TempDir;

const POLICY: &str = "configs/policies/race_policy.safetensors";
const STARTS: &str = "configs/race_starts_500.csv";
const RACE: &str = "configs/race.toml";

/// The program with these arguments, in the repository's folder.
fn reachcast(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_reachcast"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Runs and expects exit code 0; standard output.
fn done(arguments: &[&str]) -> String {
    let output = reachcast(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Runs and expects exit code 2, nothing on standard output, and `words` in the message.
fn refused(arguments: &[&str], words: &[&str]) {
    let output = reachcast(arguments);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert_eq!(text(&output.stdout), "", "{arguments:?}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: no `{word}` in: {message}");
    }
}

/// A folder of its own with a way to name files in it.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Writes `bytes` to the file `name`; its path.
    fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// A configuration of the race with the policy at `policy`.
    fn race(&self, policy: &str) -> String {
        let text = format!("system.name = 'drone-race'\npolicy.file = '{policy}'\n");
        self.file("config.toml", text)
    }

    fn entries(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut paths: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        paths
    }
}

/// Certifies with these overrides into a folder that stays empty, and expects the refusal.
fn certify_refused(set: &[&str], words: &[&str]) {
    let folder = Folder::new();
    let out = folder.path("out");
    let mut arguments = vec!["certify", "configs/smoke.toml", "--backend", "cpu", "--out", &out];
    for assignment in set {
        arguments.extend(["--set", assignment]);
    }
    refused(&arguments, words);
    let left = std::fs::read_dir(&out).map_or(0, Iterator::count);
    assert_eq!(left, 0, "{set:?} left files");
}

/// A network file with layers of these widths, all weights `weight`.
fn network(widths: &[usize], weight: f32) -> Vec<u8> {
    let layers: Vec<_> = widths
        .windows(2)
        .map(|pair| {
            let bytes = |count: usize| weight.to_le_bytes().repeat(count);
            (vec![pair[1], pair[0]], bytes(pair[0] * pair[1]), bytes(pair[1]))
        })
        .collect();
    let tensors = layers.iter().enumerate().flat_map(|(i, (shape, weights, bias))| {
        let view = |shape, bytes| TensorView::new(Dtype::F32, shape, bytes).unwrap();
        [
            (format!("layers.{i}.weight"), view(shape.clone(), weights)),
            (format!("layers.{i}.bias"), view(vec![shape[0]], bias)),
        ]
    });
    let words = [("activation", "relu"), ("output", "tanh")];
    let metadata = words.map(|(key, value)| (key.to_owned(), value.to_owned()));
    safetensors::serialize(tensors, Some(metadata.into_iter().collect())).unwrap()
}

/// A .npy file.
fn npy<T: npyz::AutoSerialize + Copy>(values: &[T], shape: &[u64], order: npyz::Order) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().order(order).shape(shape);
    let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
    bytes
}

#[test]
fn usage_is_explained() {
    let help = done(&["--help"]);
    for word in [
        "certify",
        "rollout",
        "query",
        "check",
        "race",
        "sweep",
        "bench",
        "policy",
        "train",
        "scenarios",
        "devices",
        "Exit codes",
    ] {
        assert!(help.contains(word), "{word}");
    }
    assert!(done(&["certify", "--help"]).contains("reachcast certify configs/smoke.toml"));
    assert!(done(&["--version"]).contains(env!("CARGO_PKG_VERSION")));
    refused(&[], &["Usage"]);
    refused(&["certfy", RACE], &["certify"]);
    refused(&["certify", RACE, "--threads", "0"], &["--threads"]);
    refused(&["certify", RACE, "--seed", "soon"], &["--seed"]);
    refused(&["certify", RACE, "--profile", "strict"], &["rigorous"]);
    refused(&["certify", RACE, "--backend", "tpu"], &["auto"]);
}

#[test]
fn scenarios_prints_the_published_counts() {
    let counts = |arguments: &[&str]| -> serde_json::Value {
        let all = [&["scenarios", "--json"], arguments].concat();
        serde_json::from_str(&done(&all)).unwrap()
    };
    let plain = counts(&["--epsilon", "0.1", "--beta", "1e-3"]);
    assert_eq!((plain["simple"].as_u64(), plain["exact"].as_u64()), (Some(159), Some(66)));
    let rounds = counts(&["--epsilon", "0.1", "--beta", "1e-3", "--rounds", "5"]);
    assert_eq!(rounds["exact"], 81);
    let joint = counts(&["--epsilon", "0.1", "--beta", "1e-3", "--dim", "31"]);
    assert_eq!((joint["simple"].as_u64(), joint["exact"].as_u64()), (Some(759), Some(501)));
    let failures = counts(&["--epsilon", "0.1", "--beta", "1e-3", "--failures", "2"]);
    assert_eq!(failures["with_failures"], 108);
    let words = done(&["scenarios", "--epsilon", "0.01", "--beta", "1e-6"]);
    assert!(words.contains("2964") && words.contains("1375"), "{words}");
    assert_eq!(done(&["scenarios", "--epsilon", "0.1", "--beta", "1e-3", "-q"]), "");

    refused(&["scenarios", "--epsilon", "1.5", "--beta", "1e-3"], &["--epsilon", "1.5"]);
    refused(&["scenarios", "--epsilon", "0.1", "--beta", "0"], &["--beta"]);
    refused(&["scenarios", "--epsilon", "0.1", "--beta", "0.1", "--dim", "0"], &["--dim"]);
    refused(&["scenarios", "--epsilon", "0.1", "--beta", "0.1", "--rounds", "0"], &["--rounds"]);
}

#[test]
fn devices_lists_the_processor() {
    let listing: serde_json::Value =
        serde_json::from_str(&done(&["devices", "--json", "--threads", "1"])).unwrap();
    assert!(listing["cpu"].as_str().unwrap().contains("1 thread"), "{listing}");
    assert!(listing["adapters"].is_array() && listing["auto"].is_string());
    assert!(done(&["devices"]).contains("--backend auto takes"));
}

#[test]
fn configurations_that_do_not_hold_together() {
    let folder = Folder::new();
    refused(&["certify", "nowhere.toml"], &["nowhere.toml", "No such file"]);
    let broken = folder.file("broken.toml", "[rollout\nhorizon = 3");
    refused(&["certify", &broken], &["broken.toml", "line 1"]);
    let typo = folder.file("typo.toml", "system.name = 'drone-race'\nrollout.horizn = 3\n");
    let nearest = "the nearest valid key is `rollout.horizon`";
    refused(&["certify", &typo], &["typo.toml", "`rollout.horizn`", nearest]);
    certify_refused(&["growth.radios=1"], &["--set growth.radios=1", "`growth.radius`"]);
    certify_refused(&["rollout.horizon=0"], &["rollout.horizon", "0"]);
    certify_refused(&["rollout.horizon=ten"], &["rollout.horizon", "ten"]);
    certify_refused(&["deviation.epsilon=1.5"], &["deviation.epsilon", "1.5"]);
    certify_refused(&["growth.beta=0"], &["growth.beta", "0"]);
    certify_refused(&["box.ego_x=[1, -1]"], &["box.ego_x", "empty"]);
    certify_refused(&["state.ego_x=nan"], &["state.ego_x", "finite"]);
    certify_refused(&["deviation.radius=0"], &["deviation.radius", "positive"]);
    certify_refused(&["slice.x.step=0"], &["slice.x.step", "positive"]);
    certify_refused(&["slice.y.state=ego_x"], &["slice", "both axes"]);
    certify_refused(&["slice.y.state=ego_q"], &["slice.y.state", "no state `ego_q`"]);
    certify_refused(&["system.ego_gain=0"], &["system.ego_gain", "positive"]);
}

#[test]
fn too_few_scenarios_for_the_claim() {
    // Exact counts at risk 0.1 and beta 1e-3: 66 for one variable; 94 with beta over 20 rounds.
    certify_refused(&["deviation.scenarios=65"], &["65 scenarios", "at least 66"]);
    certify_refused(&["growth.scenarios=65"], &["65 scenarios", "at least 66"]);
    let shrinking = ["growth.method=shrinking", "growth.scenarios=80"];
    certify_refused(&shrinking, &["80 scenarios", "at least 94"]);
    // One decision variable per step, 30 steps.
    let joint = ["deviation.joint=variables", "deviation.scenarios=300"];
    certify_refused(&joint, &["300 scenarios", "30 decision variable"]);
    let split = ["deviation.joint=bonferroni", "deviation.scenarios=159"];
    certify_refused(&split, &["159 scenarios"]);
}

#[test]
fn policies_that_do_not_fit() {
    let folder = Folder::new();
    let certify = |words: &[&str]| {
        let config = folder.race("policy.safetensors");
        refused(&["certify", &config, "--backend", "cpu", "--out", &folder.path("out")], words);
    };
    certify(&["policy.safetensors", "No such file"]);
    let whole = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(POLICY)).unwrap();
    folder.file("policy.safetensors", &whole[..whole.len() / 2]);
    certify(&["policy.safetensors", "not a whole safetensors file"]);
    // A header length far beyond the file must not decide how much memory is taken.
    let mut vast = whole.clone();
    vast[..8].copy_from_slice(&(u64::MAX / 2).to_le_bytes());
    folder.file("policy.safetensors", &vast);
    certify(&["not a whole safetensors file"]);
    folder.file("policy.safetensors", network(&[4, 16, 3], 0.1));
    certify(&["takes 4 inputs, the model has 12 states", "ego_x", "`state_order`"]);
    folder.file("policy.safetensors", network(&[12, 16, 3], f32::NAN));
    certify(&["layers.0.weight[0] is NaN"]);
    assert!(!Path::new(&folder.path("out")).exists());
    let formula =
        folder.file("formula.toml", "system.name = 'drone-race'\npolicy.formula = 'bang-bang'\n");
    refused(&["certify", &formula], &["policy.formula", "`bang-bang` is unknown"]);
}

#[test]
fn states_that_are_none() {
    let folder = Folder::new();
    let measures = folder.path("measures.npy");
    let rollout = |starts: &str, words: &[&str]| {
        let arguments =
            ["rollout", RACE, "--backend", "cpu", "--starts", starts, "--measures", &measures];
        refused(&arguments, words);
        assert!(!Path::new(&measures).exists());
    };
    let array = |name: &str, bytes: &[u8]| folder.file(name, bytes);
    let order = npyz::Order::C;
    rollout("nowhere.npy", &["nowhere.npy", "No such file"]);
    rollout("starts.txt", &["starts.txt", ".npy or .csv"]);
    let integers = npy(&[1_i32; 24], &[2, 12], order);
    rollout(&array("int.npy", &integers), &["int.npy", "dtype <i4", "<f4 or <f8"]);
    let narrow = npy(&[0.0_f32; 24], &[4, 6], order);
    rollout(&array("narrow.npy", &narrow), &["[4, 6]", "[N, 12]"]);
    let flat = npy(&[0.0_f32; 24], &[24], order);
    rollout(&array("flat.npy", &flat), &["[24]", "[N, 12]"]);
    let whole = npy(&[0.0_f32; 24], &[2, 12], order);
    rollout(&array("cut.npy", &whole[..whole.len() - 4]), &["truncated"]);
    rollout(&array("cut.npy", &whole[..9]), &["not a whole .npy file"]);
    rollout(&array("cut.npy", b"PK\x03\x04 something else"), &["does not begin with"]);
    let vast = npy::<f32>(&[], &[0, 12], order);
    let vast = text(&vast[10..]).replace("(0, 12, )", "(4611686018427387904, 12)");
    let vast =
        [b"\x93NUMPY\x01\x00".as_slice(), &(vast.len() as u16).to_le_bytes(), vast.as_bytes()];
    rollout(&array("vast.npy", &vast.concat()), &["truncated"]);
    let header = [b"\x93NUMPY\x02\x00".as_slice(), &u32::MAX.to_le_bytes(), b"{}"].concat();
    rollout(&array("header.npy", &header), &["damaged", "4294967295"]);
    let mut values = [0.0_f64; 24];
    values[13] = f64::INFINITY;
    let infinite = npy(&values, &[2, 12], order);
    rollout(&array("infinite.npy", &infinite), &["state 1", "ego_vx", "finite"]);
    let none = npy::<f32>(&[], &[0, 12], order);
    rollout(&array("none.npy", &none), &["no state"]);

    let csv = |text: &str| folder.file("starts.csv", text);
    rollout(&csv("1,2,3\n"), &["line 1", "3 numbers", "12"]);
    rollout(&csv("# a,b,c,d,e,f,g,h,i,j,k,l\n"), &["header `a,b,c", "`a` is no state", "ego_x"]);
    rollout(&csv("position,velocity\n"), &["header `position,velocity`"]);
    rollout(&csv("0,0,0,0,0,0,0,0,0,0,0,0\n0,0,x,0,0,0,0,0,0,0,0,0\n"), &["line 2", "`x`"]);
    rollout(&csv("0,0,0,0,0,NaN,0,0,0,0,0,0\n"), &["ego_vz", "finite"]);
    rollout(&csv(""), &["no state"]);
}

#[test]
fn devices_that_are_not_there() {
    let certify = ["certify", "configs/smoke.toml", "--out", "/nowhere"];
    let with = |more: &[&'static str]| [&certify[..], more].concat();
    refused(&with(&["--device", "Imaginary 9000"]), &["Imaginary 9000"]);
    refused(&with(&["--device", "77"]), &["no adapter has the number 77", "CPU backend"]);
    refused(&with(&["--device", "pci:ff:1f.7"]), &["no adapter is at pci:0000:ff:1f.7"]);
    refused(&with(&["--device", "pci:here"]), &["pci:here", "0000:01:00.0"]);
    refused(
        &with(&["--device", "Imaginary 9000", "--backend", "cpu"]),
        &["--device", "--backend cpu"],
    );
}

/// A loader without any driver: what a machine without graphics has.
#[test]
#[cfg(target_os = "linux")]
fn a_gpu_is_asked_for_and_there_is_none() {
    let folder = Folder::new();
    let output = Command::new(env!("CARGO_BIN_EXE_reachcast"))
        .args(["certify", "configs/smoke.toml", "--backend", "gpu", "--out"])
        .arg(folder.path("out"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .output()
        .unwrap();
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("CPU backend"), "{message}");
    assert!(message.contains("VK_DRIVER_FILES names /nonexistent.json"), "{message}");
    assert!(folder.entries().is_empty());
}

#[test]
fn results_that_cannot_be_written() {
    let folder = Folder::new();
    let file = folder.file("file", "");
    let out = format!("{file}/out");
    let output = reachcast(&["certify", "configs/smoke.toml", "--backend", "cpu", "--out", &out]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("cannot write"), "{}", text(&output.stderr));
    let measures = folder.path("nowhere/measures.npy");
    let starts = ["rollout", RACE, "--backend", "cpu", "--starts", STARTS, "--measures", &measures];
    let output = reachcast(&starts);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("cannot write"), "{}", text(&output.stderr));
}

#[test]
fn rollout_measures_every_start() {
    let folder = Folder::new();
    let run = |starts: &str, measures: &str| -> serde_json::Value {
        let arguments = ["rollout", RACE, "--starts", starts, "--measures", measures];
        let output =
            done(&[&arguments[..], &["--backend", "cpu", "--json", "--overwrite"]].concat());
        serde_json::from_str(&output).unwrap()
    };
    let npy_path = folder.path("measures.npy");
    let summary = run(STARTS, &npy_path);
    assert_eq!((summary["starts"].as_u64(), summary["non_finite"].as_u64()), (Some(500), Some(0)));
    let read = |path: &str| {
        let bytes = std::fs::read(path).unwrap();
        npyz::NpyFile::new(bytes.as_slice()).unwrap().into_vec::<f32>().unwrap()
    };
    let measures = read(&npy_path);
    let successes = measures.iter().filter(|measure| **measure > 0.0).count();
    assert_eq!((measures.len(), summary["successes"].as_u64()), (500, Some(successes as u64)));
    let share = successes as f64 / 500.0;
    let interval = [0, 1].map(|end| summary["success_interval"][end].as_f64().unwrap());
    assert!(interval[0] < share && share < interval[1], "{interval:?}");

    // The same starts from arrays of both types, and the same measures as text.
    let rows = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(STARTS)).unwrap();
    let values: Vec<f64> = rows
        .lines()
        .skip(1)
        .flat_map(|line| line.split(',').map(|field| field.parse().unwrap()))
        .collect();
    let double = npy(&values, &[500, 12], npyz::Order::C);
    let starts = folder.file("double.npy", double);
    run(&starts, &npy_path);
    assert_eq!(read(&npy_path), measures);
    let single: Vec<f32> = values.iter().map(|value| *value as f32).collect();
    let starts = folder.file("single.npy", npy(&single, &[500, 12], npyz::Order::C));
    let csv_path = folder.path("measures.csv");
    run(&starts, &csv_path);
    let text = std::fs::read_to_string(&csv_path).unwrap();
    let (header, lines) = text.split_once('\n').unwrap();
    assert_eq!(header, "measure");
    let parsed: Vec<f32> = lines.lines().map(|line| line.parse().unwrap()).collect();
    assert_eq!(parsed, measures);
    // No temporary file is left.
    assert_eq!(folder.entries().len(), 4);
}
