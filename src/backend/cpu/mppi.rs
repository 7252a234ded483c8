//! MPPI problems cut into units for the threads, merged in order.

use super::Cpu;
use super::dispatch::run;
use super::mppi_rollout::MppiRollout;
use super::spread::spread;
use crate::backend::softmin::Partial;
use crate::cost::Cost;
use crate::error::Result;
use crate::rollout::{CostQuery, MppiResult, MppiTask};
use crate::system::System;

/// Samples of a unit: the softmin is merged unit by unit, so the bits depend on it. Half of the
/// study's 500 samples, so that two threads share one problem.
const UNIT: u32 = 256;
/// Most memory of the partials of the problems that are improved at a time, bytes.
const PARTIAL_BYTES: usize = 64 << 20;

impl Cpu {
    /// See [`crate::backend::Backend::mppi`].
    pub(in crate::backend) fn mppi<S, C, const NX: usize, const NU: usize, const NC: usize>(
        &self,
        system: &S,
        cost: &C,
        task: &MppiTask<'_, NX, NU, NC>,
    ) -> Result<Vec<MppiResult<NU>>>
    where
        S: System<NX, NU>,
        C: Cost<NX, NU, NC>,
    {
        let settings = task.spec.settings();
        let units = settings.samples.div_ceil(UNIT) as usize;
        let bytes = units * settings.horizon as usize * size_of::<[f64; NU]>();
        let most = (PARTIAL_BYTES / bytes).max(1);
        let mut results = Vec::with_capacity(task.problems.len());
        for problems in task.problems.chunks(most) {
            results.extend(self.improve(system, cost, &MppiTask { problems, ..*task }));
        }
        Ok(results)
    }

    /// The results of all problems of `task` at a time.
    fn improve<S, C, const NX: usize, const NU: usize, const NC: usize>(
        &self,
        system: &S,
        cost: &C,
        task: &MppiTask<'_, NX, NU, NC>,
    ) -> Vec<MppiResult<NU>>
    where
        S: System<NX, NU>,
        C: Cost<NX, NU, NC>,
    {
        let value = task.value.map(|value| self.packed(value.network));
        let disturbance = task.disturbance.map(|asked| self.packed(asked.network));
        let samples = task.spec.settings().samples;
        let mut costs = match task.costs {
            CostQuery::Summary => Vec::new(),
            CostQuery::Each => vec![0.0; task.problems.len() * samples as usize],
        };
        let units = samples.div_ceil(UNIT);
        let unit_of = |number: usize| {
            let first = (number as u32 % units) * UNIT;
            (number / units as usize, first..(first + UNIT).min(samples))
        };
        let count = task.problems.len() * units as usize;
        let outs = cut(&mut costs, samples as usize, count).into_iter();
        let parts: Vec<Partial<NU>> = spread(&self.pool, outs, |number, costs| {
            let (problem, samples) = unit_of(number);
            let networks = [value.as_deref(), disturbance.as_deref()];
            let unit = MppiRollout { system, cost, task, networks, problem, samples, costs };
            run(self.instructions, unit)
        });
        let merged = parts.chunks(units as usize).zip(task.problems).enumerate();
        let results = merged.map(|(number, (parts, problem))| {
            let settings = task.spec.settings();
            let mut all = Partial::none(settings.horizon as usize);
            parts.iter().for_each(|part| all.merge(part, settings.temperature));
            let costs = match task.costs {
                CostQuery::Summary => Vec::new(),
                CostQuery::Each => costs[number * samples as usize..][..samples as usize].to_vec(),
            };
            all.finish(samples, &problem.plan, &settings.bounds, costs)
        });
        results.collect()
    }
}

/// `costs` by units: `count` parts, none where no costs are wanted.
fn cut(costs: &mut [f32], samples: usize, count: usize) -> Vec<Option<&mut [f32]>> {
    if costs.is_empty() {
        return (0..count).map(|_| None).collect();
    }
    let problems = costs.chunks_mut(samples);
    problems.flat_map(|problem| problem.chunks_mut(UNIT as usize)).map(Some).collect()
}
