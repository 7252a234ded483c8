//! Which starts or pairs a tally has, and the values of each where they are kept.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::error::{Error, Result};

/// Whether a tally keeps what it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// Counts and extremes alone: memory does not grow with the number of rollouts.
    Counts,
    /// The measures themselves too, 4 bytes a start and 8 a pair.
    Measures,
}

/// The indices of a tally, and the value of each if kept.
#[derive(Clone, Debug)]
pub(super) struct Held<T> {
    /// What an index counts, in the plural, for errors.
    unit: &'static str,
    keep: Keep,
    /// End of each stretch of indices by its first; no two of them overlap or touch.
    stretches: BTreeMap<u64, u64>,
    /// Values by the index of the first of them.
    blocks: BTreeMap<u64, Vec<T>>,
}

impl<T: Copy> Held<T> {
    /// None yet.
    pub(super) fn new(unit: &'static str, keep: Keep) -> Self {
        Self { unit, keep, stretches: BTreeMap::new(), blocks: BTreeMap::new() }
    }

    /// The stretches in order; no two of them overlap or touch.
    pub(super) fn stretches(&self) -> impl Iterator<Item = Range<u64>> {
        self.stretches.iter().map(|(&first, &end)| first..end)
    }

    /// Adds the values of `first..first + values.len()`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has one of them, or there are no such indices; unchanged then.
    pub(super) fn add(&mut self, first: u64, values: &[T]) -> Result<()> {
        self.enter(first, values.len() as u64)?;
        if self.keep == Keep::Measures {
            self.store(first, values);
        }
        Ok(())
    }

    /// Adds `count` indices from `first` on, whose values nobody sees.
    ///
    /// # Errors
    /// [`Error::Invalid`] as [`Held::add`], and where values are kept; unchanged then.
    pub(super) fn add_counted(&mut self, first: u64, count: u64) -> Result<()> {
        if self.keep == Keep::Measures {
            let problem = format!("it keeps the values of its {}; these are counts", self.unit);
            return Err(Error::invalid("tally", problem));
        }
        self.enter(first, count)
    }

    /// Enters `count` indices from `first` on.
    fn enter(&mut self, first: u64, count: u64) -> Result<()> {
        let Some(end) = first.checked_add(count) else {
            let problem = format!("{count} {} from number {first} on have no numbers", self.unit);
            return Err(Error::invalid("tally", problem));
        };
        self.check_free(&(first..end))?;
        self.cover(first..end);
        Ok(())
    }

    /// Adds what `other` has.
    ///
    /// # Errors
    /// [`Error::Invalid`] if both have the same index, or one keeps values and one does not;
    /// unchanged then.
    pub(super) fn merge(&mut self, mut other: Self) -> Result<()> {
        if self.keep != other.keep {
            let problem = format!(
                "one keeps its measures, the other does not ({:?} and {:?}); make both alike",
                self.keep, other.keep
            );
            return Err(Error::invalid("tally", problem));
        }
        other.stretches().try_for_each(|stretch| self.check_free(&stretch))?;
        other.stretches().for_each(|stretch| self.cover(stretch));
        self.blocks.append(&mut other.blocks);
        Ok(())
    }

    /// The first stretch of `range` that is missing.
    pub(super) fn missing(&self, range: &Range<u64>) -> Option<Range<u64>> {
        let before = self.stretches.range(..=range.start).next_back();
        let first = before.map_or(range.start, |(_, &end)| end.max(range.start));
        let next = self.stretches.range(first..).next();
        let end = next.map_or(range.end, |(&next, _)| next.min(range.end));
        (first < range.end).then_some(first..end)
    }

    /// The values in order, if kept; all of `range` and none outside.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first stretch that is missing, or one that lies outside.
    pub(super) fn finish(self, range: &Range<u64>) -> Result<Vec<T>> {
        let Range { start, end } = *range;
        if let Some(gap) = self.missing(range) {
            let problem = format!(
                "{} {}..{} of {start}..{end} are missing; merge their tally first",
                self.unit, gap.start, gap.end
            );
            return Err(Error::invalid("tally", problem));
        }
        if let Some(more) = self.stretches().find(|held| held.start < start || held.end > end) {
            let problem = format!(
                "it has the {} {}..{}, more than the range {start}..{end} asked for",
                self.unit, more.start, more.end
            );
            return Err(Error::invalid("tally", problem));
        }
        let mut blocks = self.blocks.into_values();
        let mut values = blocks.next().unwrap_or_default();
        blocks.for_each(|block| values.extend(block));
        Ok(values)
    }

    /// Refuses indices that it has already.
    fn check_free(&self, range: &Range<u64>) -> Result<()> {
        // Stretches lie apart: of those that begin before the end, the last one ends last.
        let before = self.stretches.range(..range.end).next_back();
        match before.filter(|(_, end)| **end > range.start && !range.is_empty()) {
            None => Ok(()),
            Some((first, end)) => {
                let problem = format!(
                    "the {} {}..{} meet those of {first}..{end}, which it has already",
                    self.unit, range.start, range.end
                );
                Err(Error::invalid("tally", problem))
            }
        }
    }

    /// Enters indices that are free, joined to the stretches that they touch.
    fn cover(&mut self, mut range: Range<u64>) {
        if range.is_empty() {
            return;
        }
        if let Some((&first, &end)) = self.stretches.range(..range.start).next_back()
            && end == range.start
        {
            range.start = first;
        }
        if let Some(end) = self.stretches.remove(&range.end) {
            range.end = end;
        }
        self.stretches.insert(range.start, range.end);
    }

    /// Stores values, behind those of the indices before them where it has these.
    fn store(&mut self, first: u64, values: &[T]) {
        match self.blocks.range_mut(..first).next_back() {
            Some((at, block)) if at + block.len() as u64 == first => block.extend(values),
            _ if values.is_empty() => {}
            _ => _ = self.blocks.insert(first, values.to_vec()),
        }
    }
}
