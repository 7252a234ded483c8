//! What the plans of all controllers share: planners from settings, problems, sampled paths.

use std::array::from_fn;

use super::interface::World;
use crate::control::mppi::Planner;
use crate::error::Result;
use crate::race::cost::RaceReference;
use crate::race::settings::PlanSettings;
use crate::rollout::{Disturbance, MppiProblem, Planning, Purpose, Stream, ValueTerm};

/// A planner and the speed that it keeps.
pub(in crate::race) struct RacePlanner<'a> {
    /// The planner.
    pub(in crate::race) planner: Planner<'a>,
    /// Speed toward the gate, m/s.
    pub(in crate::race) speed: f32,
}

/// The networks that take part in plans.
#[derive(Clone, Debug, Default)]
pub(in crate::race) struct Networks {
    /// Penalty on the value along the rollouts.
    pub(in crate::race) value: Option<ValueTerm>,
    /// What pushes the opponent.
    pub(in crate::race) disturbance: Option<Disturbance>,
}

impl<'a> RacePlanner<'a> {
    /// The planner that the `settings` of `section` ask for, prepared.
    pub(in crate::race) fn new(
        section: &str,
        settings: &PlanSettings,
        world: &World<'a>,
        networks: Networks,
    ) -> Result<Self> {
        let spec = settings.spec(section, world.system)?;
        let Networks { value, disturbance } = networks;
        let planning =
            Planning { value, disturbance, ..Planning::of(world.system, settings.cost, spec) };
        let planner = Planner::new(world.backend, &planning, settings.iterations)?;
        Ok(Self { planner, speed: settings.speed })
    }
}

/// The first controls of a plan.
pub(in crate::race) fn first(plan: &[f32]) -> [f32; 3] {
    from_fn(|i| plan[i])
}

/// The stream of the control noise of a race at one step.
pub(in crate::race) fn stream(seed: u64, step: u32) -> Stream {
    Stream::new(seed, Purpose::CONTROL_NOISE, step)
}

/// The problem at `start`, with the reference of each stage.
pub(in crate::race) fn problem(
    start: [f32; 12],
    plan: Vec<f32>,
    stream: Stream,
    reference: impl Fn(usize) -> RaceReference,
) -> MppiProblem {
    let horizon = plan.len() / 3;
    let stage = |t: usize| RaceReference { last: t + 1 == horizon, ..reference(t) }.context();
    let context = (0..horizon).flat_map(stage).collect();
    MppiProblem { start: start.to_vec(), plan, context, first_step: 0, stream }
}

/// Whether sampled paths are wanted, for a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::race) enum Paths {
    /// None.
    None,
    /// The first samples of each plan.
    Drawn,
}

/// Paths of a picture.
const DRAWN: u32 = 24;

/// The first samples of `problem` around its improved plan: x and y of the ego.
pub(in crate::race) fn fan(
    plan: &RacePlanner<'_>,
    problem: &MppiProblem,
    paths: Paths,
) -> Vec<Vec<[f32; 2]>> {
    if paths == Paths::None {
        return Vec::new();
    }
    let planning = plan.planner.planning();
    let samples = DRAWN.min(planning.spec.settings().samples);
    let path = |sample| {
        let states = planning.states(problem, 0, sample);
        states.into_iter().map(|x| [x[0], x[2]]).collect()
    };
    (0..samples).map(path).collect()
}
