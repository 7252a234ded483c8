//! The same formulas in a plain loop, one trajectory after the other in f32: what lanes are held against.

#![allow(dead_code, reason = "each bench takes what it needs")]

use std::array::from_fn;

use reachcast::cost::Cost;
use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::rollout::{Fold, MppiProblem, Planning, RolloutSpec};
use reachcast::system::System;

/// Damping of the ego's velocities: physics without a network.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damping;

impl Policy<12, 3> for Damping {
    fn name(&self) -> String {
        "damping".to_owned()
    }

    #[inline(always)]
    fn control<R: Real>(&self, x: [R; 12]) -> [R; 3] {
        let gain = R::lit(-0.5);
        [gain * x[1], gain * x[3], gain * x[5]]
    }
}

/// The measure of each start.
pub(crate) fn measures<S, P, const NX: usize, const NU: usize>(
    system: &S,
    policy: &P,
    starts: &[[f32; NX]],
    spec: RolloutSpec,
) -> Vec<f32>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let measure = |start: &[f32; NX]| {
        let (mut x, mut fold) = (*start, Fold::new());
        fold.add(system.target(x), system.constraint(x), spec.gamma);
        for _ in 0..spec.horizon {
            x = system.step(x, policy.control(x));
            fold.add(system.target(x), system.constraint(x), spec.gamma);
        }
        fold.measure()
    };
    starts.iter().map(measure).collect()
}

/// The improved plan of `problem`, `[H, controls]`: no networks, no noise cost.
pub(crate) fn plan<S, C, const NX: usize, const NU: usize, const NC: usize>(
    system: &S,
    cost: &C,
    planning: &Planning,
    problem: &MppiProblem,
) -> Vec<f32>
where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    let settings = planning.spec.settings();
    let start: [f32; NX] = from_fn(|i| problem.start[i]);
    let sample = |number| {
        let controls = planning.controls(problem, 0, number);
        let (mut x, mut total) = (start, 0.0);
        let stages = problem.context.as_chunks::<NC>().0;
        for (u, context) in controls.as_chunks::<NU>().0.iter().zip(stages) {
            total += cost.stage(x, *u, *context);
            x = system.step(x, *u);
        }
        (total, controls)
    };
    let samples: Vec<(f32, Vec<f32>)> = (0..settings.samples).map(sample).collect();
    let least = samples.iter().fold(f32::INFINITY, |least, (cost, _)| least.min(*cost));
    let mut plan = vec![0.0; problem.plan.len()];
    let mut weights = 0.0;
    for (cost, controls) in &samples {
        let weight = ((least - cost) / settings.temperature).exp();
        weights += weight;
        for (sum, u) in plan.iter_mut().zip(controls) {
            *sum += weight * u;
        }
    }
    plan.iter_mut().for_each(|sum| *sum /= weights);
    plan
}
