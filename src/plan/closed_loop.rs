//! The closed loop: plans of all runs are improved together, each run takes the first control of its own.

use std::sync::Arc;
use std::time::Instant;

use super::lost;
use super::settings::PlanSettings;
use crate::backend::Backend;
use crate::control::mppi::{Planner, PolicyPlan};
use crate::error::{Error, Result};
use crate::model::{Costs, Model, Plant};
use crate::real::Real;
use crate::rollout::{MppiProblem, MppiResult, Planning, Purpose, Region, Stream};
use crate::scenario::Watch;

/// Starts of runs.
const START: Purpose = Purpose::numbered(38);
/// Bits of a stream's number that count the step; those above count the run.
const STEP_BITS: u32 = 14;

/// The starts of `runs` runs: one of them is at `state`, several are drawn from the box between `bounds`,
/// all of them, so that what is counted of them is about the box.
///
/// # Errors
/// [`Error::Invalid`] for a box without any width that several would be drawn from.
pub fn starts(
    seed: u64,
    runs: u32,
    state: &[f32],
    bounds: &[Vec<f32>; 2],
) -> Result<Vec<Vec<f32>>> {
    if runs == 1 {
        return Ok(vec![state.to_vec()]);
    }
    let (stream, [low, high]) = (Stream::new(seed, START, 0), bounds.clone());
    let region = Region::new_box(low, high)?;
    Ok((0..u64::from(runs)).map(|run| region.point(stream, run)).collect())
}

/// What the first plan of each run is.
#[derive(Clone, Copy, Debug)]
pub enum FirstPlans<'a> {
    /// The middle of each control's bounds.
    Middle,
    /// A rollout of the plant's policy.
    Policy(&'a Plant),
}

/// A run as it went: of one that stopped early, what there is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// States x_0..=x_T, `[T + 1]` of `[states]`.
    pub states: Vec<Vec<f32>>,
    /// Controls within their bounds, `[T]` of `[controls]`.
    pub controls: Vec<Vec<f32>>,
    /// What each term costs, weighted, `[T + 1]` of `[terms]`: at the last state without a control, so that
    /// only the terminal terms count there.
    pub shares: Vec<Vec<f32>>,
    /// Effective samples of the plan of each step, `[T]`.
    pub effective: Vec<f64>,
    /// Samples of each step whose cost is not finite, `[T]`.
    pub non_finite: Vec<u32>,
    /// Why it ended before its last step.
    pub stopped: Option<Stopped>,
}

/// Why a run ended early.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Stopped {
    /// The step at which there was no control, or whose control led to a state that is not finite.
    pub step: u32,
    /// The reason, in words.
    pub reason: String,
}

/// All runs, and how long their steps took.
#[derive(Clone, Debug)]
pub struct Flown {
    /// The runs in order.
    pub runs: Vec<Trajectory>,
    /// Time that the plans of all runs under way took at each step, milliseconds.
    pub milliseconds: Vec<f64>,
}

/// A model that is steered by plans.
pub struct ClosedLoop<'a> {
    costs: &'a Costs,
    planner: Planner<'a>,
    seed: u64,
}

impl<'a> ClosedLoop<'a> {
    /// Prepares plans for `model` and its `costs` on `backend`; `seed` is that of the control noise.
    ///
    /// # Errors
    /// Those of [`PlanSettings::spec`] and of the backend.
    pub fn new(
        backend: &'a Backend,
        model: &Arc<Model>,
        costs: &'a Costs,
        settings: &PlanSettings,
        seed: u64,
    ) -> Result<Self> {
        let planning = Planning {
            model: Arc::clone(model),
            cost: Arc::new(costs.stage.clone()),
            spec: Arc::new(settings.spec(&model.controls)?),
            value: None,
            disturbance: None,
        };
        let planner = Planner::new(backend, &planning, settings.iterations)?;
        Ok(Self { costs, planner, seed })
    }

    /// What it plans for.
    pub fn planning(&self) -> &Planning {
        self.planner.planning()
    }

    fn model(&self) -> &Model {
        &self.planning().model
    }

