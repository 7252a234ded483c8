//! Guards the SIMD dispatch: fails loudly if lanes fall back to the speed of a plain loop.
//!
//! On one thread, the native backend runs the same rollouts as a scalar loop over the same formulas.
//! Vectorisation by the compiler is fragile, and a body that is not inlined into its instruction set
//! still gives the right numbers: only the ratio of the two tells. The compiler vectorises the plain
//! loop across states as well, so the ratios are not the number of lanes.

mod scalar;
mod text;

use std::hint::black_box;
use std::process::ExitCode;

use reachcast::Result;
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::bench::measure::{Protocol, measure};
use reachcast::model::Plant;
use reachcast::policy::{Activation, Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::race::bench::data::{self, Data};
use reachcast::rollout::{
    CostQuery, MppiTask, Planning, Query, ReachAvoidTask, RolloutSpec, Starts, Tightening,
};

use scalar::Damping;

/// Rollouts of a call.
const ROLLOUTS: usize = 1024;
/// Samples of a plan.
const SAMPLES: u32 = 1024;
/// Turns of each side; its best call counts.
const TURNS: usize = 5;
/// How long a turn is.
const TURN: Protocol = Protocol { warm_up_seconds: 0.02, budget_seconds: 0.1, least_calls: 3 };

/// Smallest ratios to the scalar loop: rollouts under a formula, under a network, and plans.
struct Floors {
    physics: f64,
    dense: f64,
    plan: f64,
}

/// The floors of an instruction set, as [`Cpu::instructions`] names it: two thirds to three quarters
/// of what an AMD EPYC (Zen 4) does with it, where repeats agree within a few per cent when both
/// sides take turns. That is 3.6, 28 and 15.7 for AVX-512; 2.7, 28 and 12.1 for AVX2; 1.5, 9.5 and 4.1
/// for the baseline of x86-64.
fn floors(instructions: &str) -> Floors {
    match instructions {
        "AVX-512" => Floors { physics: 2.5, dense: 18.0, plan: 10.5 },
        "AVX2" => Floors { physics: 1.8, dense: 18.0, plan: 8.0 },
        _ => Floors { physics: 1.05, dense: 6.0, plan: 2.8 },
    }
}

fn main() -> ExitCode {
    let cpu = Cpu::new(Some(1)).expect("one thread");
    let (instructions, device) = (cpu.instructions(), cpu.device());
    let floors = floors(instructions);
    let (backend, data) = (Backend::Cpu(cpu), Data::new(1).expect("the data are whole"));
    let (_, network) = &data.networks[0];
    println!("lanes against a scalar loop, one thread of {device}");
    let ratios = [
        ("physics", rollouts(&backend, &Damping, &data), floors.physics),
        ("dense 3x64", rollouts(&backend, &**network, &data), floors.dense),
        ("mppi", plans(&backend), floors.plan),
    ];
    let mut sound = true;
    for (name, ratio, floor) in ratios {
        println!("{name:12} {ratio:7.1} times as fast, at least {floor} expected");
        if ratio < floor {
            sound = false;
            eprintln!(
                "\n*** LANES FELL BACK: {name} runs at {ratio:.2} times the scalar loop under \
                 {instructions}; the floor is {floor}.\n*** Look for a body that is not \
                 #[inline(always)], or for lanes that the compiler no longer vectorises.\n"
            );
        }
    }
    sound &= activations(&backend, &data);
    sound &= text::hold();
    if sound { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Most that rollouts under other activations may take of those under relu, by network: a neuron is 64 or 128
/// products, beside which a quotient of polynomials weighs more or less. On an AMD EPYC (Zen 4) with AVX-512 it is
/// 1.29 to 1.37 for three layers of 64, 1.16 to 1.21 for three of 128. That is what the pipes for products
/// have to do: tanh, ELU and SiLU take 12, 14 and 15 instructions of theirs beside a quotient, which holds one of the
/// two for 10 cycles.
const MOST_OF_RELU: [f64; 2] = [1.45, 1.3];

/// Whether rollouts under networks with other activations take little longer than under relu.
fn activations(backend: &Backend, data: &Data) -> bool {
    let mut sound = true;
    for ((name, relu), most) in data.networks.iter().zip(MOST_OF_RELU) {
        for activation in [Activation::Elu { alpha: 1.0 }, Activation::Silu, Activation::Tanh] {
            let other = Mlp::new(relu.layers().to_vec(), activation, relu.output());
            let other = other.expect("a network");
            let mut calls = [&**relu, &other].map(|mlp| call(backend, mlp, data));
            let [relu, other] = &mut calls;
            let (over, word) = (ratio(other, relu), activation.name());
            println!("{name} {word:6} {over:7.2} times the time of relu, at most {most}");
            sound &= over <= most;
        }
    }
    sound
}

/// Rollouts in lanes over rollouts in a loop.
fn rollouts<P>(backend: &Backend, policy: &P, data: &Data) -> f64
where
    P: Policy<12, 3> + Clone + Send + Sync + 'static,
{
    let (system, starts) = (DroneRace::default(), &data.starts[..ROLLOUTS]);
    let spec: RolloutSpec = data::rollout_spec().expect("a valid specification");
    let lanes = call(backend, policy, data);
    let plain = || {
        black_box(scalar::measures(&system, policy, black_box(starts), spec));
        Ok(())
    };
    ratio(plain, lanes)
}

/// A call of the rollouts under `policy`.
fn call<'a, P>(
    backend: &'a Backend,
    policy: &P,
    data: &'a Data,
) -> impl FnMut() -> Result<()> + use<'a, P>
where
    P: Policy<12, 3> + Clone + Send + Sync + 'static,
{
    let starts = &data.starts[..ROLLOUTS];
    let program =
        backend.prepare(&Plant::of(DroneRace::default(), policy.clone())).expect("it fits");
    let spec = data::rollout_spec().expect("a valid specification");
    move || {
        let task = ReachAvoidTask {
            starts: Starts::listed(starts),
            range: 0..starts.len() as u64,
            spec,
            tightening: &Tightening::none(&spec),
            query: Query::Measure,
        };
        program.reach_avoid(&task, &mut |_, measures| {
            black_box(measures);
            Ok(())
        })
    }
}

/// Plans in lanes over plans in a loop.
fn plans(backend: &Backend) -> f64 {
    let (system, cost) = (DroneRace::default(), data::lane());
    let planning = Planning::of(&system, cost, data::mppi_spec(SAMPLES).expect("settings"));
    let program = backend.prepare_plans(&planning).expect("a program");
    let problem = data::mppi_problem(1, 0);
    let problems = std::slice::from_ref(&problem);
    let task = MppiTask { problems, iteration: 0, costs: CostQuery::Summary };
    let lanes = || program.improve(&task).map(|plans| drop(black_box(plans)));
    let plain = || {
        black_box(scalar::plan(&system, &cost, &planning, black_box(&problem)));
        Ok(())
    };
    ratio(plain, lanes)
}

/// The shortest call of `plain` over that of `lanes`, which take turns.
pub(crate) fn ratio(
    mut plain: impl FnMut() -> Result<()>,
    mut lanes: impl FnMut() -> Result<()>,
) -> f64 {
    let mut best = [f64::INFINITY; 2];
    for _ in 0..TURNS {
        best[0] = best[0].min(shortest(&mut plain));
        best[1] = best[1].min(shortest(&mut lanes));
    }
    best[0] / best[1]
}

/// The shortest call, seconds.
fn shortest(call: impl FnMut() -> Result<()>) -> f64 {
    measure(&TURN, call).expect("the work runs").best_seconds
}
