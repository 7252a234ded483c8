//! In place of the GPU backend where the feature `gpu` is left out: an adapter that cannot be there.

use std::ops::Range;

use super::Event;
use super::sink::{PairsSink, StartSink};
use crate::error::{Error, Result};
use crate::model::Plant;
use crate::rollout::{DeviationTask, Farthest, MppiTask, PlanTally, Planning, ReachAvoidTask};

/// An adapter: none, since this build knows none. No value of it exists, so that nothing below is
/// ever called, and code over both backends need not ask which build it is in.
#[derive(Clone, Copy, Debug)]
pub enum Gpu {}

/// The hardware adapter that `auto` looks for: none.
pub(super) fn hardware() -> Result<Option<Gpu>> {
    Ok(None)
}

/// The refusal of an adapter.
pub(super) fn any() -> Result<Gpu> {
    let problem = "this build knows no adapters; build with the feature `gpu`, or open the CPU";
    Err(Error::Device(problem.to_owned()))
}

impl Gpu {
    pub(super) fn name(&self) -> &'static str {
        match *self {}
    }

    pub(super) fn device(&self) -> String {
        match *self {}
    }

    pub(super) fn events(&self) -> Vec<Event> {
        match *self {}
    }

    pub(super) fn prepare(&self, _plant: &Plant) -> Result<Prepared<'_>> {
        match *self {}
    }

    pub(super) fn prepare_plans(&self, _planning: &Planning) -> Result<PreparedPlanning<'_>> {
        match *self {}
    }
}

/// Plans prepared on it: none either.
pub(super) struct PreparedPlanning<'a>(&'a Gpu);

impl PreparedPlanning<'_> {
    pub(super) fn tally(
        &self,
        _task: &MppiTask<'_>,
        _samples: Range<u32>,
        _sink: &mut dyn FnMut(Vec<PlanTally>),
    ) -> Result<()> {
        match *self.0 {}
    }
}

/// A plant prepared on it: none either.
pub(super) struct Prepared<'a>(&'a Gpu);

impl Prepared<'_> {
    pub(super) fn networks(&self) -> Option<String> {
        match *self.0 {}
    }

    pub(super) fn reach_avoid(
        &self,
        _task: &ReachAvoidTask<'_>,
        _sink: StartSink<'_>,
    ) -> Result<()> {
        match *self.0 {}
    }

    pub(super) fn deviation(
        &self,
        _task: &DeviationTask<'_>,
        _sink: PairsSink<'_>,
    ) -> Result<Vec<Farthest>> {
        match *self.0 {}
    }
}
