//! Starts rolled out one after the other: a measure within the band around zero is that of f64.

use std::ops::Range;

use super::Context;
use super::membership::InF64;
use crate::error::Result;
use crate::rollout::{Query, ReachAvoidTask, RolloutSpec, Starts, Tightening, replay};

/// A start that was rolled out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rolled {
    /// Its index.
    pub(super) index: u64,
    /// Its measure on the backend.
    pub(super) single: f32,
    /// The same, of f64 where that is within the band.
    pub(super) measure: f64,
    /// Whether it is.
    pub(super) in_f64: InF64,
}

impl Rolled {
    /// Whether it does not reach the target safely: a measure that is no number is no success.
    pub(super) fn failed(&self) -> bool {
        self.measure.is_nan() || self.measure <= 0.0
    }

    /// 1 where it was run again in f64, to be counted.
    pub(super) fn reruns(&self) -> u64 {
        u64::from(self.in_f64 == InF64::Yes)
    }
}

/// Starts to be rolled out.
pub(super) struct Walk<'a> {
    /// The starts.
    pub(super) starts: Starts<'a>,
    /// Which of them.
    pub(super) range: Range<u64>,
    /// Horizon and discount.
    pub(super) spec: RolloutSpec,
    /// Measures this close to zero are those of f64.
    pub(super) band: f64,
}

impl Walk<'_> {
    /// Rolls each start out, in order of index, and tells the watch.
    ///
    /// # Errors
    /// Those of the backend and of the watch.
    pub(super) fn each(self, context: Context<'_>, mut of: impl FnMut(Rolled)) -> Result<()> {
        let Self { starts, range, spec, band } = self;
        let (tightening, query) = (Tightening::none(&spec), Query::Measure);
        let task = ReachAvoidTask { starts, range, spec, tightening: &tightening, query };
        let again = |index: u64| {
            let start = task.starts.start(index);
            replay::measure(context.plant(), &start, &spec, &tightening)
        };
        context.program.reach_avoid(&task, &mut |first, measures| {
            for (index, &single) in (first..).zip(measures) {
                let near = f64::from(single.abs()) <= band;
                let measure = if near { again(index) } else { f64::from(single) };
                let in_f64 = if near { InF64::Yes } else { InF64::No };
                of(Rolled { index, single, measure, in_f64 });
            }
            context.watch.advance(measures.len() as u64)
        })
    }
}
