//! Going on after an adapter failed: in smaller chunks, with it opened again, or on the CPU.
//!
//! Results go to a sink in order, so what failed is the rest of a call and nothing else. Chunks do
//! not change results: what goes on on the same adapter gives the bits that it would have given.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;

use super::adapter::Gpu;
use super::attempt::Attempt;
use super::fault::Failure;
use super::job::Subject;
use super::mppi_source::PlanSource;
use super::opened::Opened;
use super::{deviation, mppi, reach_avoid};
use crate::backend::cpu::Cpu;
use crate::backend::sink::{PairsSink, StartSink};
use crate::backend::{Action, Event};
use crate::error::{Error, Fault, Result};
use crate::model::Plant;
use crate::rollout::{DeviationTask, Farthest, MppiTask, PairMeasure, PlanTally, ReachAvoidTask};

/// Who makes an attempt.
enum Runner<'a> {
    Adapter(&'a Opened, &'a Attempt),
    Cpu(&'a Cpu),
}

/// How far a call has come, over all attempts.
struct Delivered {
    next: Cell<u64>,
    refused: Cell<bool>,
}

impl Delivered {
    /// Gives `count` results to a sink; its error ends the call, whatever it is.
    fn deliver(&self, count: usize, sink: impl FnOnce() -> Result<()>) -> Result<()> {
        let taken = sink();
        match taken {
            Ok(()) => self.next.set(self.next.get() + count as u64),
            Err(_) => self.refused.set(true),
        }
        taken
    }
}

/// See [`crate::backend::Program::reach_avoid`].
pub(super) fn reach_avoid(
    gpu: &Gpu,
    subject: Subject<'_>,
    plant: &Plant,
    task: &ReachAvoidTask<'_>,
    mut sink: StartSink<'_>,
) -> Result<()> {
    let asked = sink.asked();
    gpu.persevere("starts", task.range.start, |runner, delivered| {
        let task = ReachAvoidTask { range: delivered.next.get()..task.range.end, ..task.clone() };
        match runner {
            Runner::Adapter(opened, attempt) => {
                let request = reach_avoid::Asking { subject, task: &task, asked };
                reach_avoid::reach_avoid(opened, attempt, request, &mut |first, came_to| {
                    delivered.deliver(came_to.count(), || came_to.hand_to(first, &mut sink))
                })
            }
            // A CPU prepares the plant when it takes over, once per call that it takes over.
            Runner::Cpu(cpu) => {
                cpu.prepare(plant)?.reach_avoid(cpu, &task, &mut |first, values| {
                    delivered.deliver(values.len(), || sink.take(first, values))
                })
            }
        }
    })
}

/// See [`crate::backend::Program::deviation`].
pub(super) fn deviation(
    gpu: &Gpu,
    subject: Subject<'_>,
    plant: &Plant,
    task: &DeviationTask<'_>,
    mut sink: PairsSink<'_>,
) -> Result<Vec<Farthest>> {
    let asked = sink.asked();
    let mut farthest = vec![Farthest::NONE; task.spec.horizon as usize + 1];
    gpu.persevere("pairs", task.range.start, |runner, delivered| {
        let task = DeviationTask { range: delivered.next.get()..task.range.end, ..task.clone() };
        match runner {
            Runner::Adapter(opened, attempt) => {
                let request = deviation::Asking { subject, task: &task, asked };
                let take = &mut |first, came_to: deviation::CameTo| {
                    delivered.deliver(came_to.count(), || came_to.hand_to(first, &mut sink))
                };
                deviation::deviation(opened, attempt, request, &mut farthest, take)
            }
            Runner::Cpu(cpu) => {
                let take = &mut |first, values: &[PairMeasure]| {
                    delivered.deliver(values.len(), || sink.take(first, values))
                };
                let rest = cpu.prepare(plant)?.deviation(cpu, &task, take)?;
                Farthest::merge_steps(&mut farthest, &rest);
                Ok(())
            }
        }
    })?;
    Ok(farthest)
}

