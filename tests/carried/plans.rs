//! Each file has costs to plan with, and plans that do its task.

use serde_json::Value;

use super::command::{Folder, document};
use super::ground::clearance;
use super::{all, folder};

/// Runs of each file: more where much of the box is beyond any plan.
fn runs(file: &str) -> usize {
    match file {
        "double_integrator.toml" | "drone_race.toml" => 20,
        _ => 3,
    }
}

/// Some runs of each do the task.
#[test]
fn each_configuration_plans() {
    let folder = Folder::new();
    for truth in all() {
        let (config, out) = (format!("configs/models/{}", truth.file), folder.path(truth.file));
        let arguments = ["plan", &config, "--backend", "cpu", "--out", &out, "-q"];
        let count = runs(truth.file);
        let asked = format!("plan.runs={count}");
        let small = ["--set", &asked, "--set", "plan.samples=256"];
        let record = document(&[&arguments[..], &small].concat());
        let runs = record["runs"].as_array().expect("runs");
        let successes = runs.iter().filter(|run| run["success"] == Value::Bool(true)).count();
        println!("{}: {successes} of {}", truth.file, runs.len());
        assert!(runs.len() == count && successes >= 2, "{config}: {successes} of {}", runs.len());
    }
}

/// The map of the differential drive is made of the clearance that its constraint knows.
#[test]
fn the_map_is_of_the_pillars_and_walls() {
    let bytes = std::fs::read(folder().join("diff_drive_room.npy")).expect("a map");
    let map = npyz::NpyFile::new(&bytes[..]).expect("an array");
    assert_eq!(map.shape(), [40, 60]);
    let cells: Vec<f32> = map.into_vec().expect("numbers");
    for (i, cell) in cells.into_iter().enumerate() {
        let place = [i % 60, i / 60].map(|at| 0.1 * (at as f64 + 0.5));
        let wanted = (1.0 - clearance(place) / 0.25).clamp(0.0, 1.0).powi(2);
        assert!((f64::from(cell) - wanted).abs() < 1e-6, "{place:?}: {cell}, not {wanted}");
    }
}
