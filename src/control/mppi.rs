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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::Real;
    use crate::rollout::{Plant, trajectory};
    use crate::system::DoubleIntegrator;

    /// Twice what the controls allow where the position is above a line, else a third of it.
    struct Steep;

    impl Policy<2, 1> for Steep {
        fn name(&self) -> String {
            "steep".to_owned()
        }
        fn control<R: Real>(&self, [position, velocity]: [R; 2]) -> [R; 1] {
            let slow = R::lit(-0.33) * velocity;
            [R::lit(0.7).if_lt(position, R::lit(-2.0), slow)]
        }
    }

    #[test]
    fn a_shifted_plan_ends_in_zero() {
        assert_eq!(
            shifted(&[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]),
            [[3.0, 4.0], [5.0, 6.0], [0.0; 2]]
        );
        assert_eq!(shifted(&[[1.0]]), [[0.0]]);
        assert_eq!(shifted::<1>(&[]), [[0.0_f32; 1]; 0]);
    }

    #[test]
    fn a_plan_of_the_policy_is_its_rollout() {
        let system = DoubleIntegrator::default();
        let start = [0.6, 0.5];
        let (plan, states) = policy_plan(&system, &Steep, start, 12, |_| {});
        assert_eq!((plan.len(), states.len()), (12, 12));
        let plant = Plant { system: &system, policy: &Steep };
        assert_eq!(states, trajectory::<f32, _, _, 2, 1>(plant, start, 11));
        // The system clips by itself; the plan has to be within the bounds all the same.
        assert!(plan[0] != [-1.0] && plan[11] == [-1.0], "{plan:?}");
        for (u, x) in plan.iter().zip(&states) {
            let [wanted] = Steep.control(*x);
            assert_eq!(*u, [wanted.clamp(-1.0, 1.0)]);
        }
    }

    #[test]
    fn what_is_held_stays() {
        let system = DoubleIntegrator::default();
        let hold = |x: &mut [f32; 2]| x[1] = 0.5;
        let (plan, states) = policy_plan(&system, &Steep, [0.8, 0.5], 8, hold);
        assert!(states.iter().all(|x| x[1] == 0.5));
        // Position moves on with the held velocity; the control stays at its bound above the line.
        let mut position = 0.8;
        for (x, u) in states.iter().zip(plan) {
            assert_eq!((x[0], u), (position, [-1.0]));
            position = system.step([position, 0.5], u)[0];
        }
    }
}
