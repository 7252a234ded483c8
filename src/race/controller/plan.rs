//! What the plans of all controllers share: planners from settings, problems, sampled paths.

use crate::control::mppi::Planner;
use crate::error::Result;
use crate::race::cost::{RACE_CONTEXT, RaceCost, RaceReference};
use crate::race::settings::PlanSettings;
use crate::race::system::DroneRace;
use crate::rollout::{MppiProblem, Purpose, Stream};

/// A problem of the race.
pub(in crate::race) type RaceProblem = MppiProblem<12, 3, RACE_CONTEXT>;

/// A planner and the speed that it keeps.
pub(in crate::race) struct RacePlanner<'a> {
    /// The planner.
    pub(in crate::race) planner: Planner<'a, RaceCost, 3>,
    /// Speed toward the gate, m/s.
    pub(in crate::race) speed: f32,
}

impl RacePlanner<'_> {
    /// The planner that the `settings` of `section` ask for.
    pub(in crate::race) fn new(
        section: &str,
        settings: &PlanSettings,
        system: &DroneRace,
    ) -> Result<Self> {
        let planner = Planner {
            spec: settings.spec(section, system)?,
            cost: settings.cost,
            iterations: settings.iterations,
            value: None,
            disturbance: None,
        };
        Ok(Self { planner, speed: settings.speed })
    }
}

/// The stream of the control noise of a race at one step.
pub(in crate::race) fn stream(seed: u64, step: u32) -> Stream {
    Stream::new(seed, Purpose::CONTROL_NOISE, step)
}

/// The problem at `start`, with the reference of each stage.
pub(in crate::race) fn problem(
    start: [f32; 12],
    plan: Vec<[f32; 3]>,
    stream: Stream,
    reference: impl Fn(usize) -> RaceReference,
) -> RaceProblem {
    let last = plan.len() - 1;
    let stage = |t: usize| RaceReference { last: t == last, ..reference(t) }.context();
    let context = (0..plan.len()).map(stage).collect();
    MppiProblem { start, plan, context, stream }
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

/// The first samples of problem `number` around its improved plan: x and y of the ego.
pub(in crate::race) fn fan(
    plan: &RacePlanner<'_>,
    system: &DroneRace,
    problems: &[RaceProblem],
    number: usize,
    paths: Paths,
) -> Vec<Vec<[f32; 2]>> {
    if paths == Paths::None {
        return Vec::new();
    }
    let task = plan.planner.task(problems, 0);
    let samples = DRAWN.min(plan.planner.spec.settings().samples);
    let path = |sample| {
        let states = task.states(system, number, sample);
        states.into_iter().map(|x| [x[0], x[2]]).collect()
    };
    (0..samples).map(path).collect()
}
