//! Models whose formulas call networks through the commands: certificates on both backends, their
//! copies of the networks, and what is refused.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::path::Path;

use crate::command::{Folder, document, done, reachcast, refused};
use reachcast::policy::{Activation, Layer, Mlp};
use serde_json::Value;

/// A mass with learned drag, toward the middle; its target is moved by a learned margin.
const MODEL: &str = r#"
[model]
name = "learned-line"
[model.states]
x = { unit = "m", box = [-0.8, 0.8] }
v = { unit = "m/s", box = [-0.5, 0.5] }
[model.controls]
force = { unit = "N", bounds = [-1.0, 1.0] }
[model.flow]
x = "v"
v = "force - net('nets/drag.safetensors', v, x)[0]"
[model.time]
period = 0.1
integrator = "rk4"
[model.task]
kind = "reach-avoid"
target = "0.3 - abs(x) + 0.1 * net('../shift.safetensors', v)[1]"
constraint = "1.2 - abs(x)"
[policy]
formula = { force = "-2 * x - 2 * v" }
"#;

const SET: [&str; 4] =
    ["global.draws=1000", "deviation.pilot=100", "growth.rounds=3", "rollout.horizon=20"];

fn network(inputs: usize, outputs: usize, weight: f32) -> Mlp {
    let layer = |inputs: usize, outputs: usize| {
        Layer::dense(
            (0..inputs * outputs).map(|i| weight / (1.0 + i as f32)).collect(),
            vec![0.01; outputs],
        )
    };
    let layers = vec![layer(inputs, 5), layer(5, outputs)];
    Mlp::new(layers, Activation::Tanh, Activation::Identity).unwrap()
}

/// The model and its networks, one of them beside the folder of the model.
fn written(folder: &Folder) -> String {
    fs::create_dir_all(folder.path("plant/nets")).unwrap();
    let write = |name: &str, network: Mlp| fs::write(folder.path(name), network.to_bytes());
    write("plant/nets/drag.safetensors", network(2, 1, 0.3)).unwrap();
    write("shift.safetensors", network(1, 2, 0.2)).unwrap();
    let config = folder.path("plant/line.toml");
    fs::write(&config, MODEL).unwrap();
    config
}

/// The certificate of `config` in `out`.
fn certificate(config: &str, backend: &str, out: &str) -> Value {
    let mut arguments = vec!["certify", config, "--backend", backend, "--out", out, "-q"];
    SET.iter().for_each(|set| arguments.extend(["--set", set]));
    let (code, _, message) = reachcast(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{message}");
    serde_json::from_str(&fs::read_to_string(format!("{out}/certificate.json")).unwrap()).unwrap()
}

/// The backends that there are.
fn backends(folder: &Folder) -> Vec<&'static str> {
    let out = folder.path("probe");
    let config = "configs/models/double_integrator.toml";
    let set = ["--set", "global.draws=200", "--set", "deviation.pilot=20"];
    let tried = [&["certify", config, "--backend", "gpu", "--out", &out, "-q"], &set[..]].concat();
    let (code, _, message) = reachcast(&tried);
    if matches!(code, Some(0 | 3)) {
        return vec!["cpu", "gpu"];
    }
    let required = std::env::var_os("REACHCAST_REQUIRE_GPU").is_some_and(|value| value == "1");
    assert!(!required, "an adapter is required: {message}");
    println!("SKIPPED: no adapter ({message})");
    vec!["cpu"]
}

#[test]
fn certificates_carry_their_networks() {
    let folder = Folder::new();
    let config = written(&folder);
    fs::write(folder.path("states.csv"), "x,v\n0.1,0.0\n0.7,0.4\n-0.5,-0.1\n").unwrap();
    for backend in backends(&folder) {
        let out = folder.path(backend);
        let record = certificate(&config, backend, &out);
        assert!(record["global"]["accepted"].as_u64().unwrap() > 100, "{backend}");
        assert!(record["constants"]["target"].as_f64().is_none_or(f64::is_finite), "{backend}");
        // The certificate is moved to where nothing else is.
        let moved = Folder::new();
        let place = moved.path("certificate");
        copy(Path::new(&out), Path::new(&place));
        for on in ["cpu", backend] {
            let found = done(&["check", &place, "--backend", on]);
            assert!(found.contains("the certificate holds"), "made on {backend}, on {on}: {found}");
        }
        let asked = ["query", &place, "--states", &folder.path("states.csv"), "--backend", backend];
        assert_eq!(document(&asked)["rows"].as_array().unwrap().len(), 3, "{backend}");
    }
}

