//! Plants given as text against the same plants as compiled, with every instruction set.

mod plants;

use std::hint::black_box;
use std::sync::Arc;

use reachcast::Result;
use reachcast::backend::cpu::Cpu;
use reachcast::backend::{Backend, PlanProgram, Program};
use reachcast::model::{Controller, Model, Plant, StageCost};
use reachcast::policy::Policy;
use reachcast::race::DroneRace;
use reachcast::race::bench::data::{self, Data};
use reachcast::rollout::{
    CostQuery, MppiTask, Planning, Purpose, Query, ReachAvoidTask, Region, Starts, Stream,
    Tightening,
};
use reachcast::system::System;

use crate::ratio;
use crate::scalar::Damping;
use plants::{Dubins, Feedback, Quadrotor};

/// Rollouts of a call.
const ROLLOUTS: u64 = 4096;
/// Samples of a plan.
const SAMPLES: u32 = 1024;
/// Smallest share of the rate of the compiled plant: formulas alone, and under a network.
const FORMULA: f64 = 0.45;
const NETWORK: f64 = 0.9;
/// The instruction sets that there are kernels for.
const SETS: [&str; 3] = ["AVX-512", "AVX2", "baseline instructions"];

/// Prints the shares; whether all are at least what they have to be.
pub(crate) fn hold() -> bool {
    let data = Data::new(1).expect("the data are whole");
    let cpus = Cpu::each(Some(1)).expect("one thread");
    for skipped in SETS.iter().filter(|set| cpus.iter().all(|cpu| cpu.instructions() != **set)) {
        println!("text against compiled: skipped with {skipped}, which this processor has not");
    }
    let held = cpus.into_iter().map(|cpu| hold_with(cpu, &data));
    held.fold(true, |all, one| all & one)
}

/// The same with the instructions of one.
fn hold_with(cpu: Cpu, data: &Data) -> bool {
    let (with, backend) = (cpu.instructions(), Backend::Cpu(cpu));
    let (race, backend) = (DroneRace::default(), &backend);
    let network = |name: &str| (**data.network(name).expect("a network of the data")).clone();
    let shares = [
        ("race", share(backend, race, Damping), FORMULA),
        ("dubins", share(backend, Dubins, Feedback), FORMULA),
        ("quadrotor", share(backend, Quadrotor, Feedback), FORMULA),
        ("mppi, race", plans(backend), FORMULA),
        ("race under 3x64", share(backend, race, network("3x64")), NETWORK),
        ("race under 3x128", share(backend, race, network("3x128")), NETWORK),
    ];
    for (name, share, floor) in shares {
        println!("{name:18} as text at {share:5.2} of compiled, at least {floor} expected, {with}");
        if share < floor {
            eprintln!("\n*** TEXT FELL BACK: {name} at {share:.2} of compiled under {with}\n");
        }
    }
    shares.iter().all(|(_, share, floor)| share >= floor)
}

/// The rate of a plant as text over that of the same plant as compiled.
fn share<S, P, const NX: usize, const NU: usize>(backend: &Backend, system: S, policy: P) -> f64
where
    S: System<NX, NU> + Clone + Send + Sync + 'static,
    P: Policy<NX, NU> + Clone + Send + Sync + 'static,
{
    let compiled = Plant::of(system.clone(), policy.clone());
    let Controller { name, law, .. } = Controller::of(&system, policy);
    let starts = starts(&system);
    let text = Plant::new(Model::of(system).as_text(), Controller::new(name, law));
    let [text, compiled] =
        [&text, &compiled].map(|plant| backend.prepare(plant).expect("a sound plant"));
    1.0 / ratio(|| measures(&text, &starts), || measures(&compiled, &starts))
}

/// The rate of plans of the race as text over that of the same plans as compiled.
fn plans(backend: &Backend) -> f64 {
    let spec = data::mppi_spec(SAMPLES).expect("settings");
    let compiled = Planning::of(&DroneRace::default(), data::lane(), spec);
    let text = Planning {
        model: Arc::new(Model::clone(&compiled.model).as_text()),
        cost: Arc::new(StageCost::clone(&compiled.cost).as_text()),
        ..compiled.clone()
    };
    let [text, compiled] =
        [&text, &compiled].map(|planning| backend.prepare_plans(planning).expect("sound plans"));
    let problems = [data::mppi_problem(1, 0)];
    let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Summary };
    let improve =
        |program: &PlanProgram<'_>| program.improve(&task).map(|plan| drop(black_box(plan)));
    1.0 / ratio(|| improve(&text), || improve(&compiled))
}

/// Starts in the default box of `system`.
fn starts<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> Vec<[f32; NX]> {
    let stream = Stream::new(1, Purpose::USER, 0);
    let axes = system.states();
    let region = Region::new_box(axes.each_ref().map(|axis| axis.low), axes.map(|axis| axis.high));
    let region = region.expect("a box");
    let start = |i| region.point(stream, i).try_into().expect("a state");
    (0..ROLLOUTS).map(start).collect()
}

/// One call: the measures of all starts.
fn measures<const NX: usize>(program: &Program<'_>, starts: &[[f32; NX]]) -> Result<()> {
    let spec = data::rollout_spec().expect("a valid specification");
    let task = ReachAvoidTask {
        starts: Starts::listed(starts),
        range: 0..ROLLOUTS,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    program.reach_avoid(&task, &mut |_, measures| {
        black_box(measures);
        Ok(())
    })
}
