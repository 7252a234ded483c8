//! `query` from outside: what it says of states beside their tier, as the library says it.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, document, done, reachcast};
use reachcast::config::Config;
use reachcast::rollout::replay::states_margins;
use reachcast::scenario::deterministic::{Deterministic, Kind};
use reachcast::scenario::record::Record;

const LINE: &str = "configs/double_integrator.toml";
/// At rest near the middle, at rest near the wall, too fast, in the target.
const STATES: [[f32; 2]; 4] = [[0.5, 0.0], [-0.9, 0.25], [0.9, 1.4], [0.0, 0.0]];

/// A certificate in a folder of its own, by these settings.
fn certified(folder: &Folder, sets: &str) -> (String, Record) {
    let out = folder.path("out");
    let small =
        "--set global.draws=2000 --set slice.x.step=0.5 --set slice.y.step=0.5 --backend cpu -q";
    let mut words = vec!["certify", LINE, "--out", &out];
    words.extend(small.split_whitespace().chain(sets.split_whitespace()));
    let output = reachcast(&words);
    assert!(matches!(output.0, Some(0 | 3)), "{output:?}");
    let text = std::fs::read_to_string(folder.path("out/certificate.json")).unwrap();
    (out, Record::read(&text).unwrap())
}

/// A file with the states.
fn states(folder: &Folder) -> String {
    let path = folder.path("states.csv");
    let line = |x: &[f32; 2]| format!("{},{}\n", x[0], x[1]);
    std::fs::write(&path, STATES.iter().map(line).collect::<String>()).unwrap();
    path
}

#[test]
fn radius_score_and_calibration_are_those_of_the_library() {
    let folder = Folder::new();
    let sets = "--set deterministic.kind=tube --set deterministic.starts=100 \
                --set deterministic.radii=4 --set global.tightening=drops --set drops.pilot=100 \
                --set global.share_draws=500";
    let (out, record) = certified(&folder, sets);
    let states = states(&folder);
    let said = document(&["query", &out, "--states", &states, "--backend", "cpu"]);
    let config = Config::from_json(&record.provenance.config).unwrap();
    let plant = config.plant(&config.policy_source(std::path::Path::new("")).unwrap()).unwrap();
    let (spec, drops) = (config.spec().unwrap(), record.drops.as_ref().unwrap());
    let control = record.deviation.control;
    let certificate = Deterministic::new(&plant, spec, control, Kind::Tube).unwrap();
    let (level, alpha) = (said["level"].as_f64().unwrap(), said["alpha"].as_f64().unwrap());
    assert_eq!(level, record.sequence.as_ref().unwrap().level().unwrap());
    assert_eq!(alpha, record.calibration.as_ref().unwrap().level);
    let mut radii = Vec::new();
    for (x, row) in STATES.iter().zip(said["rows"].as_array().unwrap()) {
        let radius = row["radius"].as_f64().unwrap();
        assert_eq!(radius, certificate.radius(x, 8.0 * f64::from(0.02_f32)), "{x:?}");
        radii.push(radius);
        let truth = drops.shapes().score(&states_margins(&plant, x, &spec));
        let score = row["score"].as_f64().unwrap();
        assert!((score - truth).abs() < 1e-4 * truth.abs().max(1.0), "{x:?}: {score}, {truth}");
        assert_eq!(row["check_margin"].as_f64().unwrap() > 0.0, score > level, "{x:?}");
        let measure = row["measure"].as_f64().unwrap();
        assert_eq!(row["calibrated"].as_bool().unwrap(), measure > alpha, "{x:?}");
    }
    assert!(radii[0] > 0.02 && radii[2] == 0.0, "{radii:?}");
    let table = done(&["query", &out, "--states", &states, "--backend", "cpu"]);
    let head = "index,tier,check_margin,target_margin,score,measure,calibrated,radius";
    assert_eq!(table.lines().next().unwrap(), head);
    assert!(table.lines().skip(1).all(|line| line.split(',').count() == 8), "{table}");
    let answers = folder.path("answers");
    let words = done(&["query", &out, "--states", &states, "--backend", "cpu", "--out", &answers]);
    assert!(words.contains("radius at least 0.02): ") && words.contains("calibrated ("), "{words}");
}

#[test]
fn what_a_certificate_does_not_have_is_no_column() {
    let folder = Folder::new();
    let (out, _) = certified(&folder, "--set global.tightening=lipschitz");
    let table = done(&["query", &out, "--states", &states(&folder), "--backend", "cpu"]);
    assert_eq!(table.lines().next().unwrap(), "index,tier,check_margin,target_margin");
    let help = done(&["query", "--help"]);
    assert!(["score", "calibrated", "radius"].iter().all(|word| help.contains(word)), "{help}");
}

/// An attempt has betas of sixteen digits, and growth may verify another set than a ball.
#[test]
fn attempts_and_shapes_are_told_in_short_and_true_words() {
    let folder = Folder::new();
    let out = folder.path("out");
    let words = "--set growth.method=upward --set growth.shape=ellipsoid --set growth.pilot=500 \
                 --set global.draws=2000 --set slice.x.step=0.5 --set slice.y.step=0.5 --backend cpu";
    let mut arguments = vec!["certify", LINE, "--out", &out, "--attempt", "2"];
    arguments.extend(words.split_whitespace());
    let (_, text, _) = reachcast(&arguments);
    // 6 / (2 pi)^2 of a thousandth is 0.00015198...
    assert!(text.contains("confidence 1 - 0.000152") && !text.contains("0.0001519"), "{text}");
    assert!(text.contains("verified an ellipsoid of radius"), "{text}");
    let page = std::fs::read_to_string(folder.path("out/report.html")).unwrap();
    assert!(page.contains("radius of the verified ellipsoid"));
    for ball in ["verified ball", "ball centre", "in the ball", "whole ball", "Certified set, ball"]
    {
        assert!(!page.contains(ball), "{ball}");
    }
    let states = states(&folder);
    let answers = folder.path("answers");
    let said = done(&["query", &out, "--states", &states, "--backend", "cpu", "--out", &answers]);
    assert!(said.contains("in the verified ellipsoid"), "{said}");
}
