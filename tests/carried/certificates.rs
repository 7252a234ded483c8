//! Each file as it lies there is a configuration that certifies a part of its box.

use serde_json::Value;

use super::all;
use super::command::{Folder, reachcast, refused};

/// What makes a certificate small.
const SMALL: [&str; 5] = [
    "deviation.pilot=100",
    "drops.pilot=100",
    "global.draws=800",
    "global.share_draws=800",
    "growth.rounds=3",
];

fn small() -> Vec<&'static str> {
    SMALL.iter().flat_map(|set| ["--set", set]).collect()
}

#[test]
fn each_configuration_certifies_a_part_of_its_box() {
    let folder = Folder::new();
    for truth in all() {
        let (config, out) = (format!("configs/models/{}", truth.file), folder.path(truth.file));
        let arguments = ["certify", &config, "--backend", "cpu", "--out", &out, "-q"];
        let (code, _, message) = reachcast(&[&arguments[..], &small()].concat());
        assert!(matches!(code, Some(0 | 3)), "{config}: {message}");
        let text = std::fs::read_to_string(format!("{out}/certificate.json")).expect("a record");
        let record: Value = serde_json::from_str(&text).expect("a document");
        let least = record["global"]["share"]["interval"][0].as_f64().expect("a share");
        println!("{}: at least {least}", truth.file);
        assert!(least > 0.01, "{config}: {least} of the box is certified");
    }
}

fn words(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

/// A radius of growth whose first rounds f32 is too coarse for is refused with one that is large enough.
#[test]
fn a_radius_that_is_too_small_is_told_what_is_enough() {
    let folder = Folder::new();
    let out = folder.path("bicycle");
    let with = |radius: &str| -> Vec<String> {
        let radius = format!("growth.radius={radius}");
        let arguments =
            ["certify", "configs/models/bicycle.toml", "--backend", "cpu", "--set", &radius];
        arguments.iter().chain(&["--out", &out]).map(|word| (*word).to_owned()).collect()
    };
    let first = "of the radii up to 0.1, the first one, 0.001441, is below 0.003815";
    refused(&words(&with("0.1")), &["growth.radius", first, "take 0.2647 or more"]);
    refused(&words(&with("0.2646")), &["growth.radius"]);
    let enough = with("0.2647");
    let (code, _, message) = reachcast(&[words(&enough), small()].concat());
    assert!(matches!(code, Some(0 | 3)), "{message}");
}
