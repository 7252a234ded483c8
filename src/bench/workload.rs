//! The workloads: what is timed on every backend, with its operations counted.

use std::fmt;
use std::hint::black_box;
use std::sync::Arc;

use super::data::{self, Data};
use super::flops;
use crate::backend::{Backend, PlanProgram, Program};
use crate::control::DriveBenchmark;
use crate::error::Result;
use crate::model::Plant;
use crate::policy::Mlp;
use crate::race::system::DroneRace;
use crate::rollout::{
    self, CostQuery, DeviationTask, Fold, MppiProblem, MppiTask, PairControl, Pairs, Planning,
    Purpose, Query, ReachAvoidTask, RolloutSpec, Starts, Stream, Tightening, trajectory,
};
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

/// Work of a fixed size that any backend does in one call.
pub struct Workload {
    /// Kind, what it runs on, and size: `rollout/3x64/158`.
    pub name: String,
    /// What is counted: `rollout`, `pair` or `sample`.
    pub unit: &'static str,
    /// Units of a call.
    pub units: u64,
    /// Steps of a unit; for signs, which end as soon as they are decided, the mean.
    pub steps: f64,
    /// Floating-point operations of a unit, as [`flops`] counts them.
    pub flops: f64,
    work: Work,
}

/// What a workload does.
enum Work {
    Measures { rollouts: Rollouts, query: Query },
    Pairs { rollouts: Rollouts, stream: Stream },
    Plan { planning: Planning, problem: MppiProblem },
}

/// Rollouts of listed starts.
struct Rollouts {
    plant: Plant,
    starts: Arc<[[f32; 12]]>,
    count: u64,
    spec: RolloutSpec,
    tightening: Tightening,
}

/// A workload prepared on a backend, for any number of calls.
pub struct PreparedWorkload<'a> {
    workload: &'a Workload,
    program: Prepared<'a>,
}

/// What a backend keeps of it.
enum Prepared<'a> {
    Plant(Program<'a>),
    Plans(PlanProgram<'a>),
}

impl Workload {
    /// Prepares the work on `backend`.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn prepare<'a>(&'a self, backend: &'a Backend) -> Result<PreparedWorkload<'a>> {
        let program = match &self.work {
            Work::Measures { rollouts, .. } | Work::Pairs { rollouts, .. } => {
                Prepared::Plant(backend.prepare(&rollouts.plant)?)
            }
            Work::Plan { planning, .. } => Prepared::Plans(backend.prepare_plans(planning)?),
        };
        Ok(PreparedWorkload { workload: self, program })
    }

    /// Floating-point operations of a call.
    pub fn call_flops(&self) -> f64 {
        self.units as f64 * self.flops
    }
}

impl PreparedWorkload<'_> {
    /// Does the work once.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn call(&self) -> Result<()> {
        match (&self.workload.work, &self.program) {
            (Work::Measures { rollouts, query }, Prepared::Plant(program)) => {
                measures(program, rollouts, *query)
            }
            (Work::Pairs { rollouts, stream }, Prepared::Plant(program)) => {
                deviations(program, rollouts, *stream)
            }
            (Work::Plan { problem, .. }, Prepared::Plans(program)) => {
                let problems = std::slice::from_ref(problem);
                let task = MppiTask { problems, iteration: 0, costs: CostQuery::Summary };
                program.improve(&task).map(|plans| drop(black_box(plans)))
            }
            _ => unreachable!("a workload is prepared as what it is"),
        }
    }
}

/// Measures or signs of the starts.
fn measures(program: &Program<'_>, rollouts: &Rollouts, query: Query) -> Result<()> {
    let Rollouts { starts, count, spec, tightening, .. } = rollouts;
    let starts = Starts::listed(&**starts);
    let task = ReachAvoidTask { starts, range: 0..*count, spec: *spec, tightening, query };
    program.reach_avoid(&task, &mut |_, measures| {
        black_box(measures);
        Ok(())
    })
}

/// Pairs around the starts, the perturbed rollout under the nominal controls.
fn deviations(program: &Program<'_>, rollouts: &Rollouts, stream: Stream) -> Result<()> {
    let Rollouts { starts, count, spec, tightening, .. } = rollouts;
    let task = DeviationTask {
        pairs: Pairs { nominal: Starts::listed(&**starts), radius: RADIUS, stream },
        range: 0..*count,
        spec: *spec,
        tightening,
        control: PairControl::Replay,
    };
    let farthest = program.deviation(&task, &mut |_, measures| {
        black_box(measures);
        Ok(())
    });
    farthest.map(|farthest| drop(black_box(farthest)))
}

impl fmt::Debug for Workload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Workload").field(&self.name).finish()
    }
}

/// All workloads.
///
/// # Errors
/// None: what they are made of is valid.
pub fn all(data: &Data) -> Result<Vec<Workload>> {
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
        let (system, cost) = (DroneRace::default(), data::lane());
        let flops = flops::sample(&system, &cost, spec.horizon());
        let planning = Planning::of(&system, cost, spec);
        all.push(plan(format!("mppi/lane/{samples}"), flops, planning, problem));
    }
    let DriveBenchmark { system, cost, planning, problem } = DriveBenchmark::new(DRIVE_SAMPLES)?;
    let flops = flops::sample(&system, &cost, planning.spec.horizon());
    all.push(plan(format!("mppi/drive/{DRIVE_SAMPLES}"), flops, planning, problem));
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
    let flops = rollout::Plant { system: &DroneRace::default(), policy: &**policy };
    let flops = flops::rollout(flops, steps);
    let work = Work::Measures { rollouts: driven(data, policy, count)?, query };
    Ok(Workload { name, unit: "rollout", units: count, steps, flops, work })
}

/// The first `count` starts in feedback with `network`.
fn driven(data: &Data, network: &Arc<Mlp>, count: u64) -> Result<Rollouts> {
    let spec = data::rollout_spec()?;
    let plant = Plant::of(DroneRace::default(), Mlp::clone(network));
    let (starts, tightening) = (Arc::clone(&data.starts), Tightening::none(&spec));
    Ok(Rollouts { plant, starts, count, spec, tightening })
}

/// Mean number of steps until the sign of a measure is decided, over some of the starts.
fn decided_steps(data: &Data, policy: &Mlp) -> Result<f64> {
    let (system, spec) = (DroneRace::default(), data::rollout_spec()?);
    let plant = rollout::Plant { system: &system, policy };
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
    let steps = f64::from(data::HORIZON);
    let plant = rollout::Plant { system: &DroneRace::default(), policy: &**network };
    let flops = flops::replayed_pair(plant, steps);
    let stream = Stream::new(data.seed, Purpose::User, 0);
    let work = Work::Pairs { rollouts: driven(data, network, count)?, stream };
    Ok(Workload { name, unit: "pair", units: count, steps, flops, work })
}

/// One improvement of a plan, its noise drawn anew.
fn plan(name: String, flops: f64, planning: Planning, problem: MppiProblem) -> Workload {
    let settings = planning.spec.settings();
    let (units, steps) = (u64::from(settings.samples), f64::from(settings.horizon));
    let work = Work::Plan { planning, problem };
    Workload { name, unit: "sample", units, steps, flops, work }
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
