//! A program with a plant of its own: every command that works for any plant, in process.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::ffi::OsString;
use std::fs;

use reachcast::backend::Backend;
use reachcast::certificate::{CERTIFICATE, Certificate};
use reachcast::cli::run_with;
use reachcast::config::{Config, Overrides, Registered, Registry};
use reachcast::model::{Controller, Model};
use reachcast::scenario::{Unwatched, certify};
use reachcast::system::{BangBang, DoubleIntegrator};

use crate::command::{Folder, refused};

#[path = "../../examples/program.rs"]
#[allow(dead_code, missing_docs, reason = "the example's own main is not called")]
mod example;

const SLED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/sled.toml");

/// The exit code of the example's program.
fn program(arguments: &[&str]) -> u8 {
    let arguments = ["program"].iter().chain(arguments).chain(&["--backend", "cpu", "--quiet"]);
    run_with(&example::registry().unwrap(), arguments.map(OsString::from))
}

/// The configuration of the sled with `set` over it.
fn sled(set: &[&str]) -> reachcast::Result<Config> {
    let set = set.iter().map(ToString::to_string).collect();
    let registry = example::registry().unwrap();
    Config::load(SLED.as_ref(), &Overrides { set, registry, ..Overrides::default() })
}

#[test]
fn a_plant_of_ones_own_is_certified_checked_queried_and_rolled_out() {
    let folder = Folder::new();
    let (out, starts) = (folder.path("sled"), folder.path("starts.csv"));
    fs::write(&starts, "position,velocity\n0.8,0\n-0.9,0.1\n").unwrap();
    let draws = ["--set", "global.draws=2000", "--set", "global.share_draws=2000"];
    assert_eq!(program(&[&["certify", SLED, "--out", &out], &draws[..]].concat()), 0);
    assert_eq!(program(&["check", &out]), 0);
    assert_eq!(program(&["query", &out, "--states", &starts]), 0);
    let measures = folder.path("measures.csv");
    assert_eq!(program(&["rollout", SLED, "--starts", &starts, "--measures", &measures]), 0);
    let measures = fs::read_to_string(measures).unwrap();
    assert!(measures.lines().skip(1).all(|line| line.parse::<f32>().unwrap() > 0.0), "{measures}");
    // The program that does not know the plant says so.
    refused(&["check", &out], &["the system `sled`, which another program defines"]);
    refused(&["certify", SLED], &["sled", "is unknown", "drone-race"]);
}

#[test]
fn its_numbers_are_keys() {
    let drag = |config: &Config| config.plain_model().unwrap().parameters[0].value;
    assert_eq!(drag(&sled(&[]).unwrap()), 0.3);
    assert_eq!(drag(&sled(&["system.drag=0.5"]).unwrap()), 0.5);
    for (set, words) in [
        ("system.darg=0.5", "`system.drag`"),
        ("system.drag=much", "expected a finite number"),
        ("policy.formula=pusch", "formulas of sled: push"),
    ] {
        let config = sled(&[set]);
        let plant = config.and_then(|config| config.plant(&config.policy_source("".as_ref())?));
        let message = plant.unwrap_err().to_string();
        assert!(message.contains(words), "no `{words}` in: {message}");
    }
}

#[test]
fn what_is_stored_is_read_by_a_program_that_has_the_plant() {
    let config = sled(&["system.drag=0.5"]).unwrap();
    let json = config.to_json().unwrap();
    assert_eq!(json["system"], serde_json::json!({ "name": "sled", "drag": 0.5 }));
    let read = Config::from_json_of(&json, &example::registry().unwrap()).unwrap();
    assert_eq!(read.system, config.system);
    let message = Config::from_json(&json).unwrap_err().to_string();
    assert!(message.contains("which another program defines"), "{message}");
}

/// The double integrator under another name has the measures of the one that is carried, to the bit.
#[test]
fn a_registered_plant_runs_as_a_carried_one() {
    let registry = Registry::new().with("mass", |numbers| {
        let acceleration = numbers.number("acceleration", 1.0) as f32;
        let mass = DoubleIntegrator { acceleration, ..DoubleIntegrator::default() };
        let policy = Controller::of(&mass, BangBang { acceleration });
        Ok(Registered::new(Model::of(mass)).formula("bang-bang", policy))
    });
    let text = |name: &str| {
        let text = format!("system.name = \"{name}\"\npolicy.formula = \"bang-bang\"");
        toml::from_str(&text).unwrap()
    };
    let overrides = Overrides { registry: registry.unwrap(), ..Overrides::default() };
    let backend = Backend::cpu().unwrap();
    let starts = [[0.3_f32, 0.2], [0.9, 0.9], [-0.7, 0.4]];
    let measures = ["mass", "double-integrator"].map(|name| {
        let config = Config::from_table(text(name), name, &overrides).unwrap();
        let plant = config.plant(&config.policy_source("".as_ref()).unwrap()).unwrap();
        let spec = config.spec().unwrap();
        backend.prepare(&plant).unwrap().measures(&starts, &spec).unwrap()
    });
    assert_eq!(measures[0], measures[1]);
    assert!(measures[0].iter().any(|measure| *measure > 0.0));
}

#[test]
fn names_that_are_taken_are_refused() {
    let with = |registry: Registry, name: &str| {
        registry.with(name, |_| Ok(Registered::new(Model::of(DoubleIntegrator::default()))))
    };
    for name in ["sled", "drone-race"] {
        let message = with(example::registry().unwrap(), name).unwrap_err().to_string();
        assert!(message.contains(&format!("`{name}` is taken")), "{message}");
    }
    assert_eq!(with(example::registry().unwrap(), "cart").unwrap().names(), ["sled", "cart"]);
}

/// A folder that the library wrote is one that the program checks; another one in its place is refused.
#[test]
fn a_certificate_writes_the_folder_that_the_command_writes() {
    let config = sled(&["global.draws=2000", "global.share_draws=2000"]).unwrap();
    let plant = config.plant(&config.policy_source("".as_ref()).unwrap()).unwrap();
    let settings = config.settings(&plant.model.states).unwrap();
    let backend = Backend::cpu().unwrap();
    let program_ = backend.prepare(&plant).unwrap();
    let record = certify(&program_, &settings, config.to_json().unwrap(), &Unwatched).unwrap();
    let folder = Folder::new();
    let out = folder.path("sled");
    let certificate = Certificate::of(&plant, record).unwrap();
    let files = certificate.write(out.as_ref()).unwrap();
    assert!(files.iter().any(|file| file.ends_with(CERTIFICATE)), "{files:?}");
    assert_eq!(program(&["check", &out]), 0);
    let draws = ["--set", "global.draws=2000", "--set", "global.share_draws=2000"];
    let again = program(&[&["certify", SLED, "--out", &out], &draws[..]].concat());
    assert_eq!(again, 0, "the same work");
    let other = program(&["certify", SLED, "--out", &out, "--set", "global.draws=2001"]);
    assert_eq!(other, 2, "other work");
}
