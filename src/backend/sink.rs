//! Where the results of a batch go, piece by piece.

use crate::error::Result;
use crate::rollout::{MeasureCounts, PairCounts, PairMeasure};

/// Receives the measures of starts `first..first + values.len()`, in order of index; an error
/// stops the batch.
pub type MeasureSink<'a> = &'a mut dyn FnMut(u64, &[f32]) -> Result<()>;

/// Receives the measures of pairs, like [`MeasureSink`].
pub type PairSink<'a> = &'a mut dyn FnMut(u64, &[PairMeasure]) -> Result<()>;

/// Receives what the starts from `first` on came to, in order of index; an error stops the batch.
pub(super) type CountSink<'a> = &'a mut dyn FnMut(u64, &MeasureCounts) -> Result<()>;

/// Receives how the pairs from `first` on fared, like [`CountSink`].
pub(super) type PairCountSink<'a> = &'a mut dyn FnMut(u64, &PairCounts) -> Result<()>;

/// What is asked of starts.
pub(super) enum StartSink<'a> {
    /// Each measure.
    Each(MeasureSink<'a>),
    /// Counts and extremes alone.
    Counts(CountSink<'a>),
}

/// Whether results are asked for one by one.
#[cfg(feature = "gpu")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asked {
    /// Each of them.
    Each,
    /// What they count up to.
    Counts,
}

impl StartSink<'_> {
    /// What it asks for.
    #[cfg(feature = "gpu")]
    pub(super) fn asked(&self) -> Asked {
        match self {
            Self::Each(_) => Asked::Each,
            Self::Counts(_) => Asked::Counts,
        }
    }

    /// Hands on the measures of starts from `first` on, or what they come to.
    ///
    /// # Errors
    /// The sink's.
    pub(super) fn take(&mut self, first: u64, values: &[f32]) -> Result<()> {
        match self {
            Self::Each(sink) => sink(first, values),
            Self::Counts(sink) => sink(first, &MeasureCounts::of_all(first, values)),
        }
    }
}

/// What is asked of pairs, besides the farthest of each step.
pub(super) enum PairsSink<'a> {
    /// Both measures of each.
    Each(PairSink<'a>),
    /// Counts alone.
    Counts(PairCountSink<'a>),
}

impl PairsSink<'_> {
    /// What it asks for.
    #[cfg(feature = "gpu")]
    pub(super) fn asked(&self) -> Asked {
        match self {
            Self::Each(_) => Asked::Each,
            Self::Counts(_) => Asked::Counts,
        }
    }

    /// Hands on the measures of pairs from `first` on, or how they fared.
    ///
    /// # Errors
    /// The sink's.
    pub(super) fn take(&mut self, first: u64, pairs: &[PairMeasure]) -> Result<()> {
        match self {
            Self::Each(sink) => sink(first, pairs),
            Self::Counts(sink) => sink(first, &PairCounts::of_all(pairs)),
        }
    }
}
