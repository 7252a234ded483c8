//! The workloads: what `bench` times on every backend, most of it on the plant of the race.

use std::sync::Arc;

use super::data::{self, Data};
use crate::bench::workload::{Batch, Kind, Rollouts, Work, Workload};
use crate::bench::{self, flops};
use crate::control::DriveBenchmark;
use crate::error::Result;
use crate::model::Plant;
use crate::policy::Mlp;
use crate::race::system::DroneRace;
use crate::rollout::{
    Fold, MppiProblem, Planning, Purpose, Query, Region, StateList, Stream, replay,
};

/// Batches of rollouts: the scenarios of a certificate, and those that fill a machine.
const BATCHES: [u64; 3] = [158, 4096, 65_536];
/// Pairs of the deviation bound.
const PAIRS: u64 = 16_384;
/// Radius of their perturbations.
const RADIUS: f32 = 0.1;
/// Samples of a plan.
const SAMPLES: [u32; 2] = [1024, 16_384];
/// Samples of the published benchmark of MPPI.
const DRIVE_SAMPLES: u32 = 16_384;
/// Number of the stream of the starts of the growing batch.
const BATCH_STREAM: u32 = 1 << 17;
/// Starts whose rollouts tell how soon a sign is decided.
const DECIDED: usize = 100;

/// What the benchmark runs with the data of `seed`.
///
/// # Errors
/// [`crate::Error::Invalid`] if what is compiled in is damaged.
pub(crate) fn work(seed: u64) -> Result<Work> {
    let data = Data::new(seed)?;
    let (_, network) = &data.networks[0];
    let plant = Plant::of(DroneRace::default(), Mlp::clone(network));
    let axes = &plant.model.states;
    let low: Vec<f32> = axes.iter().map(|axis| axis.low).collect();
    let region = Region::new_box(low, axes.iter().map(|axis| axis.high).collect::<Vec<_>>())?;
    let stream = Stream::new(seed, bench::PURPOSE, BATCH_STREAM);
    let batch = Batch { plant, region, stream, spec: data::rollout_spec()? };
    Ok(Work { workloads: all(&data)?, batch })
}

/// All workloads.
///
/// # Errors
/// None: what they are made of is valid.
pub(super) fn all(data: &Data) -> Result<Vec<Workload>> {
    let mut all = Vec::new();
    for (name, network) in &data.networks {
        for count in BATCHES {
            all.push(rollouts(format!("rollout/{name}/{count}"), data, network, count)?);
        }
    }
    all.push(signs("sign/race/65536".to_owned(), data, &data.policy, 65_536)?);
    let (name, network) = &data.networks[0];
    all.push(pairs(format!("deviation/{name}/{PAIRS}"), data, network, PAIRS)?);
    for samples in SAMPLES {
        let (spec, problem) = (data::mppi_spec(samples)?, data::mppi_problem(data.seed, 0));
        let planning = Planning::of(&DroneRace::default(), data::lane(), spec);
        all.push(plan(format!("mppi/lane/{samples}"), planning, problem));
    }
    let DriveBenchmark { planning, problem, .. } = DriveBenchmark::new(DRIVE_SAMPLES)?;
    all.push(plan(format!("mppi/drive/{DRIVE_SAMPLES}"), planning, problem));
    Ok(all)
}

/// Measures of the first `count` starts in feedback with `network`.
fn rollouts(name: String, data: &Data, network: &Arc<Mlp>, count: u64) -> Result<Workload> {
    let steps = f64::from(data::HORIZON);
    reach_avoid(name, data, network, count, Query::Measure, steps)
}

/// Their signs alone.
fn signs(name: String, data: &Data, policy: &Arc<Mlp>, count: u64) -> Result<Workload> {
    let steps = decided_steps(data, policy)?;
    reach_avoid(name, data, policy, count, Query::Sign, steps)
}

fn reach_avoid(
    name: String,
    data: &Data,
    policy: &Arc<Mlp>,
    count: u64,
    query: Query,
    steps: f64,
) -> Result<Workload> {
    let rollouts = driven(data, policy, count)?;
    let flops = flops::rollout(&rollouts.plant, steps);
    let kind = Kind::Measures { rollouts, query };
    Ok(Workload { name, unit: "rollout", units: count, steps, flops, kind })
}

/// The first `count` starts in feedback with `network`.
fn driven(data: &Data, network: &Arc<Mlp>, count: u64) -> Result<Rollouts> {
    let plant = Plant::of(DroneRace::default(), Mlp::clone(network));
    let starts = Arc::new(StateList::new(12).with(data.starts.iter()));
    Ok(Rollouts { plant, starts, count, spec: data::rollout_spec()? })
}

/// Mean number of steps until the sign of a measure is decided, over some of the starts.
fn decided_steps(data: &Data, policy: &Mlp) -> Result<f64> {
    let spec = data::rollout_spec()?;
    let plant = Plant::of(DroneRace::default(), Mlp::clone(policy));
    let steps = |start: &[f32; 12]| {
        let mut fold = Fold::new();
        let states = replay::states::<f32>(&plant, start, spec.horizon);
        let open = (0..).zip(&states).take_while(|(step, x)| {
            let model = &plant.model;
            fold.add(model.target_at(x, *step), model.constraint_at(x, *step), spec.gamma);
            fold.measure() <= 0.0 && fold.safe() > 0.0
        });
        open.count().min(spec.horizon as usize)
    };
    let starts = &data.starts[..DECIDED];
    Ok(starts.iter().map(steps).sum::<usize>() as f64 / starts.len() as f64)
}

/// Pairs around the first `count` starts, the perturbed rollout under the nominal controls.
fn pairs(name: String, data: &Data, network: &Arc<Mlp>, count: u64) -> Result<Workload> {
    let steps = f64::from(data::HORIZON);
    let rollouts = driven(data, network, count)?;
    let flops = flops::replayed_pair(&rollouts.plant, steps);
    let stream = Stream::new(data.seed, Purpose::USER, 0);
    let kind = Kind::Pairs { rollouts, radius: RADIUS, stream };
    Ok(Workload { name, unit: "pair", units: count, steps, flops, kind })
}

/// One improvement of a plan, its noise drawn anew.
fn plan(name: String, planning: Planning, problem: MppiProblem) -> Workload {
    let flops = flops::sample(&planning);
    let settings = planning.spec.settings();
    let (units, steps) = (u64::from(settings.samples), f64::from(settings.horizon));
    Workload { name, unit: "sample", units, steps, flops, kind: Kind::Plan { planning, problem } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::Backend;
    use crate::backend::cpu::Cpu;

    #[test]
    fn every_workload_runs_and_counts() {
        let data = Data::new(1).unwrap();
        let backend = Backend::Cpu(Cpu::new(Some(1)).unwrap());
        for workload in all(&data).unwrap() {
            assert!(workload.flops > 1000.0, "{workload:?}: {}", workload.flops);
            assert!(workload.name.ends_with(&workload.units.to_string()), "{workload:?}");
            if workload.call_flops() < 1e9 {
                workload.prepare(&backend).unwrap().call().unwrap();
            }
        }
    }

    /// The sign of many starts is decided early: the point of the early exit.
    #[test]
    fn signs_are_decided_before_the_horizon() {
        let data = Data::new(1).unwrap();
        let steps = decided_steps(&data, &data.policy).unwrap();
        assert!(steps > 1.0 && steps < 30.0, "{steps}");
    }
}