/// See [`crate::backend::PlanProgram::tally`].
pub(super) fn tally(
    gpu: &Gpu,
    source: &Arc<PlanSource>,
    task: &MppiTask<'_>,
    samples: Range<u32>,
    sink: &mut dyn FnMut(Vec<PlanTally>),
) -> Result<()> {
    gpu.persevere("problems", 0, |runner, delivered| {
        let task = MppiTask { problems: &task.problems[delivered.next.get() as usize..], ..*task };
        let sink = &mut |more: Vec<PlanTally>| {
            delivered.next.set(delivered.next.get() + more.len() as u64);
            sink(more);
        };
        match runner {
            Runner::Adapter(opened, attempt) => {
                mppi::tally(opened, attempt, source, &task, samples.clone(), sink)
            }
            Runner::Cpu(cpu) => {
                let prepared = cpu.prepare_plans(&source.planning);
                prepared.tally(cpu, &task, samples.clone(), sink);
                Ok(())
            }
        }
    })
}

impl Gpu {
    /// Attempts at a call until one ends it or nothing is left to try. `work` is what results are
    /// of, the first of which has the index `first`.
    fn persevere(
        &self,
        work: &str,
        first: u64,
        mut run: impl FnMut(Runner<'_>, &Delivered) -> Result<()>,
    ) -> Result<()> {
        let delivered = Delivered { next: Cell::new(first), refused: Cell::new(false) };
        loop {
            let (opened, limit, on_cpu) = {
                let state = self.state();
                (state.opened(), state.limit, state.on_cpu)
            };
            if let Some(cpu) = self.fallback.as_ref().filter(|_| on_cpu) {
                return run(Runner::Cpu(cpu), &delivered);
            }
            let (attempt, before) = (Attempt::new(limit), delivered.next.get());
            let outcome = run(Runner::Adapter(&opened, &attempt), &delivered);
            if outcome.is_ok() || delivered.next.get() > before {
                self.state().served = true;
            }
            match outcome {
                Err(error) if !delivered.refused.get() => {
                    let Failure { fault, problem } = self.survivable(error)?;
                    let columns = attempt.columns.get();
                    let Some(action) = self.go_on(fault, &opened, columns) else {
                        return Err(Error::DeviceFailed { fault, problem });
                    };
                    let (work, index) = (work.to_owned(), delivered.next.get());
                    self.note(Event { fault, problem, work, index, action });
                }
                ended => return ended,
            }
        }
    }

    /// What failed on the adapter.
    ///
    /// # Errors
    /// `error` itself where it is none of the adapter's, or says that work does not fit it and
    /// nobody else may do it.
    fn survivable(&self, error: Error) -> Result<Failure> {
        match error {
            Error::DeviceFailed { fault, problem } => Ok(Failure { fault, problem }),
            Error::Device(problem) if self.fallback.is_some() => {
                Ok(Failure { fault: Fault::Unfit, problem })
            }
            other => Err(other),
        }
    }

    /// Gets ready for the next attempt after `failed` failed with chunks of `columns`; `None` if
    /// nothing is left to try.
    fn go_on(&self, fault: Fault, failed: &Arc<Opened>, columns: u64) -> Option<Action> {
        let mut state = self.state();
        if !Arc::ptr_eq(&state.opened, failed) {
            // Another call has opened it again.
            return Some(Action::Reopened);
        }
        let smaller = state.limit.half(columns);
        if let (Fault::OutOfMemory | Fault::Timeout, Some(limit)) = (fault, smaller) {
            state.limit = limit;
            // Buffers that were made without memory are of no use, the others are in the way.
            failed.clear();
            return Some(Action::SmallerChunks(limit.columns));
        }
        if fault == Fault::Lost && !state.reopened {
            state.reopened = true;
            if let Ok(opened) = failed.again() {
                state.opened = Arc::new(opened);
                // Too much memory or too long a dispatch may also end in a loss.
                state.limit = smaller.unwrap_or(state.limit);
                return Some(Action::Reopened);
            }
        }
        state.on_cpu = self.fallback.is_some();
        state.on_cpu.then_some(Action::Cpu)
    }
}
