//! What pairs came to: the farthest of each step and counts, cut and merged to the same bits.

use std::ops::Range;

use super::fold::NON_FINITE;
use super::held::{Held, Keep};
use super::spec::{Farthest, PairMeasure};
use crate::error::{Error, Result};

/// How pairs fared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairCounts {
    /// All of them.
    pub pairs: u64,
    /// Pairs whose nominal rollout has a measure above 0, with tightened margins.
    pub accepted: u64,
    /// Accepted pairs whose perturbed rollout has none above 0.
    pub failures: u64,
    /// Pairs whose perturbed rollout has a measure above 0.
    pub reached: u64,
    /// Pairs of which a rollout failed for a state that is not finite, or has a measure of NaN.
    pub non_finite: u64,
}

impl PairCounts {
    /// That of `pairs`.
    pub(crate) fn of_all(pairs: &[PairMeasure]) -> Self {
        let mut all = Self::default();
        all.add(pairs);
        all
    }

    /// Adds pairs.
    fn add(&mut self, pairs: &[PairMeasure]) {
        let broken = |measure: f32| measure.is_nan() || measure <= NON_FINITE;
        self.pairs += pairs.len() as u64;
        for PairMeasure { nominal, perturbed } in pairs {
            let (accepted, reached) = (*nominal > 0.0, *perturbed > 0.0);
            self.accepted += u64::from(accepted);
            self.failures += u64::from(accepted && !reached);
            self.reached += u64::from(reached);
            self.non_finite += u64::from(broken(*nominal) || broken(*perturbed));
        }
    }

    /// Adds other pairs.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.pairs += other.pairs;
        self.accepted += other.accepted;
        self.failures += other.failures;
        self.reached += other.reached;
        self.non_finite += other.non_finite;
    }
}

/// What a whole range of pairs came to.
#[derive(Clone, Debug)]
pub struct PairResults {
    /// How they fared.
    pub counts: PairCounts,
    /// The farthest pair of each step, `[T + 1]`.
    pub farthest: Vec<Farthest>,
    /// The measures of each pair in order of index, `[pairs]`; empty where they were not kept.
    pub values: Vec<PairMeasure>,
}

/// What some pairs of a task came to, by their index.
///
/// Ranges of pairs may be cut anywhere and merged in any order: counts, farthest pairs and values are the
/// same to the last bit. Whether two tallies are of the same task is for the caller to know.
#[derive(Clone, Debug)]
pub struct PairTally {
    held: Held<PairMeasure>,
    counts: PairCounts,
    farthest: Vec<Farthest>,
}

impl PairTally {
    /// No pair yet, of rollouts of `horizon` steps.
    pub fn new(horizon: u32, keep: Keep) -> Self {
        let farthest = vec![Farthest::NONE; horizon as usize + 1];
        Self { held: Held::new("pairs", keep), counts: PairCounts::default(), farthest }
    }

    /// Adds the measures of the pairs `first..first + pairs.len()`, whose distances come with
    /// [`PairTally::reach`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has one of these pairs; it is not changed then.
    pub(crate) fn add(&mut self, first: u64, pairs: &[PairMeasure]) -> Result<()> {
        self.held.add(first, pairs)?;
        self.counts.add(pairs);
        Ok(())
    }

    /// Adds how the pairs from `first` on fared, as many as `counts` has.
    ///
    /// # Errors
    /// [`Error::Invalid`] as [`PairTally::add`], and if it keeps measures.
    pub(crate) fn add_counts(&mut self, first: u64, counts: &PairCounts) -> Result<()> {
        self.held.add_counted(first, counts.pairs)?;
        self.counts.merge(counts);
        Ok(())
    }

    /// Adds the farthest pair of each step, `[T + 1]`, among pairs whose measures were added.
    pub(crate) fn reach(&mut self, farthest: &[Farthest]) {
        Farthest::merge_steps(&mut self.farthest, farthest);
    }

    /// Adds the pairs of `other`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if both have the same pair, their horizons differ, or one keeps measures and
    /// one does not; neither is changed then.
    pub fn merge(&mut self, other: Self) -> Result<()> {
        let [mine, theirs] = [self, &other].map(|tally| tally.farthest.len() - 1);
        if mine != theirs {
            let problem = format!("of {mine} steps; the other is of {theirs} steps");
            return Err(Error::invalid("tally", problem));
        }
        self.held.merge(other.held)?;
        self.counts.merge(&other.counts);
        self.reach(&other.farthest);
        Ok(())
    }

