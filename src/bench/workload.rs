//! What a benchmark runs: workloads whose operations are counted, and a batch of any size.

use std::fmt;
use std::hint::black_box;
use std::sync::Arc;

use crate::backend::{Backend, PlanProgram, Program};
use crate::error::Result;
use crate::model::Plant;
use crate::rollout::{
    CostQuery, DeviationTask, MppiProblem, MppiTask, PairControl, Pairs, Planning, Query,
    ReachAvoidTask, Region, RolloutSpec, Starts, StateList, Stream, Tightening,
};

/// Everything that a benchmark runs.
#[derive(Debug)]
pub struct Work {
    /// What is timed.
    pub workloads: Vec<Workload>,
    /// The batch of growing size.
    pub batch: Batch,
}

/// Rollouts of any number of starts, drawn by their index.
#[derive(Clone, Debug)]
pub struct Batch {
    /// What rolls out.
    pub plant: Plant,
    /// Where starts are drawn from.
    pub region: Region,
    /// By which random numbers.
    pub stream: Stream,
    /// Horizon and discount.
    pub spec: RolloutSpec,
}

/// Work of a fixed size that any backend does in one call.
pub struct Workload {
    /// Kind, what it runs on, and size: `rollout/3x64/158`.
    pub name: String,
    /// What is counted: `rollout`, `pair` or `sample`.
    pub unit: &'static str,
    /// Units of a call.
    pub units: u64,
    /// Steps of a unit; for signs, which end as soon as they are decided, the mean.
    pub steps: f64,
    /// Floating-point operations of a unit, as [`super::flops`] counts them.
    pub flops: f64,
    /// What is done.
    pub(crate) kind: Kind,
}

/// What a workload does.
pub(crate) enum Kind {
    /// Measures or signs.
    Measures { rollouts: Rollouts, query: Query },
    /// Pairs, the perturbed rollout under the nominal controls.
    Pairs { rollouts: Rollouts, radius: f32, stream: Stream },
    /// One improvement of a plan.
    Plan { planning: Planning, problem: MppiProblem },
}

/// Rollouts of the first `count` of listed starts.
pub(crate) struct Rollouts {
    pub(crate) plant: Plant,
    pub(crate) starts: Arc<StateList>,
    pub(crate) count: u64,
    pub(crate) spec: RolloutSpec,
}

/// A workload prepared on a backend, for any number of calls.
pub struct PreparedWorkload<'a> {
    workload: &'a Workload,
    program: Prepared<'a>,
}

/// What a backend keeps of it.
#[expect(clippy::large_enum_variant, reason = "a workload has one, and it is not moved")]
enum Prepared<'a> {
    Plant(Program<'a>),
    Plans(PlanProgram<'a>),
}

impl Workload {
    /// Prepares the work on `backend`.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn prepare<'a>(&'a self, backend: &'a Backend) -> Result<PreparedWorkload<'a>> {
        let program = match &self.kind {
            Kind::Measures { rollouts, .. } | Kind::Pairs { rollouts, .. } => {
                Prepared::Plant(backend.prepare(&rollouts.plant)?)
            }
            Kind::Plan { planning, .. } => Prepared::Plans(backend.prepare_plans(planning)?),
        };
        Ok(PreparedWorkload { workload: self, program })
    }

    /// Floating-point operations of a call.
    pub fn call_flops(&self) -> f64 {
        self.units as f64 * self.flops
    }
}

impl PreparedWorkload<'_> {
    /// Does the work once.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn call(&self) -> Result<()> {
        match (&self.workload.kind, &self.program) {
            (Kind::Measures { rollouts, query }, Prepared::Plant(program)) => {
                measures(program, rollouts, *query)
            }
            (Kind::Pairs { rollouts, radius, stream }, Prepared::Plant(program)) => {
                deviations(program, rollouts, *radius, *stream)
            }
            (Kind::Plan { problem, .. }, Prepared::Plans(program)) => {
                let problems = std::slice::from_ref(problem);
                let task = MppiTask { problems, iteration: 0, costs: CostQuery::Summary };
                program.improve(&task).map(|plans| drop(black_box(plans)))
            }
            _ => unreachable!("a workload is prepared as what it is"),
        }
    }
}

/// Measures or signs of the starts.
fn measures(program: &Program<'_>, rollouts: &Rollouts, query: Query) -> Result<()> {
    let Rollouts { starts, count, spec, .. } = rollouts;
    let task = ReachAvoidTask {
        starts: Starts::Listed(starts.view()),
        range: 0..*count,
        spec: *spec,
        tightening: &Tightening::none(spec),
        query,
    };
    program.reach_avoid(&task, &mut |_, measures| {
        black_box(measures);
        Ok(())
    })
}

/// Pairs around the starts.
fn deviations(
    program: &Program<'_>,
    rollouts: &Rollouts,
    radius: f32,
    stream: Stream,
) -> Result<()> {
    let Rollouts { starts, count, spec, .. } = rollouts;
    let task = DeviationTask {
        pairs: Pairs { nominal: Starts::Listed(starts.view()), radius, stream },
        range: 0..*count,
        spec: *spec,
        tightening: &Tightening::none(spec),
        control: PairControl::Replay,
    };
    let farthest = program.deviation(&task, &mut |_, measures| {
        black_box(measures);
        Ok(())
    });
    farthest.map(|farthest| drop(black_box(farthest)))
}

impl fmt::Debug for Workload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Workload").field(&self.name).finish()
    }
}
