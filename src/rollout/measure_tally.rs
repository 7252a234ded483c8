//! What starts came to: counts and extremes of their measures, cut and merged to the same bits.

use std::ops::Range;

use super::fold::NON_FINITE;
use super::held::{Held, Keep};
use crate::error::Result;

/// A measure and the start that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    /// The reach-avoid measure, or its sign.
    pub measure: f32,
    /// Index of the start.
    pub start: u64,
}

impl Extreme {
    /// Of two, the one that lies `beyond` the other; of equal ones the first start.
    fn of(mine: Option<Self>, other: Option<Self>, beyond: fn(&f32, &f32) -> bool) -> Option<Self> {
        let (Some(a), Some(b)) = (mine, other) else { return mine.or(other) };
        let before = b.measure == a.measure && b.start < a.start;
        Some(if beyond(&b.measure, &a.measure) || before { b } else { a })
    }
}

/// How starts fared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeasureCounts {
    /// All of them.
    pub starts: u64,
    /// Those that reach the target safely: the measure is above 0.
    pub successes: u64,
    /// Those that failed for a state that is not finite ([`NON_FINITE`]), or whose measure is NaN.
    pub non_finite: u64,
    /// The least measure, of the first start that has it; none where no measure is a number.
    pub least: Option<Extreme>,
    /// The greatest measure, likewise.
    pub greatest: Option<Extreme>,
}

impl MeasureCounts {
    /// Starts that do not reach the target safely; one without a measure among them.
    pub fn failures(&self) -> u64 {
        self.starts - self.successes
    }

    /// That of one start.
    fn of(start: u64, measure: f32) -> Self {
        let number = (!measure.is_nan()).then_some(Extreme { measure, start });
        Self {
            starts: 1,
            successes: u64::from(measure > 0.0),
            non_finite: u64::from(measure.is_nan() || measure <= NON_FINITE),
            least: number,
            greatest: number,
        }
    }

    /// That of the starts `first..first + values.len()`.
    pub(crate) fn of_all(first: u64, values: &[f32]) -> Self {
        let mut all = Self::default();
        (first..).zip(values).for_each(|(start, value)| all.merge(&Self::of(start, *value)));
        all
    }

    /// Adds other starts.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.starts += other.starts;
        self.successes += other.successes;
        self.non_finite += other.non_finite;
        self.least = Extreme::of(self.least, other.least, f32::lt);
        self.greatest = Extreme::of(self.greatest, other.greatest, f32::gt);
    }
}

/// What a whole range of starts came to.
#[derive(Clone, Debug)]
pub struct Measures {
    /// How they fared.
    pub counts: MeasureCounts,
    /// The measure of each in order of index, `[starts]`; empty where they were not kept.
    pub values: Vec<f32>,
}

/// What some starts of a task came to, by their index.
///
/// Ranges of starts may be cut anywhere and merged in any order: counts, extremes and values are the same
/// to the last bit. Whether two tallies are of the same task is for the caller to know.
#[derive(Clone, Debug)]
pub struct MeasureTally {
    held: Held<f32>,
    counts: MeasureCounts,
}

impl MeasureTally {
    /// No start yet.
    pub fn new(keep: Keep) -> Self {
        Self { held: Held::new("starts", keep), counts: MeasureCounts::default() }
    }

    /// Adds the measures, or signs, of the starts `first..first + values.len()`: what a sink receives.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if it has one of these starts; it is not changed then.
    pub fn add(&mut self, first: u64, values: &[f32]) -> Result<()> {
        self.held.add(first, values)?;
        self.counts.merge(&MeasureCounts::of_all(first, values));
        Ok(())
    }

    /// Adds what the starts from `first` on came to, as many as `counts` has.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] as [`MeasureTally::add`], and if it keeps measures.
    pub(crate) fn add_counts(&mut self, first: u64, counts: &MeasureCounts) -> Result<()> {
        self.held.add_counted(first, counts.starts)?;
        self.counts.merge(counts);
        Ok(())
    }