    /// How its pairs fared.
    pub fn counts(&self) -> &PairCounts {
        &self.counts
    }

    /// The farthest of its pairs at each step, `[T + 1]`.
    pub fn farthest(&self) -> &[Farthest] {
        &self.farthest
    }

    /// The pairs that it has, in order; of two ranges none overlaps or touches the other.
    pub fn ranges(&self) -> impl Iterator<Item = Range<u64>> {
        self.held.stretches()
    }

    /// The first pairs of `range` that are missing.
    pub fn missing(&self, range: Range<u64>) -> Option<Range<u64>> {
        self.held.missing(&range)
    }

    /// What the pairs `range` came to, all of them and no others.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first pairs that are missing, or some that lie outside.
    pub fn finish(self, range: Range<u64>) -> Result<PairResults> {
        let values = self.held.finish(&range)?;
        Ok(PairResults { counts: self.counts, farthest: self.farthest, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pair of each kind; the last ones are not finite, or no number.
    const PAIRS: [[f32; 2]; 6] =
        [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [0.0, 0.0], [NON_FINITE, 2.0], [1.0, f32::NAN]];
    /// How far each is at the one step; two are as far.
    const FAR: [f32; 6] = [0.1, 0.3, 0.2, 0.3, 0.0, 0.3];

    fn measures(range: Range<usize>) -> Vec<PairMeasure> {
        let of = |[nominal, perturbed]: &[f32; 2]| PairMeasure {
            nominal: *nominal,
            perturbed: *perturbed,
        };
        PAIRS[range].iter().map(of).collect()
    }

    fn tally(range: Range<usize>) -> PairTally {
        let mut tally = PairTally::new(1, Keep::Measures);
        tally.add(range.start as u64, &measures(range.clone())).unwrap();
        for pair in range {
            let steps = [FAR[pair], -FAR[pair] + 0.5];
            tally.reach(&steps.map(|distance| Farthest { distance, pair: pair as u64 }));
        }
        tally
    }

    #[test]
    fn kinds_are_counted_wherever_pairs_are_cut() {
        for a in 0..=PAIRS.len() {
            for [first, second] in [[0..a, a..PAIRS.len()], [a..PAIRS.len(), 0..a]] {
                let mut all = tally(first);
                all.merge(tally(second)).unwrap();
                let PairResults { counts, farthest, values } = all.finish(0..6).unwrap();
                let wanted =
                    PairCounts { pairs: 6, accepted: 3, failures: 2, reached: 3, non_finite: 2 };
                assert_eq!(counts, wanted, "{a}");
                let far = |distance, pair| Farthest { distance, pair };
                assert_eq!(farthest, [far(0.3, 1), far(0.5, 4)], "{a}");
                let pairs = values.iter().zip(measures(0..6));
                let same = |a: f32, b: f32| a.to_bits() == b.to_bits();
                assert!(
                    pairs.clone().all(|(a, b)| same(a.nominal, b.nominal))
                        && pairs.clone().all(|(a, b)| same(a.perturbed, b.perturbed))
                        && values.len() == 6
                );
            }
        }
    }

    #[test]
    fn pairs_that_do_not_fit_are_refused_and_change_nothing() {
        let known = tally(1..4);
        let other_horizon = PairTally::new(2, Keep::Measures);
        for (other, words) in [
            (tally(3..6), "pairs 3..6 meet those of 1..4"),
            (other_horizon, "of 1 steps; the other is of 2 steps"),
            (PairTally::new(1, Keep::Counts), "Measures and Counts"),
        ] {
            let mut changed = known.clone();
            let problem = changed.merge(other).unwrap_err().to_string();
            assert!(problem.contains(words), "{problem}");
            assert_eq!((changed.counts(), changed.farthest()), (known.counts(), known.farthest()));
            assert!(changed.ranges().eq(std::iter::once(1..4)));
        }
        assert_eq!(known.missing(0..6), Some(0..1));
        let gap = known.finish(1..6).unwrap_err().to_string();
        assert!(gap.contains("pairs 4..6 of 1..6 are missing"), "{gap}");
    }
}