    /// The runs from `starts` over `steps` steps, the same bits on any number of threads.
    ///
    /// # Errors
    /// Those of the backend; [`Error::Invalid`] for a policy whose rollout is not finite, and where no run
    /// takes a single step, with the reason of the first.
    pub fn run(
        &self,
        starts: &[Vec<f32>],
        steps: u32,
        first: FirstPlans<'_>,
        watch: &impl Watch,
    ) -> Result<Flown> {
        let mut runs: Vec<Run> = Vec::with_capacity(starts.len());
        for (number, start) in (0..).zip(starts) {
            runs.push(Run::new(number, start, self.first_plan(start, first)?));
        }
        watch.begin("closed loop", u64::from(steps));
        let mut milliseconds = Vec::with_capacity(steps as usize);
        for step in 0..steps {
            let begun = Instant::now();
            if !self.step(&mut runs, step)? {
                break;
            }
            milliseconds.push(1e3 * begun.elapsed().as_secs_f64());
            watch.advance(1)?;
        }
        for run in &mut runs {
            self.finish(run);
        }
        let runs: Vec<Trajectory> = runs.into_iter().map(|run| run.flown).collect();
        refuse_idle(&runs)?;
        Ok(Flown { runs, milliseconds })
    }

    /// The first plan from `start`, `[H, controls]`.
    fn first_plan(&self, start: &[f32], first: FirstPlans<'_>) -> Result<Vec<f32>> {
        let (horizon, bounds) = (self.planner.horizon(), &self.planning().spec.settings().bounds);
        let plan = match first {
            FirstPlans::Middle => {
                let middle = |[low, high]: &[f32; 2]| low + 0.5 * (high - low);
                let stage = bounds.iter().map(middle).collect::<Vec<_>>();
                stage.repeat(horizon)
            }
            FirstPlans::Policy(plant) => PolicyPlan::new(plant, start, horizon, |_| {}).controls,
        };
        match plan.iter().position(|u| !u.is_finite()) {
            None => Ok(plan),
            Some(place) => {
                let step = place / bounds.len();
                let problem = format!(
                    "the policy's rollout from {start:?} has a control that is not finite at step \
                     {step}; start from \"middle\""
                );
                Err(Error::invalid("plan.first_plan", problem))
            }
        }
    }

    /// One step of all runs under way; whether there was one.
    fn step(&self, runs: &mut [Run], step: u32) -> Result<bool> {
        let context = self.costs.contexts(step, self.planner.horizon());
        let mut under_way: Vec<&mut Run> =
            runs.iter_mut().filter(|run| run.flown.stopped.is_none()).collect();
        if under_way.is_empty() {
            return Ok(false);
        }
        if let Some(reason) = lost::reference(self.costs, &context) {
            under_way.iter_mut().for_each(|run| run.stop(step, reason.clone()));
            return Ok(true);
        }
        let problem = |run: &&mut Run| run.problem(self.seed, step, &context);
        let mut problems: Vec<MppiProblem> = under_way.iter().map(problem).collect();
        let results = self.planner.improve(&mut problems)?;
        for (run, result) in under_way.into_iter().zip(&results) {
            self.advance(run, step, result);
        }
        Ok(true)
    }

    /// Moves `run` on by the first control of its improved plan.
    fn advance(&self, run: &mut Run, step: u32, result: &MppiResult) {
        let (model, controls) = (self.model(), self.model().controls.len());
        if result.effective_samples == 0.0 {
            let reason = lost::samples(model, self.costs, &run.x, &run.plan, step);
            return run.stop(step, reason);
        }
        let bounds = &self.planning().spec.settings().bounds;
        let clipped = |(u, [low, high]): (&f32, &[f32; 2])| Real::clamp(*u, *low, *high);
        let u: Vec<f32> = result.plan.iter().zip(bounds).map(clipped).collect();
        let next = model.next(&run.x, &u, step);
        run.flown.shares.push(self.costs.shares(&run.x, &u, step));
        run.flown.effective.push(result.effective_samples);
        run.flown.non_finite.push(result.non_finite);
        run.flown.controls.push(u);
        run.flown.states.push(next.clone());
        if !next.iter().all(|x| x.is_finite()) {
            return run.stop(step, lost::state(model, &run.x, &next));
        }
        run.x = next;
        run.plan = held(&result.plan, controls);
    }

