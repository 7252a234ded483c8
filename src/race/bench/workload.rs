//! The workloads: what `bench` times on every backend, most of it on the plant of the race.

use std::hint::black_box;
use std::sync::Arc;

use super::data::{self, Data};
use super::scaling::roll;
use crate::backend::Backend;
use crate::bench::flops;
use crate::bench::workload::{Work, Workload, plan};
use crate::control::DriveBenchmark;
use crate::error::Result;
use crate::policy::Mlp;
use crate::race::system::DroneRace;
use crate::rollout::{
    DeviationTask, Fold, PairControl, Pairs, Plant, Purpose, Query, ReachAvoidTask, Starts, Stream,
    Tightening, trajectory,
};
use crate::scenario::Watch;
use crate::system::System;

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
/// Starts whose rollouts tell how soon a sign is decided.
const DECIDED: usize = 100;

/// What the benchmark runs with the data of `seed`.
///
/// # Errors
/// [`crate::Error::Invalid`] if what is compiled in is damaged.
pub(crate) fn work(seed: u64) -> Result<Work> {
    let data = Data::new(seed)?;
    let workloads = all(&data)?;
    let (_, network) = data.networks[0].clone();
    let batch = Box::new(move |backend: &Backend, count, watch: &dyn Watch| {
        roll(backend, &network, seed, count, watch)
    });
    Ok(Work { workloads, batch })
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
        let name = format!("mppi/lane/{samples}");
        all.push(plan(name, DroneRace::default(), data::lane(), spec, problem));
    }
    let DriveBenchmark { system, planner, problem } = DriveBenchmark::new(DRIVE_SAMPLES)?;
    let name = format!("mppi/drive/{DRIVE_SAMPLES}");
    all.push(plan(name, system, planner.cost, planner.spec, problem));
    Ok(all)
}

/// Measures of the first `count` starts in feedback with `network`.
fn rollouts(name: String, data: &Data, network: &Arc<Mlp>, count: u64) -> Result<Workload> {
    let steps = f64::from(data::HORIZON);
    reach_avoid(name, data, network, count, (Query::Measure, steps))
}

/// Their signs alone.
fn signs(name: String, data: &Data, policy: &Arc<Mlp>, count: u64) -> Result<Workload> {
    let steps = decided_steps(data, policy)?;
    reach_avoid(name, data, policy, count, (Query::Sign, steps))
}

fn reach_avoid(
    name: String,
    data: &Data,
    policy: &Arc<Mlp>,
    count: u64,
    (query, steps): (Query, f64),
) -> Result<Workload> {
    let spec = data::rollout_spec()?;
    let (policy, starts) = (Arc::clone(policy), Arc::clone(&data.starts));
    let system = DroneRace::default();
    let flops = flops::rollout(Plant { system: &system, policy: &*policy }, steps);
    let tightening = Tightening::none(&spec);
    let call = move |backend: &Backend| {
        let starts = Starts::listed(&*starts);
        let task = ReachAvoidTask { starts, range: 0..count, spec, tightening: &tightening, query };
        let plant = Plant { system: &system, policy: &*policy };
        backend.reach_avoid(plant, &task, &mut |_, measures| {
            black_box(measures);
            Ok(())
        })
    };
    Ok(Workload { name, unit: "rollout", units: count, steps, flops, call: Box::new(call) })
}

/// Mean number of steps until the sign of a measure is decided, over some of the starts.
fn decided_steps(data: &Data, policy: &Mlp) -> Result<f64> {
    let (system, spec) = (DroneRace::default(), data::rollout_spec()?);
    let plant = Plant { system: &system, policy };
    let steps = |start: &[f32; 12]| {
        let mut fold = Fold::new();
        let states = trajectory::<f32, _, _, 12, 3>(plant, *start, spec.horizon);
        let open = states.iter().take_while(|x| {
            fold.add(system.target(**x), system.constraint(**x), spec.gamma);
            fold.measure() <= 0.0 && fold.safe() > 0.0
        });
        open.count().min(spec.horizon as usize)
    };
    let starts = &data.starts[..DECIDED];
    Ok(starts.iter().map(steps).sum::<usize>() as f64 / starts.len() as f64)
}

/// Pairs around the first `count` starts, the perturbed rollout under the nominal controls.
fn pairs(name: String, data: &Data, network: &Arc<Mlp>, count: u64) -> Result<Workload> {
    let spec = data::rollout_spec()?;
    let (network, starts) = (Arc::clone(network), Arc::clone(&data.starts));
    let system = DroneRace::default();
    let steps = f64::from(spec.horizon);
    let flops = flops::replayed_pair(Plant { system: &system, policy: &*network }, steps);
    let tightening = Tightening::none(&spec);
    let stream = Stream::new(data.seed, Purpose::USER, 0);
    let call = move |backend: &Backend| {
        let task = DeviationTask {
            pairs: Pairs { nominal: Starts::listed(&*starts), radius: RADIUS, stream },
            range: 0..count,
            spec,
            tightening: &tightening,
            control: PairControl::Replay,
        };
        let plant = Plant { system: &system, policy: &*network };
        let farthest = backend.deviation(plant, &task, &mut |_, measures| {
            black_box(measures);
            Ok(())
        });
        farthest.map(|farthest| drop(black_box(farthest)))
    };
    Ok(Workload { name, unit: "pair", units: count, steps, flops, call: Box::new(call) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::Cpu;

    #[test]
    fn every_workload_runs_and_counts() {
        let data = Data::new(1).unwrap();
        let backend = Backend::Cpu(Cpu::new(Some(1)).unwrap());
        for workload in all(&data).unwrap() {
            assert!(workload.flops > 1000.0, "{workload:?}: {}", workload.flops);
            assert!(workload.name.ends_with(&workload.units.to_string()), "{workload:?}");
            if workload.call_flops() < 1e9 {
                workload.call(&backend).unwrap();
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
