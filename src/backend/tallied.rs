//! Starts and pairs of a program as tallies: ranges that are cut anywhere and merged again.

use super::Program;
use super::sink::{PairsSink, StartSink};
use crate::error::Result;
use crate::rollout::{DeviationTask, Keep, MeasureTally, PairTally, ReachAvoidTask};

/// Is told how many rollouts or pairs more are done.
type Told<'a> = &'a mut dyn FnMut(u64) -> Result<()>;

impl Program<'_> {
    /// What the starts of `task` come to: counts and extremes of their measures or signs, and each of them
    /// if kept. Shards of a range, on one device or several, are tallied for themselves and merged.
    ///
    /// ```
    /// use reachcast::backend::Backend;
    /// use reachcast::model::Plant;
    /// use reachcast::rollout::{
    ///     Keep, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, Stream, Tightening,
    /// };
    /// use reachcast::system::{BangBang, DoubleIntegrator};
    ///
    /// let backend = Backend::cpu()?;
    /// let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    /// let program = backend.prepare(&plant)?;
    ///
    /// let spec = RolloutSpec::new(40, 1.0)?;
    /// let whole = ReachAvoidTask {
    ///     starts: Starts::Drawn {
    ///         region: Region::new_box([-1.0, -1.0], [1.0, 1.0])?,
    ///         stream: Stream::new(1, Purpose::USER, 0),
    ///     },
    ///     range: 0..10_000,
    ///     spec,
    ///     tightening: &Tightening::none(&spec),
    ///     query: Query::Measure,
    /// };
    /// let half = |range| program.tally(&ReachAvoidTask { range, ..whole.clone() }, Keep::Counts);
    ///
    /// // In any order, wherever the range is cut.
    /// let mut tally = half(3_333..10_000)?;
    /// tally.merge(half(0..3_333)?)?;
    /// assert_eq!(tally.missing(0..10_000), None);
    /// assert_eq!(tally.counts(), program.tally(&whole, Keep::Counts)?.counts());
    /// assert!(tally.merge(half(9_999..10_000)?).is_err(), "it has that start");
    /// # Ok::<(), reachcast::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Program::reach_avoid`].
    pub fn tally(&self, task: &ReachAvoidTask<'_>, keep: Keep) -> Result<MeasureTally> {
        self.tally_told(task, keep, &mut |_| Ok(()))
    }

    /// [`Program::tally`], which tells `told` how many starts each piece had that is done; its error stops
    /// the batch.
    pub(crate) fn tally_told(
        &self,
        task: &ReachAvoidTask<'_>,
        keep: Keep,
        told: Told<'_>,
    ) -> Result<MeasureTally> {
        let mut tally = MeasureTally::new(keep);
        match keep {
            Keep::Counts => self.roll_out(
                task,
                StartSink::Counts(&mut |first, counts| {
                    tally.add_counts(first, counts)?;
                    told(counts.starts)
                }),
            ),
            Keep::Measures => self.reach_avoid(task, &mut |first, values| {
                tally.add(first, values)?;
                told(values.len() as u64)
            }),
        }?;
        Ok(tally)
    }

    /// What the pairs of `task` come to: the farthest pair of each step, counts, and the measures of each
    /// pair if kept; cut and merged as [`Program::tally`].
    ///
    /// # Errors
    /// Those of [`Program::reach_avoid`].
    pub fn tally_pairs(&self, task: &DeviationTask<'_>, keep: Keep) -> Result<PairTally> {
        self.tally_pairs_told(task, keep, &mut |_| Ok(()))
    }

    /// [`Program::tally_pairs`], told like [`Program::tally_told`].
    pub(crate) fn tally_pairs_told(
        &self,
        task: &DeviationTask<'_>,
        keep: Keep,
        told: Told<'_>,
    ) -> Result<PairTally> {
        let mut tally = PairTally::new(task.spec.horizon, keep);
        let farthest = match keep {
            Keep::Counts => self.roll_out_pairs(
                task,
                PairsSink::Counts(&mut |first, counts| {
                    tally.add_counts(first, counts)?;
                    told(counts.pairs)
                }),
            ),
            Keep::Measures => self.deviation(task, &mut |first, pairs| {
                tally.add(first, pairs)?;
                told(pairs.len() as u64)
            }),
        }?;
        tally.reach(&farthest);
        Ok(tally)
    }
}
