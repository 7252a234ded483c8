//! What the workloads run on, and what they come to, as files that other programs read.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::data::{self, Data};
use crate::backend::Backend;
use crate::error::Result;
use crate::files::{Existing, Staged, check_room, json, npy_bytes};
use crate::model::Plant;
use crate::policy::Mlp;
use crate::race::cost::RaceCost;
use crate::race::system::DroneRace;
use crate::rollout::{CostQuery, MppiTask, Planning};

/// Starts whose measures are exported.
const MEASURES: usize = 4096;
/// Samples of the plan whose controls and costs are exported.
const SAMPLES: u32 = 1024;

/// Version of the layout of `settings.json`.
const EXPORT_SCHEMA: u32 = 1;
/// Room for all files, bytes.
const EXPORT_BYTES: u64 = 8 << 20;

/// The numbers beside the arrays: `settings.json`.
#[derive(Serialize)]
struct Settings {
    schema: u32,
    seed: u64,
    horizon: u32,
    gamma: f32,
    networks: Vec<String>,
    starts: usize,
    measures: usize,
    mppi: MppiNumbers,
}

/// Those of the plans.
#[derive(Serialize)]
struct MppiNumbers {
    horizon: u32,
    samples: u32,
    temperature: f32,
    sigma: f32,
    speed: f32,
    start: [f32; 12],
    cost: RaceCost,
}

/// Writes to `folder`, all or nothing:
///
/// * `settings.json`: the numbers;
/// * `NAME.safetensors` for each network, and `race.safetensors` for the trained policy;
/// * `starts.npy`, f32 `[starts, 12]`, and for each network and the policy `NAME_measures.npy`, f32
///   `[measures, 1]`, the reach-avoid measures of the first of them;
/// * `mppi_controls.npy`, f32 `[samples, 3 H]`, `mppi_costs.npy`, f32 `[samples, 1]`, and
///   `mppi_plan.npy`, f32 `[H, 3]`: the clipped controls of each sample, step by step, their costs,
///   and the improved plan.
///
/// # Errors
/// Those of the backend, [`crate::Error::Write`] and [`crate::Error::NoRoom`].
pub(crate) fn export(
    backend: &Backend,
    seed: u64,
    folder: &Path,
    existing: Existing,
) -> Result<Vec<PathBuf>> {
    let mut staged = Staged::new(folder)?;
    check_room(folder, EXPORT_BYTES)?;
    let data = Data::new(seed)?;
    let networks = data.networks.iter().map(|(name, network)| (*name, &**network));
    let networks: Vec<_> = networks.chain([("race", &*data.policy)]).collect();
    for (name, network) in &networks {
        staged.add(&format!("{name}.safetensors"), &network.to_bytes())?;
        let measures = measures(backend, &data, network)?;
        let bytes = npy_bytes(&measures, [measures.len(), 1]);
        staged.add(&format!("{name}_measures.npy"), &bytes)?;
    }
    let starts = data.starts.as_flattened();
    staged.add("starts.npy", &npy_bytes(starts, [data.starts.len(), 12]))?;
    export_plan(backend, seed, &mut staged)?;
    let names = networks.iter().map(|(name, _)| (*name).to_owned()).collect();
    let settings = json("settings.json", &settings(seed, names))?;
    staged.add("settings.json", settings.as_bytes())?;
    staged.publish_sparing(existing)
}

fn settings(seed: u64, networks: Vec<String>) -> Settings {
    Settings {
        schema: EXPORT_SCHEMA,
        seed,
        horizon: data::HORIZON,
        gamma: data::GAMMA,
        networks,
        starts: data::STARTS,
        measures: MEASURES,
        mppi: MppiNumbers {
            horizon: data::PLAN,
            samples: SAMPLES,
            temperature: data::TEMPERATURE,
            sigma: data::SIGMA,
            speed: data::SPEED,
            start: data::PLAN_START,
            cost: data::lane(),
        },
    }
}

/// The measures of the first [`MEASURES`] starts.
fn measures(backend: &Backend, data: &Data, network: &Mlp) -> Result<Vec<f32>> {
    let plant = Plant::of(DroneRace::default(), network.clone());
    backend.prepare(&plant)?.measures(&data.starts[..MEASURES], &data::rollout_spec()?)
}

/// Samples, costs and the improved plan of one problem.
fn export_plan(backend: &Backend, seed: u64, staged: &mut Staged) -> Result<()> {
    let (spec, problem) = (data::mppi_spec(SAMPLES)?, data::mppi_problem(seed, 0));
    let problems = std::slice::from_ref(&problem);
    let task = MppiTask { problems, iteration: 0, costs: CostQuery::Each };
    let planning = Planning::of(&DroneRace::default(), data::lane(), spec);
    let controls: Vec<f32> = (0..SAMPLES).flat_map(|k| planning.controls(&problem, 0, k)).collect();
    let (samples, horizon) = (SAMPLES as usize, data::PLAN as usize);
    let shape = [samples, 3 * horizon];
    staged.add("mppi_controls.npy", &npy_bytes(&controls, shape))?;
    for plan in backend.prepare_plans(&planning)?.improve(&task)? {
        staged.add("mppi_costs.npy", &npy_bytes(&plan.costs, [samples, 1]))?;
        staged.add("mppi_plan.npy", &npy_bytes(&plan.plan, [horizon, 3]))?;
    }
    Ok(())
}
