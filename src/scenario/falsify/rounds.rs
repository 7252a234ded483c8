//! Cross-entropy over starts: rounds of draws from what the best of the rounds before have in common.

use super::trials::{Candidate, Trials};
use crate::error::Result;
use crate::rollout::Stream;

/// Starts of a round: these, and so many more for each coordinate.
const POPULATION: [usize; 2] = [32, 16];
/// A round's share that the next one is drawn from, one in so many.
const ELITE: usize = 4;
/// Most rounds of a cloud.
const MOST_ROUNDS: u32 = 25;
/// Rounds without a better start after which a cloud is left.
const PATIENCE: u32 = 5;
/// Spread in every coordinate below which a cloud is a point.
const POINT: f64 = 1e-7;
/// Share of the difference of two of the best that a third is moved by: draws that lie along a ridge.
const DIFFERENCE: f64 = 0.7;
/// Share of the spread that such a start is moved by besides.
const JITTER: f64 = 0.1;
/// The block of words that picks the three; those of normals lie below.
const PICKS: u32 = 1 << 16;

/// Rounds of draws around the best starts.
pub(super) struct Rounds {
    stream: Stream,
    dimension: usize,
    /// Draws so far.
    drawn: u64,
}

impl Rounds {
    /// Rounds of draws from `stream`.
    pub(super) fn new(stream: Stream, dimension: usize) -> Self {
        Self { stream, dimension, drawn: 0 }
    }

    /// The best start that rounds from `cloud` on come to; none of no cloud.
    ///
    /// # Errors
    /// Those of the trials.
    pub(super) fn run(
        mut self,
        trials: &mut Trials<'_>,
        cloud: Vec<Candidate>,
    ) -> Result<Option<Candidate>> {
        let population = POPULATION[0] + POPULATION[1] * self.dimension;
        let mut elite = best(cloud, population / ELITE);
        let mut since = 0;
        for _ in 0..MOST_ROUNDS {
            let Some(least) = elite.first().map(|first| first.measure) else { break };
            let spread = Spread::of(&elite);
            if trials.is_over() || since == PATIENCE || spread.is_point() {
                break;
            }
            let draws = (0..population).map(|i| self.draw(&elite, &spread, i)).collect();
            let mut all = trials.run(draws)?;
            all.extend(elite);
            elite = best(all, population / ELITE);
            since = if elite[0].measure < least { 0 } else { since + 1 };
        }
        Ok(elite.into_iter().next())
    }

    /// A start of the next round: of every two, one normal around the mean of the best, and one of the
    /// best moved along the difference of two others.
    fn draw(&mut self, elite: &[Candidate], spread: &Spread, number: usize) -> Vec<f64> {
        let index = self.drawn;
        self.drawn += 1;
        let normals = self.stream.normals(index, self.dimension);
        let noise = |i: usize| spread.deviation[i] * f64::from(normals[i]);
        if number.is_multiple_of(2) {
            return (0..self.dimension).map(|i| spread.mean[i] + noise(i)).collect();
        }
        let words = self.stream.words::<1>(index, PICKS);
        let pick = |word: usize| &elite[words[word][0] as usize % elite.len()].u;
        let (from, ahead, behind) = (pick(0), pick(1), pick(2));
        let moved = |i: usize| from[i] + DIFFERENCE * (ahead[i] - behind[i]) + JITTER * noise(i);
        (0..self.dimension).map(moved).collect()
    }
}

/// The `count` candidates with the smallest measures, the best first.
fn best(mut candidates: Vec<Candidate>, count: usize) -> Vec<Candidate> {
    candidates.sort_by(|a, b| a.measure.total_cmp(&b.measure));
    candidates.truncate(count);
    candidates
}

/// Mean and standard deviation of each coordinate.
struct Spread {
    mean: Vec<f64>,
    deviation: Vec<f64>,
}

impl Spread {
    fn of(elite: &[Candidate]) -> Self {
        let (count, dimension) = (elite.len() as f64, elite.first().map_or(0, |one| one.u.len()));
        let mean = |i: usize| elite.iter().map(|one| one.u[i]).sum::<f64>() / count;
        let mean: Vec<f64> = (0..dimension).map(mean).collect();
        let variance =
            |i: usize| elite.iter().map(|one| (one.u[i] - mean[i]).powi(2)).sum::<f64>() / count;
        let deviation = (0..dimension).map(|i| variance(i).sqrt()).collect();
        Self { mean, deviation }
    }

    fn is_point(&self) -> bool {
        self.deviation.iter().all(|deviation| *deviation < POINT)
    }
}
