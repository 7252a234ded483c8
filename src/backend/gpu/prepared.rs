//! A plant as an adapter runs it.

use super::Gpu;
use crate::backend::{MeasureSink, PairSink};
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{DeviationTask, Farthest, ReachAvoidTask};

/// A plant prepared on an adapter.
pub(in crate::backend) struct Prepared<'a>(&'a Gpu);

impl Gpu {
    /// See [`crate::backend::Backend::prepare`].
    pub(in crate::backend) fn prepare(&self, _plant: &Plant) -> Result<Prepared<'_>> {
        Ok(Prepared(self))
    }
}

impl Prepared<'_> {
    pub(in crate::backend) fn reach_avoid(
        &self,
        _task: &ReachAvoidTask<'_>,
        _sink: MeasureSink<'_>,
    ) -> Result<()> {
        Err(Error::Device(format!("to come: {:?}", self.0)))
    }

    pub(in crate::backend) fn deviation(
        &self,
        _task: &DeviationTask<'_>,
        _sink: PairSink<'_>,
    ) -> Result<Vec<Farthest>> {
        Err(Error::Device(format!("to come: {:?}", self.0)))
    }
}
