//! Where the results of a batch go, piece by piece.

use crate::error::Result;
use crate::rollout::PairMeasure;

/// Receives the measures of starts `first..first + values.len()`, in order of index; an error
/// stops the batch.
pub type MeasureSink<'a> = &'a mut dyn FnMut(u64, &[f32]) -> Result<()>;

/// Receives the measures of pairs, like [`MeasureSink`].
pub type PairSink<'a> = &'a mut dyn FnMut(u64, &[PairMeasure]) -> Result<()>;
