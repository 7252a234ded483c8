//! The search for a failing start: uniform draws, then from the best of them cross-entropy and descent,
//! again and again until one fails or the budget is spent.
//!
//! It finds what the measure slopes to. That it finds nothing says what was tried, and no more.

mod against;
mod descent;
mod domain;
mod file;
mod pairs;
mod record;
mod rounds;
mod settings;
mod trials;

pub use against::{Against, Target};
pub use file::{FileRecord, roll_out};
pub use pairs::PairSettings;
pub use record::{BestStart, FalsifyRecord, Improvement};
pub use settings::FalsifySettings;

use self::domain::Domain;
use self::rounds::Rounds;
use self::trials::{Candidate, Trials};
use super::{Context, Watch, purpose};
use crate::backend::Program;
use crate::error::Result;
use crate::rollout::Stream;

/// Share of the budget that goes to uniform draws, at most [`MOST_UNIFORM`] of them.
const UNIFORM_SHARE: u64 = 4;
/// Most uniform draws at the start.
const MOST_UNIFORM: u64 = 20_000;
/// Starts that the first cross-entropy begins with, and that later ones may begin around.
const POOL: usize = 64;
/// Uniform draws of which a restart takes the best, once the pool is used up.
const FRESH: u64 = 500;
/// Width of the cloud around the start that a restart begins at, of coordinates from -1 to 1.
const CLOUD: f64 = 0.1;

/// Looks for a start of the region that fails under the policy, with at most the budget of rollouts.
///
/// The same settings give the same rollouts on any number of threads. A start is found where it fails on
/// the backend and in f64.
///
/// # Errors
/// [`crate::Error::Invalid`] for a budget or region that nothing can be searched with; those of the backend;
/// [`crate::Error::Interrupted`] if `watch` says so.
pub fn falsify(
    program: &Program<'_>,
    settings: &FalsifySettings,
    watch: &dyn Watch,
) -> Result<FalsifyRecord> {
    settings.check()?;
    let context = Context { program, watch };
    let domain = Domain::new(settings, &program.plant().model)?;
    watch.begin("search for a failure", settings.budget);
    let trials = Trials::new(context, settings, &domain);
    let mut search = Search { settings, domain: &domain, trials, streams: 0, restarts: 0 };
    let uniform = search.explore((settings.budget / UNIFORM_SHARE).clamp(1, MOST_UNIFORM))?;
    let explored = search.trials.counted();
    let explored_failures = search.trials.failures();
    search.restart_until_over(uniform)?;
    Ok(search.trials.record(explored, explored_failures, search.restarts))
}

/// A search that goes on.
struct Search<'a> {
    settings: &'a FalsifySettings,
    domain: &'a Domain,
    trials: Trials<'a>,
    /// Streams used so far.
    streams: u32,
    /// Clouds of starts that were followed so far.
    restarts: u64,
}

impl Search<'_> {
    /// A stream that nothing was drawn from yet.
    fn stream(&mut self) -> Stream {
        self.streams += 1;
        Stream::new(self.settings.seed, purpose::FALSIFY, self.streams)
    }

    /// The best of so many uniform draws, the best first.
    fn explore(&mut self, draws: u64) -> Result<Vec<Candidate>> {
        let streams = [self.stream(), self.stream()];
        let starts = (0..draws).map(|index| self.domain.point(streams, index)).collect();
        let mut tried = self.trials.run_starts(starts)?;
        tried.truncate(POOL);
        Ok(tried)
    }

    /// Follows one cloud after the other until a failure is found or the budget is spent: that of the
    /// best uniform draws first, then one around each of them, then around fresh ones.
    fn restart_until_over(&mut self, pool: Vec<Candidate>) -> Result<()> {
        let mut centres = self.domain.apart(pool.iter().map(|tried| &tried.u), CLOUD).into_iter();
        let mut cloud = pool;
        while !self.trials.is_over() {
            self.restarts += 1;
            let stream = self.stream();
            let best = Rounds::new(stream, self.domain.dimension()).run(&mut self.trials, cloud)?;
            if let Some(best) = best {
                descent::descend(&mut self.trials, best)?;
            }
            cloud = match centres.next() {
                Some(centre) => self.around(&centre)?,
                None => self.explore(FRESH)?,
            };
        }
        Ok(())
    }

    /// Starts around `centre`, the best first.
    fn around(&mut self, centre: &[f64]) -> Result<Vec<Candidate>> {
        if self.trials.is_over() {
            return Ok(Vec::new());
        }
        let (stream, dimension) = (self.stream(), centre.len());
        let near = |index: u64| {
            let normals = stream.normals(index, dimension);
            centre.iter().zip(normals).map(|(u, z)| u + CLOUD * f64::from(z)).collect()
        };
        self.trials.run((0..POOL as u64).map(near).collect())
    }
}
