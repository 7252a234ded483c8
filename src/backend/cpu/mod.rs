//! The native CPU backend: tiles of trajectories in SIMD lanes, tiles spread over threads.

use rayon::prelude::*;

use super::{MeasureSink, PairSink};
use crate::error::{Error, Result};
use crate::policy::Policy;
use crate::rollout::{
    DeviationTask, Farthest, Fold, HUGE, NON_FINITE, PairControl, PairMeasure, Plant, Query,
    ReachAvoidTask,
};
use crate::system::System;

/// Starts whose results are held at a time.
const CHUNK: u64 = 65_536;

/// The host's processor.
#[derive(Debug)]
pub struct Cpu {
    pool: rayon::ThreadPool,
    model: String,
}

impl Cpu {
    /// The processor with `threads` threads of its own; by default as many as it runs at once.
    ///
    /// # Errors
    /// [`Error::Invalid`] for 0 threads, [`Error::Device`] if the system refuses them.
    pub fn new(threads: Option<usize>) -> Result<Self> {
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
        Ok(Self {
            pool,
            model: model_name(),
        })
    }

    /// The processor in words: model, threads and instruction set.
    pub fn device(&self) -> String {
        let threads = self.pool.current_num_threads();
        let plural = if threads == 1 { "" } else { "s" };
        format!("{}, {threads} thread{plural}", self.model)
    }

    /// See [`super::Backend::reach_avoid`].
    pub(super) fn reach_avoid<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &ReachAvoidTask<'_, NX>,
        sink: MeasureSink<'_>,
    ) -> Result<()>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let mut first = task.range.start;
        while first < task.range.end {
            let end = task.range.end.min(first + CHUNK);
            let measure = |index: u64| {
                let measure = rollout(plant, task, task.starts.start(index));
                match task.query {
                    Query::Sign if measure > 0.0 => 1.0,
                    Query::Sign if measure > NON_FINITE => -1.0,
                    _ => measure,
                }
            };
            let values: Vec<f32> = self
                .pool
                .install(|| (first..end).into_par_iter().map(measure).collect());
            sink(first, &values)?;
            first = end;
        }
        Ok(())
    }

    /// See [`super::Backend::deviation`].
    pub(super) fn deviation<S, P, const NX: usize, const NU: usize>(
        &self,
        plant: Plant<'_, S, P>,
        task: &DeviationTask<'_, NX>,
        sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>>
    where
        S: System<NX, NU>,
        P: Policy<NX, NU>,
    {
        let mut farthest = vec![Farthest::NONE; task.spec.horizon as usize + 1];
        let mut first = task.range.start;
        while first < task.range.end {
            let end = task.range.end.min(first + CHUNK);
            let both: Vec<(PairMeasure, Vec<f32>)> = self.pool.install(|| {
                let pairs = (first..end).into_par_iter();
                pairs.map(|pair| side_by_side(plant, task, pair)).collect()
            });
            for (pair, (_, distances)) in (first..end).zip(&both) {
                for (farthest, &distance) in farthest.iter_mut().zip(distances) {
                    *farthest = farthest.merge(Farthest { distance, pair });
                }
            }
            let measures: Vec<PairMeasure> = both.into_iter().map(|(measure, _)| measure).collect();
            sink(first, &measures)?;
            first = end;
        }
        Ok(farthest)
    }
}

/// Fold of one trajectory that a state or margin that is not finite ends.
struct Judge {
    fold: Fold<f32>,
    failed: bool,
}

impl Judge {
    fn add<S: System<NX, NU>, const NX: usize, const NU: usize>(
        &mut self,
        system: &S,
        x: [f32; NX],
        less: [f32; 2],
        gamma: f32,
    ) {
        let (target, constraint) = (system.target(x) - less[0], system.constraint(x) - less[1]);
        let finite = |x: &f32| x.to_bits() & 0x7f80_0000 != 0x7f80_0000;
        self.failed |= !x.iter().chain(&[target, constraint]).all(finite);
        if !self.failed {
            self.fold.add(target, constraint, gamma);
        }
    }

    fn measure(&self) -> f32 {
        let measure = self.fold.measure();
        if self.failed && measure <= 0.0 {
            NON_FINITE
        } else {
            measure
        }
    }
}

fn rollout<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    Plant { system, policy }: Plant<'_, S, P>,
    task: &ReachAvoidTask<'_, NX>,
    mut x: [f32; NX],
) -> f32 {
    let mut judge = Judge {
        fold: Fold::new(),
        failed: false,
    };
    for t in 0..=task.spec.horizon as usize {
        let less = [task.tightening.target[t], task.tightening.constraint[t]];
        judge.add(system, x, less, task.spec.gamma);
        x = system.step(x, policy.control(x));
    }
    judge.measure()
}

fn side_by_side<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    Plant { system, policy }: Plant<'_, S, P>,
    task: &DeviationTask<'_, NX>,
    pair: u64,
) -> (PairMeasure, Vec<f32>) {
    let [mut nominal, mut perturbed] = task.pairs.load::<1>(pair).map(|x| x.map(|x| x.0[0]));
    let new = || Judge {
        fold: Fold::new(),
        failed: false,
    };
    let [mut first, mut second] = [new(), new()];
    let mut distances = Vec::new();
    for t in 0..=task.spec.horizon as usize {
        let square = (0..NX).fold(0.0, |sum, i| {
            let gap = perturbed[i] - nominal[i];
            sum + gap * gap
        });
        let distance: f32 = f32::sqrt(square);
        distances.push(if distance.is_finite() { distance } else { HUGE });
        let less = [task.tightening.target[t], task.tightening.constraint[t]];
        first.add(system, nominal, less, task.spec.gamma);
        second.add(system, perturbed, [0.0; 2], task.spec.gamma);
        let u = policy.control(nominal);
        perturbed = match task.control {
            PairControl::Replay => system.step(perturbed, u),
            PairControl::ClosedLoop => system.step(perturbed, policy.control(perturbed)),
        };
        nominal = system.step(nominal, u);
    }
    let measure = PairMeasure {
        nominal: first.measure(),
        perturbed: second.measure(),
    };
    (measure, distances)
}

/// The processor's name as the system knows it, else its architecture.
fn model_name() -> String {
    let listed = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let named = listed
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    named.map_or(std::env::consts::ARCH.to_owned(), |(_, name)| {
        name.trim().to_owned()
    })
}