/// The files of a folder, to another one.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

/// Copies have names of their own, in the order of the text, and are the networks.
#[test]
fn copies_are_numbered_and_held_against_the_hash() {
    let folder = Folder::new();
    let config = written(&folder);
    let out = folder.path("out");
    let first = certificate(&config, "cpu", &out);
    for (copy, file) in [("1", "plant/nets/drag.safetensors"), ("2", "shift.safetensors")] {
        let copied = fs::read(format!("{out}/network_{copy}.safetensors")).unwrap();
        assert_eq!(copied, fs::read(folder.path(file)).unwrap(), "{file}");
    }
    // Another network in the copy's place: the certificate is of another plant.
    let copy = format!("{out}/network_1.safetensors");
    fs::write(&copy, network(2, 1, 0.31).to_bytes()).unwrap();
    refused(&["check", &out, "--backend", "cpu"], &["provenance.physics_sha256"]);
    fs::write(&copy, network(3, 1, 0.3).to_bytes()).unwrap();
    refused(&["check", &out, "--backend", "cpu"], &["model.flow.v", "takes 3 inputs, found 2"]);
    fs::remove_file(&copy).unwrap();
    refused(&["check", &out, "--backend", "cpu"], &["network_1.safetensors", "column 9"]);
    // Another weight beside the model: another hash, and work that is not the same.
    fs::write(folder.path("shift.safetensors"), network(1, 2, 0.21).to_bytes()).unwrap();
    refused(&["certify", &config, "--backend", "cpu", "--out", &out], &["another experiment"]);
    let second = certificate(&config, "cpu", &folder.path("second"));
    let hash = |record: &Value| record["provenance"]["physics_sha256"].as_str().unwrap().to_owned();
    assert_ne!(hash(&first), hash(&second));
}

#[test]
fn what_does_not_fit_is_refused_with_file_key_and_column() {
    let folder = Folder::new();
    let config = written(&folder);
    for (from, to, words) in [
        (
            ", v, x)",
            ", v)",
            &["line.toml:11: model.flow.v, column 9", "takes 2 inputs, found 1"][..],
        ),
        ("v)[1]", "v)[2]", &["model.task.target, column 22", "outputs 0 to 1, found [2]"]),
        ("shift", "none", &["model.task.target, column 22", "none.safetensors", "No such file"]),
        ("nets/drag.safetensors", "line.toml", &["model.flow.v", "not a whole safetensors file"]),
    ] {
        fs::write(&config, MODEL.replacen(from, to, 1)).unwrap();
        let out = folder.path("no");
        refused(&["certify", &config, "--backend", "cpu", "--out", &out], words);
    }
}

/// An output does not take the place of a network that a formula calls.
#[test]
fn networks_are_inputs() {
    let folder = Folder::new();
    let config = written(&folder);
    fs::write(folder.path("states.csv"), "x,v\n0.1,0.0\n").unwrap();
    let arguments = |measures: &str| {
        let starts = folder.path("states.csv");
        ["rollout", &config, "--starts", &starts, "--backend", "cpu", "--measures", measures]
            .map(str::to_owned)
    };
    let rolled = arguments(&folder.path("measures.csv"));
    done(&rolled.each_ref().map(String::as_str));
    let network = folder.path("shift.safetensors");
    let taken = arguments(&network);
    refused(&taken.each_ref().map(String::as_str), &["shift.safetensors"]);
    let replaced = [&taken.each_ref().map(String::as_str)[..], &["--overwrite"]].concat();
    refused(&replaced, &["shift.safetensors"]);
    assert!(Mlp::load(network.as_ref()).is_ok());
}
