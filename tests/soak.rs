//! 10,000 control steps in flat memory, 4,000 on an adapter: a plan improved and a state measured at each.

mod common;

use common::{adapter, cpu};
use reachcast::backend::Backend;
use reachcast::control::mppi::{Planner, shifted};
use reachcast::cost::Quadratic;
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::rollout::{
    MppiProblem, MppiSettings, MppiSpec, Planning, Purpose, Query, ReachAvoidTask, RolloutSpec,
    Starts, Stream, Tightening,
};
use reachcast::system::{DoubleIntegrator, System};

/// Steps before the memory counts: pools and caches have their size by then.
const WARM_UP: u32 = 1_000;
/// Growth that is no leak, per step: allocators keep a page here and there.
const SLACK_BYTES: i64 = 466;
/// Steps of a plan.
const HORIZON: usize = 10;

/// Memory that the process holds, bytes; `None` where the system does not say.
fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split_whitespace().nth(1)?.parse().ok()?;
    Some(4096 * pages)
}

/// Steers the double integrator for `steps` steps; the growth of the memory after the warm-up.
fn growth(backend: &Backend, samples: u32, steps: u32) -> Option<i64> {
    let system = DoubleIntegrator::default();
    let weights = |count: usize| (0..count).map(|i| 0.3 - 0.1 * (i % 7) as f32).collect();
    let layer =
        |inputs: usize, outputs: usize| Layer::dense(weights(inputs * outputs), vec![0.0; outputs]);
    let policy = Mlp::new(vec![layer(2, 16), layer(16, 1)], Activation::Tanh, Activation::Tanh);
    let policy = policy.expect("a network");
    let settings = MppiSettings::new(&system.controls(), samples, HORIZON as u32);
    let cost = Quadratic { state: [2.0, 0.5], control: [0.1], last: [20.0, 5.0], obstacle: None };
    let planning =
        Planning::of::<_, _, 2, 1, 3>(&system, cost, MppiSpec::new(settings).expect("settings"));
    let planner = Planner::new(backend, &planning, 1).expect("a program");
    let plant = Plant::of(system, policy);
    let program = backend.prepare(&plant).expect("a program");
    let spec = RolloutSpec::new(HORIZON as u32, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let (mut x, mut plan) = ([0.8, 0.0], vec![0.0; HORIZON]);
    let mut warm = None;
    for step in 0..steps {
        let stream = Stream::new(81, Purpose::CONTROL_NOISE, step);
        let problem = MppiProblem::new(x, &[[0.0]; HORIZON], &[[0.0; 3]; HORIZON], stream);
        let mut problems = [MppiProblem { plan: shifted(&plan, 1), ..problem }];
        let results = planner.improve(&mut problems).expect("a plan");
        plan.clone_from(&results[0].plan);
        let starts = [x];
        let task = ReachAvoidTask {
            starts: Starts::listed(&starts),
            range: 0..1,
            spec,
            tightening: &tightening,
            query: Query::Measure,
        };
        program.reach_avoid(&task, &mut |_, _| Ok(())).expect("a measure");
        x = system.step(x, [plan[0]]);
        // Away from rest now and then, so that there is something to do.
        if step % 50 == 0 {
            x = [0.8, 0.0];
        }
        if step == WARM_UP {
            warm = resident_bytes();
        }
    }
    Some(resident_bytes()? as i64 - warm? as i64)
}

#[test]
fn memory_is_flat_over_ten_thousand_steps() {
    if resident_bytes().is_none() {
        println!("SKIPPED: the system does not say how much memory a process holds");
        return;
    }
    // A step on a software adapter is almost all waiting.
    let adapters = adapter().map(|gpu| (Backend::Gpu(gpu), 64, 4_000));
    for (backend, samples, steps) in std::iter::once((cpu(2), 256, 10_000)).chain(adapters) {
        let grown = growth(&backend, samples, steps).expect("it said so before");
        let counted = steps - WARM_UP;
        println!("{}: {grown} bytes in {counted} steps", backend.device());
        assert!(grown < SLACK_BYTES * i64::from(counted), "{}: {grown} bytes", backend.device());
    }
}
