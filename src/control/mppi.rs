//! MPPI as a controller uses it: iterations, shifted plans, plans that a policy rolls out.

use crate::backend::Backend;
use crate::cost::Cost;
use crate::error::Result;
use crate::policy::Policy;
use crate::rollout::{
    CostQuery, Disturbance, MppiProblem, MppiResult, MppiSpec, MppiTask, ValueTerm,
};
use crate::system::System;

/// What all plans of a controller are improved with.
#[derive(Clone, Debug)]
pub struct Planner<'a, C, const NU: usize> {
    /// Samples, horizon, temperature, noise.
    pub spec: MppiSpec<NU>,
    /// The cost of a stage.
    pub cost: C,
    /// Improvements of a plan at each control step, at least 1.
    pub iterations: u32,
    /// Penalty on the value of a network.
    pub value: Option<ValueTerm<'a>>,
    /// Disturbance of the rollouts.
    pub disturbance: Option<Disturbance<'a>>,
}

impl<C, const NU: usize> Planner<'_, C, NU> {
    /// Steps of a plan.
    pub fn horizon(&self) -> usize {
        self.spec.settings().horizon as usize
    }

    /// Improves the plan of each problem in place; the results of the last iteration, in order.
    ///
    /// # Errors
    /// Those of [`Backend::mppi`].
    pub fn improve<S, const NX: usize, const NC: usize>(
        &self,
        backend: &Backend,
        system: &S,
        problems: &mut [MppiProblem<NX, NU, NC>],
    ) -> Result<Vec<MppiResult<NU>>>
    where
        S: System<NX, NU>,
        C: Cost<NX, NU, NC>,
    {
        let mut results = Vec::new();
        if problems.is_empty() {
            return Ok(results);
        }
        for iteration in 0..self.iterations {
            let task = self.task(problems, iteration);
            results = backend.mppi(system, &self.cost, &task)?;
            for (problem, result) in problems.iter_mut().zip(&results) {
                problem.plan.clone_from(&result.plan);
            }
        }
        Ok(results)
    }

    /// The task of one iteration.
    pub fn task<'a, const NX: usize, const NC: usize>(
        &'a self,
        problems: &'a [MppiProblem<NX, NU, NC>],
        iteration: u32,
    ) -> MppiTask<'a, NX, NU, NC> {
        let (value, disturbance) = (self.value, self.disturbance);
        let costs = CostQuery::Summary;
        MppiTask { spec: &self.spec, problems, iteration, value, disturbance, costs }
    }
}

/// The plan one step on: the first control gone, a zero appended.
pub fn shifted<const NU: usize>(plan: &[[f32; NU]]) -> Vec<[f32; NU]> {
    let rest = plan.iter().skip(1).copied();
    rest.chain(std::iter::once([0.0; NU])).take(plan.len()).collect()
}

/// A rollout of the policy to plan from: the controls `[H]`, clipped to their bounds, and the
/// states that they are applied at, `[H]`. `hold` may put states back after each step, as the
/// study holds the opponent where it is.
pub fn policy_plan<S, P, const NX: usize, const NU: usize>(
    system: &S,
    policy: &P,
    start: [f32; NX],
    horizon: usize,
    hold: impl Fn(&mut [f32; NX]),
) -> (Vec<[f32; NU]>, Vec<[f32; NX]>)
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let bounds = system.controls().map(|axis| (axis.low, axis.high));
    let mut x = start;
    let (mut plan, mut states) = (Vec::with_capacity(horizon), Vec::with_capacity(horizon));
    for _ in 0..horizon {
        let mut u = policy.control(x);
        for (u, (low, high)) in u.iter_mut().zip(bounds) {
            *u = u.clamp(low, high);
        }
        states.push(x);
        plan.push(u);
        x = system.step(x, u);
        hold(&mut x);
    }
    (plan, states)
}
