//! A plan that is improved: a mass on a line is to come to rest at a place.
//! `cargo run --release --example plan`

use reachcast::Result;
use reachcast::backend::Backend;
use reachcast::control::mppi::{Planner, shifted};
use reachcast::cost::Quadratic;
use reachcast::rollout::{MppiProblem, MppiSettings, MppiSpec, Planning, Purpose, Stream};
use reachcast::system::{DoubleIntegrator, System};

/// Steps of a plan, a tenth of a second each.
const HORIZON: usize = 30;

/// Steers to rest at `goal`, m, from rest at 0 for `steps` steps, a plan at each: the last state.
pub(crate) fn steer(backend: &Backend, goal: f32, steps: u32) -> Result<[f32; 2]> {
    let system = DoubleIntegrator::default();
    // A cost of position and speed, more at the last stage; its context is the place to be at, and
    // whether the stage is the last.
    let cost = Quadratic { state: [1.0, 0.1], control: [0.01], last: [20.0, 5.0], obstacle: None };
    let samples = MppiSettings::new(&system.controls(), 512, HORIZON as u32);
    let settings = MppiSettings { temperature: 0.2, ..samples };
    let planning = Planning::of::<_, _, 2, 1, 3>(&system, cost, MppiSpec::new(settings)?);
    // Prepared once; two improvements of a plan at each step.
    let planner = Planner::new(backend, &planning, 2)?;
    let context: Vec<[f32; 3]> =
        (1..=HORIZON).map(|t| [goal, 0.0, f32::from(u8::from(t == HORIZON))]).collect();
    let (mut state, mut plan) = ([0.0, 0.0], vec![0.0; HORIZON]);
    for step in 0..steps {
        let stream = Stream::new(1, Purpose::CONTROL_NOISE, step);
        let problem = MppiProblem::new(state, &[[0.0]; HORIZON], &context, stream);
        let mut problems = [MppiProblem { plan, ..problem }];
        let [result] = &planner.improve(&mut problems)?[..] else { break };
        state = system.step(state, [result.plan[0]]);
        plan = shifted(&result.plan, 1);
    }
    Ok(state)
}

fn main() -> Result<()> {
    for goal in [-0.5, 0.25, 0.8] {
        let [position, velocity] = steer(&Backend::auto()?, goal, 60)?;
        println!("to {goal:5} m: after 6 s at {position:.3} m, {velocity:.3} m/s");
    }
    Ok(())
}
