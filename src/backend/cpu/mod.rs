//! The native CPU backend: tiles of trajectories in SIMD lanes, tiles spread over threads.

mod chained;
mod deviation;
mod dispatch;
mod early_exit;
mod interpreted;
mod interpreted_cost;
mod interpreted_stages;
mod kernel;
#[cfg(target_arch = "x86_64")]
mod kernel_x86;
mod load;
mod lookups;
mod mlp;
mod mppi;
mod mppi_rollout;
mod mppi_update;
mod packs;
mod planning;
mod prepared;
mod reach_avoid;
mod rule;
mod schedule;
mod spread;
#[cfg(test)]
mod tests;
mod tile;

use std::path::Path;
use std::sync::Arc;

use self::deviation::Deviation;
use self::dispatch::{rows, run};
use self::mlp::Packed;
use self::packs::Packs;
pub(super) use self::planning::PreparedPlanning;
pub(super) use self::prepared::Prepared;
use self::reach_avoid::ReachAvoid;
use self::rule::Roles;
use self::schedule::{Schedule, chunks};
use self::spread::spread;
use self::tile::TilePlant;
use super::{Action, Event, MeasureSink, PairSink};
use crate::error::{Error, Fault, Result};
use crate::files::{CONFIG_BYTES, read_text};
use crate::policy::Mlp;
use crate::real::simd::Instructions;
use crate::rollout::{DeviationTask, Farthest, PairMeasure, ReachAvoidTask};

/// The host's processor.
#[derive(Debug)]
pub struct Cpu {
    pool: rayon::ThreadPool,
    instructions: Instructions,
    model: String,
    packs: Packs,
    /// Why it runs what an adapter was meant for.
    instead: Option<Event>,
}

impl Cpu {
    /// The processor with `threads` threads of its own; by default as many as it runs at once.
    ///
    /// The widest instructions that it has are used, whatever the program was compiled for. The
    /// results do not depend on the threads.
    ///
    /// # Errors
    /// [`Error::Invalid`] for 0 threads, [`Error::Device`] if the system refuses them.
    pub fn new(threads: Option<usize>) -> Result<Self> {
        Self::with_instructions(threads, Instructions::detect()[0])
    }

    /// One with each instruction set that the processor has, the fastest first: for benches that hold
    /// each to its floor.
    ///
    /// # Errors
    /// Those of [`Cpu::new`].
    #[doc(hidden)]
    pub fn each(threads: Option<usize>) -> Result<Vec<Self>> {
        let sets = Instructions::detect().into_iter();
        sets.map(|set| Self::with_instructions(threads, set)).collect()
    }

    /// The same with an instruction set of choice.
    fn with_instructions(threads: Option<usize>, instructions: Instructions) -> Result<Self> {
        if threads == Some(0) {
            let problem = "0 threads cannot do any work; give at least 1, or leave it out";
            return Err(Error::invalid("threads", problem));
        }
        let available = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or_else(available);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("rollout-{i}"))
            .build()
            .map_err(|e| Error::Device(format!("cannot start {threads} threads: {e}")))?;
        Ok(Self { pool, instructions, model: model_name(), packs: Packs::default(), instead: None })
    }

    /// The same processor in place of an adapter that did not open, for the reason `problem`.
    #[must_use]
    pub fn in_place_of_adapter(self, problem: String) -> Self {
        let (fault, action) = (Fault::Absent, Action::Cpu);
        let instead = Event { fault, problem, work: String::new(), index: 0, action };
        Self { instead: Some(instead), ..self }
    }

    /// See [`super::Backend::events`].
    pub(super) fn events(&self) -> Vec<Event> {
        self.instead.iter().cloned().collect()
    }

    /// The processor in words: model and instruction set. Not the number of threads: nothing that a
    /// certificate says depends on it.
    pub fn device(&self) -> String {
        format!("{}, {}", self.model, self.instructions())
    }

    /// The processor's name as the system knows it, else its architecture.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// The instruction set that the rollouts run with, in words.
    pub fn instructions(&self) -> &'static str {
        self.instructions.name()
    }

    /// Threads that the rollouts run on.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Measures of starts under any plant.
    fn measures(
        &self,
        plant: TilePlant<'_>,
        task: &ReachAvoidTask<'_>,
        sink: MeasureSink<'_>,
    ) -> Result<()> {
        let roles = &Roles::of(plant.task, &task.spec);
        let mut measures = Vec::new();
        for chunk in chunks(&task.range) {
            let schedule = self.schedule(chunk.count, plant.widest());
            measures.resize(chunk.count, 0.0);
            spread(&self.pool, measures.chunks_mut(schedule.unit), |unit, out| {
                let first = chunk.first + (unit * schedule.unit) as u64;
                let width = schedule.width;
                run(self.instructions, ReachAvoid { plant, task, roles, width, first, out });
            });
            sink(chunk.first, &measures)?;
        }
        Ok(())
    }

    /// Pairs under any plant.
    fn pairs(
        &self,
        plant: TilePlant<'_>,
        task: &DeviationTask<'_>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>> {
        let roles = &Roles::of(plant.task, &task.spec);
        let mut farthest = vec![Farthest::NONE; task.spec.horizon as usize + 1];
        let mut measures = Vec::new();
        for chunk in chunks(&task.range) {
            let schedule = self.schedule(chunk.count, plant.widest());
            measures.resize(chunk.count, PairMeasure::default());
            let found = spread(&self.pool, measures.chunks_mut(schedule.unit), |unit, out| {
                let first = chunk.first + (unit * schedule.unit) as u64;
                let width = schedule.width;
                run(self.instructions, Deviation { plant, task, roles, width, first, out })
            });
            found.iter().for_each(|found| Farthest::merge_steps(&mut farthest, found));
            sink(chunk.first, &measures)?;
        }
        Ok(farthest)
    }

    /// `network`, packed for the kernel.
    fn packed(&self, network: &Mlp) -> Arc<Packed> {
        self.packs.of(network, rows(self.instructions))
    }

    /// How `count` trajectories are spread, under networks as wide as `widest`.
    fn schedule(&self, count: usize, widest: Option<usize>) -> Schedule {
        let threads = self.pool.current_num_threads();
        Schedule::new(count, threads, widest)
    }
}

/// The processor's name as the system knows it, else its architecture.
fn model_name() -> String {
    let listed = read_text(Path::new("/proc/cpuinfo"), CONFIG_BYTES).unwrap_or_default();
    let named = listed.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    named.map_or(std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}