    /// Adds what the last state of `run` costs.
    fn finish(&self, run: &mut Run) {
        let (flown, controls) = (&mut run.flown, self.planning().spec.controls());
        if let Some(last) = flown.states.last() {
            let step = flown.controls.len() as u32;
            flown.shares.push(self.costs.shares(last, &vec![0.0; controls], step));
        }
    }
}

/// A run under way.
struct Run {
    number: u32,
    x: Vec<f32>,
    plan: Vec<f32>,
    flown: Trajectory,
}

impl Run {
    fn new(number: u32, start: &[f32], plan: Vec<f32>) -> Self {
        let flown = Trajectory { states: vec![start.to_vec()], ..Trajectory::default() };
        Self { number, x: start.to_vec(), plan, flown }
    }

    /// The plan to improve at `step`; its noise is a function of seed, run and step.
    fn problem(&self, seed: u64, step: u32, context: &[f32]) -> MppiProblem {
        let number = self.number << STEP_BITS | step;
        MppiProblem {
            start: self.x.clone(),
            plan: self.plan.clone(),
            context: context.to_vec(),
            first_step: step,
            stream: Stream::new(seed, Purpose::CONTROL_NOISE, number),
        }
    }

    fn stop(&mut self, step: u32, reason: String) {
        self.flown.stopped = Some(Stopped { step, reason });
    }
}

/// The plan of `controls` controls one step on: the first stage gone, the last one repeated.
fn held(plan: &[f32], controls: usize) -> Vec<f32> {
    let last = plan.len() - controls;
    plan[controls..].iter().chain(&plan[last..]).copied().collect()
}

/// Refuses runs none of which took a step.
fn refuse_idle(runs: &[Trajectory]) -> Result<()> {
    let idle = |run: &Trajectory| run.controls.is_empty();
    let reason = runs.iter().find_map(|run| run.stopped.as_ref());
    match reason.filter(|_| runs.iter().all(idle)) {
        Some(stopped) => {
            Err(Error::invalid("plan", format!("no run takes a step: {}", stopped.reason)))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::settings::MOST_RUNS;
    use crate::rollout::MAX_HORIZON;

    #[test]
    fn every_step_of_every_run_has_a_stream_of_its_own() {
        const { assert!(MAX_HORIZON < 1 << STEP_BITS, "steps do not reach into the bits of the run") };
        let last = (MOST_RUNS - 1) << STEP_BITS | (MAX_HORIZON - 1);
        // It does not panic.
        Stream::new(1, Purpose::CONTROL_NOISE, last);
    }

    #[test]
    fn a_plan_moves_on_and_holds_its_last_control() {
        assert_eq!(held(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 2), [3.0, 4.0, 5.0, 6.0, 5.0, 6.0]);
        assert_eq!(held(&[1.0, 2.0], 2), [1.0, 2.0]);
    }

    #[test]
    fn one_run_is_at_the_state_and_several_are_drawn() {
        let bounds = [vec![-1.0, 2.0], vec![1.0, 3.0]];
        let starts = |seed, runs, state: [f32; 2]| starts(seed, runs, &state, &bounds).unwrap();
        assert_eq!(starts(1, 1, [0.5, 2.5]), [[0.5, 2.5]]);
        let drawn = starts(1, 50, [0.5, 2.5]);
        let region = Region::new_box([-1.0, 2.0], [1.0, 3.0]).unwrap();
        assert!(drawn.iter().all(|x| region.contains(x) && *x != [0.5, 2.5]));
        assert_eq!(drawn, starts(1, 50, [0.0, 0.0]));
        assert_eq!(drawn[..20], starts(1, 20, [0.0, 0.0]));
        assert_ne!(drawn, starts(2, 50, [0.0, 0.0]));
    }

    #[test]
    fn several_runs_need_a_box_with_some_width() {
        let point = [vec![1.0], vec![1.0]];
        assert_eq!(super::starts(1, 1, &[1.0], &point).unwrap(), [[1.0]]);
        assert!(super::starts(1, 2, &[1.0], &point).is_err());
    }
}
