//! What a benchmark runs: workloads whose operations are counted, and a batch of any size.

use std::fmt;
use std::hint::black_box;

use super::flops;
use crate::backend::Backend;
use crate::cost::Cost;
use crate::error::Result;
use crate::rollout::{CostQuery, MppiProblem, MppiSpec, MppiTask};
use crate::scenario::Watch;
use crate::system::System;

/// Everything that a benchmark runs.
pub struct Work {
    /// What is timed.
    pub workloads: Vec<Workload>,
    /// The batch of growing size.
    pub batch: Batch,
}

impl fmt::Debug for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Work").field(&self.workloads).finish()
    }
}

/// Rolls out so many starts on a backend, and tells how far it is.
pub type Batch = Box<dyn Fn(&Backend, u64, &dyn Watch) -> Result<()>>;

/// One call of a workload on a backend.
pub(crate) type Call = Box<dyn Fn(&Backend) -> Result<()>>;

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
    /// Floating-point operations of a unit, as [`flops`] counts them.
    pub flops: f64,
    /// The call.
    pub(crate) call: Call,
}

impl Workload {
    /// Does the work once.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn call(&self, backend: &Backend) -> Result<()> {
        (self.call)(backend)
    }

    /// Floating-point operations of a call.
    pub fn call_flops(&self) -> f64 {
        self.units as f64 * self.flops
    }
}

impl fmt::Debug for Workload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Workload").field(&self.name).finish()
    }
}

/// One improvement of a plan, its noise drawn anew.
pub(crate) fn plan<S, C, const NX: usize, const NU: usize, const NC: usize>(
    name: String,
    system: S,
    cost: C,
    spec: MppiSpec<NU>,
    problem: MppiProblem<NX, NU, NC>,
) -> Workload
where
    S: System<NX, NU> + 'static,
    C: Cost<NX, NU, NC> + 'static,
{
    let (samples, horizon) = (spec.settings().samples, spec.settings().horizon);
    let flops = flops::sample(&system, &cost, horizon as usize);
    let call = move |backend: &Backend| {
        let problems = std::slice::from_ref(&problem);
        let (value, disturbance, costs) = (None, None, CostQuery::Summary);
        let task = MppiTask { spec: &spec, problems, iteration: 0, value, disturbance, costs };
        backend.mppi(&system, &cost, &task).map(|plans| drop(black_box(plans)))
    };
    let steps = f64::from(horizon);
    let (unit, units) = ("sample", u64::from(samples));
    Workload { name, unit, units, steps, flops, call: Box::new(call) }
}
