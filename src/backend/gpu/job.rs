//! A call that rolls a plant out: its chunking, its submissions, its workspace.

use std::sync::Arc;

use super::attempt::Attempt;
use super::chunking::{Chunking, Work};
use super::flight::Flight;
use super::lists::List;
use super::opened::Opened;
use super::program::Program;
use super::source::Source;
use super::workspace::{Shape, Workspace};
use crate::backend::sink::Asked;
use crate::error::Result;
use crate::model::Task;
use crate::rollout::{RolloutSpec, Starts, States, Tightening};

/// What a call rolls out: a plant, its task, and the values of its parameters.
#[derive(Clone, Copy)]
pub(super) struct Subject<'a> {
    pub(super) source: &'a Arc<Source>,
    pub(super) task: Task,
    pub(super) values: &'a [f32],
}

/// What a call asks for.
#[derive(Clone, Copy)]
pub(super) struct Request<'a> {
    pub(super) work: Work,
    pub(super) asked: Asked,
    pub(super) starts: &'a Starts<'a>,
    pub(super) spec: &'a RolloutSpec,
    pub(super) tightening: &'a Tightening,
    /// Starts or pairs.
    pub(super) count: u64,
}

/// A call that rolls a plant out.
pub(super) struct Job<'a> {
    pub(super) flight: Flight<'a>,
    pub(super) chunking: Chunking,
    pub(super) space: Workspace,
    opened: &'a Opened,
    program: Arc<Program>,
}

impl<'a> Job<'a> {
    /// The call for `request` of `subject`: its inputs set, nothing written or submitted yet.
    ///
    /// # Errors
    /// Those of the device.
    pub(super) fn new(
        opened: &'a Opened,
        attempt: &Attempt,
        subject: Subject<'_>,
        request: Request<'_>,
    ) -> Result<Self> {
        let Request { work, asked, starts, spec, tightening, count } = request;
        // Before the first buffer is made: what fails from here on is this call's.
        let flight = opened.flight();
        let program = opened.program(&flight, subject.source)?;
        let chunking = program.chunking(&flight.device, attempt, work, count)?;
        let listed = matches!(starts, Starts::Listed(_));
        let shape = Shape { work, asked, listed, horizon: spec.horizon, chunking };
        let mut space = program.take(&flight, shape)?;
        space.inputs.set_values(subject.values);
        space.inputs.set_schedule(spec, subject.task, tightening, subject.source.text.rows());
        space.inputs.set_region(starts);
        Ok(Self { flight, chunking, space, opened, program })
    }

    /// The starts from `first` on, `columns` of them, where the host lists them: on the device.
    pub(super) fn list(&self, starts: &Starts<'_>, first: u64, columns: u32) -> Option<Arc<List>> {
        let Starts::Listed(list) = starts else { return None };
        let (from, count) = (first as usize * list.size(), columns as usize * list.size());
        let part = States::of(&list.numbers()[from..from + count], list.size());
        Some(self.opened.lists.get(&self.flight.device, self.flight.pool, part))
    }

    /// Keeps the workspace: the call has gone well.
    pub(super) fn finish(self) {
        self.program.keep(self.space);
    }
}