    /// Adds the starts of `other`.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if both have the same start, or one keeps measures and one does not;
    /// neither is changed then.
    pub fn merge(&mut self, other: Self) -> Result<()> {
        self.held.merge(other.held)?;
        self.counts.merge(&other.counts);
        Ok(())
    }

    /// How its starts fared.
    pub fn counts(&self) -> &MeasureCounts {
        &self.counts
    }

    /// The starts that it has, in order; of two ranges none overlaps or touches the other.
    pub fn ranges(&self) -> impl Iterator<Item = Range<u64>> {
        self.held.stretches()
    }

    /// The first starts of `range` that are missing.
    pub fn missing(&self, range: Range<u64>) -> Option<Range<u64>> {
        self.held.missing(&range)
    }

    /// What the starts `range` came to, all of them and no others.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the first starts that are missing, or some that lie outside.
    pub fn finish(self, range: Range<u64>) -> Result<Measures> {
        let values = self.held.finish(&range)?;
        Ok(Measures { counts: self.counts, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equal ones, both zeros, infinities, what is not finite, what is no number.
    const VALUES: [f32; 9] =
        [0.0, -0.0, f32::NAN, 2.0, NON_FINITE, 2.0, f32::NAN, NON_FINITE, -f32::NAN];
    const FIRST: u64 = 40;

    fn tally(range: Range<usize>, keep: Keep) -> MeasureTally {
        let mut tally = MeasureTally::new(keep);
        tally.add(FIRST + range.start as u64, &VALUES[range]).unwrap();
        tally
    }

    /// Everything that a tally says, in bits.
    #[derive(Clone, Debug, PartialEq)]
    struct Bits {
        ranges: Vec<Range<u64>>,
        /// Least and greatest, with their starts.
        extremes: [Option<(u32, u64)>; 2],
        /// Starts, successes, not finite.
        counts: [u64; 3],
        values: Vec<u32>,
    }

    fn bits(tally: MeasureTally) -> Bits {
        let ranges: Vec<Range<u64>> = tally.ranges().collect();
        let range = ranges[0].clone();
        let Measures { counts, values } = tally.finish(range).unwrap();
        let MeasureCounts { starts, successes, non_finite, least, greatest } = counts;
        let extremes = [least, greatest].map(|of| of.map(|of| (of.measure.to_bits(), of.start)));
        let values = values.into_iter().map(f32::to_bits).collect();
        Bits { ranges, extremes, counts: [starts, successes, non_finite], values }
    }

    #[test]
    fn every_cut_in_every_order_is_the_whole() {
        let length = VALUES.len();
        for keep in [Keep::Counts, Keep::Measures] {
            let whole = bits(tally(0..length, keep));
            for (a, b) in (0..=length).flat_map(|b| (0..=b).map(move |a| (a, b))) {
                let parts = [0..a, a..b, b..length];
                for [i, j, k] in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]]
                {
                    let [one, two, three] = [i, j, k].map(|i| tally(parts[i].clone(), keep));
                    let (mut left, mut right) = (one.clone(), two.clone());
                    left.merge(two).unwrap();
                    left.merge(three.clone()).unwrap();
                    right.merge(three).unwrap();
                    let mut nested = one;
                    nested.merge(right).unwrap();
                    let mut sent = MeasureTally::new(keep);
                    for range in [i, j, k].map(|i| parts[i].clone()) {
                        sent.add(FIRST + range.start as u64, &VALUES[range]).unwrap();
                    }
                    assert_eq!([left, nested, sent].map(bits), [(); 3].map(|()| whole.clone()));
                }
            }
        }
    }

    #[test]
    fn what_is_no_number_is_counted_and_kept() {
        let Bits { ranges, extremes, counts, values } =
            bits(tally(0..VALUES.len(), Keep::Measures));
        assert!(ranges.into_iter().eq(std::iter::once(40..49)));
        assert_eq!(counts, [9, 2, 5]);
        assert_eq!(extremes, [Some((NON_FINITE.to_bits(), 44)), Some((2.0_f32.to_bits(), 43))]);
        assert_eq!(values, VALUES.map(f32::to_bits));
        assert_eq!(tally(0..9, Keep::Counts).counts().failures(), 7);
        let none = tally(2..3, Keep::Counts);
        let MeasureCounts { starts, non_finite, least, greatest, .. } = *none.counts();
        assert_eq!((starts, non_finite, least, greatest), (1, 1, None, None));
        let zeros = bits(tally(0..2, Keep::Counts));
        assert_eq!(zeros.extremes, [Some((0.0_f32.to_bits(), 40)); 2], "of equal ones the first");
    }

    /// What `change` refuses, with the tally as it was.
    fn refused(
        tally: &MeasureTally,
        change: impl FnOnce(&mut MeasureTally) -> Result<()>,
    ) -> String {
        let (mut changed, before) = (tally.clone(), bits(tally.clone()));
        let problem = change(&mut changed).unwrap_err().to_string();
        assert_eq!(bits(changed), before, "{problem}");
        problem
    }

    #[test]
    fn overlaps_are_refused_and_change_nothing() {
        let known = tally(2..5, Keep::Measures);
        for range in [0..3, 4..9, 2..5, 3..4, 0..9] {
            let meets = format!("{}..{} meet those of 42..45", 40 + range.start, 40 + range.end);
            let part = tally(range.clone(), Keep::Measures);
            let problem = refused(&known, |known| known.merge(part));
            assert!(problem.contains(&meets), "{problem}");
            let first = 40 + range.start as u64;
            let problem = refused(&known, |known| known.add(first, &VALUES[range]));
            assert!(problem.contains(&meets), "{problem}");
        }
        // The first of its stretches is free, the second is not.
        let mut parts = tally(0..1, Keep::Measures);
        parts.merge(tally(4..6, Keep::Measures)).unwrap();
        let problem = refused(&known, |known| known.merge(parts));
        assert!(problem.contains("44..46 meet those of 42..45"), "{problem}");
        let other = tally(5..6, Keep::Counts);
        let problem = refused(&known, |known| known.merge(other));
        assert!(problem.contains("Measures and Counts"), "{problem}");
        let problem = refused(&known, |known| known.add(u64::MAX, &[1.0; 2]));
        assert!(problem.contains("2 starts from number 18446744073709551615"), "{problem}");
        // Nothing meets nothing.
        let mut known = known;
        known.add(43, &[]).unwrap();
        assert_eq!(known.counts().starts, 3);
    }

    #[test]
    fn gaps_and_what_lies_outside_are_named() {
        let mut parts = tally(6..8, Keep::Measures);
        parts.merge(tally(1..3, Keep::Measures)).unwrap();
        assert_eq!(parts.ranges().collect::<Vec<_>>(), [41..43, 46..48]);
        for (range, missing) in [
            (40..49, Some(40..41)),
            (41..49, Some(43..46)),
            (42..45, Some(43..45)),
            (47..60, Some(48..60)),
            (41..43, None),
            (46..47, None),
            (44..44, None),
        ] {
            assert_eq!(parts.missing(range.clone()), missing, "{range:?}");
        }
        let finish = |range| parts.clone().finish(range).unwrap_err().to_string();
        let gap = finish(41..48);
        assert!(gap.contains("starts 43..46 of 41..48 are missing"), "{gap}");
        let outside = finish(41..43);
        assert!(
            outside.contains("has the starts 46..48") && outside.contains("41..43"),
            "{outside}"
        );
        parts.merge(tally(3..6, Keep::Measures)).unwrap();
        assert!(parts.ranges().eq(std::iter::once(41..48)));
        assert!(parts.clone().finish(41..47).is_err() && parts.clone().finish(42..48).is_err());
        assert!(parts.finish(41..48).is_ok());
        assert!(MeasureTally::new(Keep::Counts).finish(5..5).is_ok());
    }
}
