//! Every plant under `configs/models` against its mathematics: formulas, rollouts on each backend,
//! certificates, plans.

mod backends;
mod certificates;
#[path = "../command/mod.rs"]
mod command;
#[path = "../common/mod.rs"]
mod common;
mod flying;
mod formulas;
mod ground;
mod levels;
mod network;
mod plans;
mod poles;
mod truth;

use std::path::{Path, PathBuf};

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::Error;
use reachcast::model::Plant;
use reachcast::model::text::read;
use toml::Table;

use truth::Truth;

/// Every plant that is carried as text.
fn all() -> Vec<Truth> {
    vec![
        ground::bicycle(),
        poles::cart_pole(),
        ground::diff_drive(),
        ground::double_integrator(),
        flying::drone_race(),
        ground::dubins(),
        poles::learned_pendulum(),
        poles::pendulum(),
        flying::planar_quadrotor(),
        flying::quadrotor(),
        levels::two_tanks(),
    ]
}

/// Where they lie.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/models")
}

impl Truth {
    /// The text of its file.
    fn text(&self) -> String {
        std::fs::read_to_string(folder().join(self.file)).expect("a file")
    }

    /// The plant of its file.
    fn plant(&self) -> Plant {
        plant(&self.text()).expect("a plant")
    }

    /// The horizon that its file asks for.
    fn horizon(&self) -> usize {
        let text: Table = self.text().parse().expect("a table");
        let horizon = text.get("rollout").and_then(|rollout| rollout.get("horizon"));
        horizon.map_or(30, |horizon| horizon.as_integer().expect("a number of steps") as usize)
    }

    /// Starts from the box of `plant`, some states of it scaled by `wider`.
    fn starts(&self, plant: &Plant, count: usize, wider: f32) -> Vec<Vec<f32>> {
        let mut random = StdRng::seed_from_u64(5);
        let mut draw = || {
            let axis = |axis: &reachcast::system::Axis| {
                let (middle, half) = ((axis.low + axis.high) / 2.0, (axis.high - axis.low) / 2.0);
                random.random_range(middle - wider * half..middle + wider * half)
            };
            plant.model.states.iter().map(axis).collect()
        };
        (0..count).map(|_| draw()).collect()
    }
}

/// The plant of `text`, whose networks lie beside the carried ones.
fn plant(text: &str) -> Result<Plant, Error> {
    let description = read(text, "carried.toml", &folder())?;
    Ok(Plant::new(description.model()?, description.controller()?))
}

/// `x` in f64.
fn wide(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

#[test]
fn every_carried_plant_has_its_mathematics_here() {
    let entries = std::fs::read_dir(folder()).expect("a folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().into_string());
    let mut names: Vec<String> = names.map(|name| name.expect("a name")).collect();
    names.retain(|name| name.ends_with(".toml"));
    names.sort();
    let known: Vec<&str> = all().iter().map(|truth| truth.file).collect();
    assert_eq!(names, known, "a file of configs/models without a truth, or the other way around");
}
