//! MPPI as a controller uses it: iterations, shifted plans, plans that a policy rolls out.

use crate::backend::{Backend, PlanProgram};
use crate::error::Result;
use crate::model::Plant;
use crate::real::Real;
use crate::rollout::{CostQuery, MppiProblem, MppiResult, MppiTask, Planning};

/// What improves the plans of a controller, prepared on a backend.
pub struct Planner<'a> {
    program: PlanProgram<'a>,
    /// Improvements of a plan at each control step, at least 1.
    iterations: u32,
}

impl<'a> Planner<'a> {
    /// Prepares `planning` on `backend`, for `iterations` improvements of a plan at a time.
    ///
    /// # Errors
    /// Those of [`Backend::prepare_plans`].
    pub fn new(backend: &'a Backend, planning: &Planning, iterations: u32) -> Result<Self> {
        Ok(Self { program: backend.prepare_plans(planning)?, iterations })
    }

    /// What it plans for.
    pub fn planning(&self) -> &Planning {
        self.program.planning()
    }

    /// Steps of a plan.
    pub fn horizon(&self) -> usize {
        self.planning().spec.horizon()
    }

    /// Improves the plan of each problem in place; the results of the last iteration, in order.
    ///
    /// # Errors
    /// Those of [`PlanProgram::improve`].
    pub fn improve(&self, problems: &mut [MppiProblem]) -> Result<Vec<MppiResult>> {
        let mut results = Vec::new();
        if problems.is_empty() {
            return Ok(results);
        }
        for iteration in 0..self.iterations {
            let task = MppiTask { problems, iteration, costs: CostQuery::Summary };
            results = self.program.improve(&task)?;
            for (problem, result) in problems.iter_mut().zip(&results) {
                problem.plan.clone_from(&result.plan);
            }
        }
        Ok(results)
    }
}

/// The plan of `controls` controls one step on: the first stage gone, zeros appended.
pub fn shifted(plan: &[f32], controls: usize) -> Vec<f32> {
    let rest = plan.iter().skip(controls).copied();
    rest.chain(std::iter::repeat(0.0)).take(plan.len()).collect()
}

/// A rollout of the policy to plan from.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyPlan {
    /// The controls, clipped to their bounds, `[H, controls]`.
    pub controls: Vec<f32>,
    /// The states that they are applied at, `[H]` of `[states]`.
    pub states: Vec<Vec<f32>>,
}

impl PolicyPlan {
    /// The rollout of `plant` from `start` over `horizon` steps. `hold` may put states back after
    /// each step, as the study holds the opponent where it is.
    pub fn new(plant: &Plant, start: &[f32], horizon: usize, hold: impl Fn(&mut [f32])) -> Self {
        let mut x = start.to_vec();
        let mut plan = Self { controls: Vec::new(), states: Vec::with_capacity(horizon) };
        for step in 0..horizon as u32 {
            let mut u = plant.control(&x, step);
            for (u, axis) in u.iter_mut().zip(&plant.model.controls) {
                *u = Real::clamp(*u, axis.low, axis.high);
            }
            let mut next = plant.model.next(&x, &u, step);
            hold(&mut next);
            plan.states.push(std::mem::replace(&mut x, next));
            plan.controls.extend(u);
        }
        plan
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::Policy;
    use crate::rollout::replay;
    use crate::system::{DoubleIntegrator, System};

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
        assert_eq!(shifted(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 2), [3.0, 4.0, 5.0, 6.0, 0.0, 0.0]);
        assert_eq!(shifted(&[1.0], 1), [0.0]);
        assert_eq!(shifted(&[], 1), [0.0_f32; 0]);
    }

    #[test]
    fn a_plan_of_the_policy_is_its_rollout() {
        let system = DoubleIntegrator::default();
        let start = [0.6, 0.5];
        let plant = Plant::of(system, Steep);
        let PolicyPlan { controls, states } = PolicyPlan::new(&plant, &start, 12, |_| {});
        assert_eq!((controls.len(), states.len()), (12, 12));
        assert_eq!(states, replay::states::<f32>(&plant, &start, 11));
        // The system clips by itself; the plan has to be within the bounds all the same.
        assert!(controls[0] != -1.0 && controls[11] == -1.0, "{controls:?}");
        for (u, x) in controls.iter().zip(&states) {
            let [wanted] = Steep.control([x[0], x[1]]);
            assert_eq!(*u, wanted.clamp(-1.0, 1.0));
        }
    }

    #[test]
    fn what_is_held_stays() {
        let system = DoubleIntegrator::default();
        let hold = |x: &mut [f32]| x[1] = 0.5;
        let plant = Plant::of(system, Steep);
        let PolicyPlan { controls, states } = PolicyPlan::new(&plant, &[0.8, 0.5], 8, hold);
        assert!(states.iter().all(|x| x[1] == 0.5));
        // Position moves on with the held velocity; the control stays at its bound above the line.
        let mut position = 0.8;
        for (x, u) in states.iter().zip(controls) {
            assert_eq!((x[0], u), (position, -1.0));
            position = system.step([position, 0.5], [u])[0];
        }
    }
}
