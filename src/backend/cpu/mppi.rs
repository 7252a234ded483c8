//! MPPI problems cut into units for the threads, their tallies put together in order.

use std::ops::Range;

use super::Cpu;
use super::dispatch::run;
use super::mppi_rollout::MppiRollout;
use super::planning::PreparedPlanning;
use super::spread::spread;
use crate::rollout::{CostQuery, MppiTask, Partial, PlanTally};

/// Samples of a unit: the softmin is merged unit by unit, so the bits depend on it. Half of the
/// study's 500 samples, so that two threads share one problem.
const UNIT: u32 = 256;
/// Most memory of the partials of the problems that are improved at a time, bytes.
const PARTIAL_BYTES: usize = 64 << 20;

impl PreparedPlanning {
    /// See [`crate::backend::PlanProgram::tally`]; tallies go to `sink` in order.
    pub(in crate::backend) fn tally(
        &self,
        cpu: &Cpu,
        task: &MppiTask<'_>,
        samples: Range<u32>,
        sink: &mut dyn FnMut(Vec<PlanTally>),
    ) {
        let units = (samples.end - samples.start).div_ceil(UNIT) as usize;
        let spec = &self.planning.spec;
        let bytes = units * spec.horizon() * spec.controls() * size_of::<f64>();
        let most = (PARTIAL_BYTES / bytes.max(1)).max(1);
        for problems in task.problems.chunks(most) {
            sink(self.at_a_time(cpu, &MppiTask { problems, ..*task }, samples.clone()));
        }
    }

    /// The tallies of all problems of `task` at a time.
    fn at_a_time(&self, cpu: &Cpu, task: &MppiTask<'_>, samples: Range<u32>) -> Vec<PlanTally> {
        let count = (samples.end - samples.start) as usize;
        let units = samples.clone().step_by(UNIT as usize);
        let units: Vec<Range<u32>> =
            units.map(|first| first..(first + UNIT).min(samples.end)).collect();
        let mut costs = match task.costs {
            CostQuery::Summary => Vec::new(),
            CostQuery::Each => vec![0.0; task.problems.len() * count],
        };
        let outs = cut(&mut costs, count, task.problems.len() * units.len()).into_iter();
        let parts: Vec<Partial> = spread(&cpu.pool, outs, |number, costs| {
            let (problem, iteration) = (&task.problems[number / units.len()], task.iteration);
            let samples = units[number % units.len()].clone();
            let with = cpu.instructions;
            run(with, MppiRollout { prepared: self, with, problem, iteration, samples, costs })
        });
        let mut tallies = vec![PlanTally::default(); task.problems.len()];
        for (number, part) in parts.into_iter().enumerate() {
            let (problem, unit) = (number / units.len(), &units[number % units.len()]);
            let first = (unit.start - samples.start) as usize;
            let mine = costs.chunks(count).nth(problem);
            let costs = mine.map_or(&[][..], |mine| &mine[first..][..unit.len()]);
            tallies[problem].add(unit.start, part, costs.to_vec());
        }
        tallies
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
