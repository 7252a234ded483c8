//! Tapes: formulas as lists of operations over rows of a tile, for plants known at run time only.
//!
//! Each operation goes over a whole row before the next one comes: what it is, is asked once for
//! all trajectories, and the loop over them is compiled for the instruction set. Every number has
//! the bits that [`Graph::eval`] gives in f32; which of several NaN it is, is left open.

mod operation;
mod pairs;
mod place;
mod rows;
mod run;
mod schedule;
#[cfg(test)]
mod tests;
mod values;

pub(crate) use self::place::Source;
use self::place::{Place, Step};
use self::run::Run;
use self::values::Values;
use super::Frame;
use crate::formula::Graph;
use crate::real::simd::Instructions;

/// A formula as operations over the rows of a [`Frame`].
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    steps: Vec<Step>,
    own: usize,
}

impl Tape {
    /// The tape of `graphs`, one after the other: input `i` of each is at `sources[i]`, output `k` of
    /// all goes to row `outputs[k]`, which may be one that inputs are in. What lies between needs
    /// [`Tape::own_rows`] rows from `first_own` on; neither a source nor an output may be among them.
    ///
    /// # Panics
    /// If the sources or outputs are not as many as the graphs', or a row is written twice.
    pub(crate) fn new(
        graphs: &[&Graph],
        sources: &[Source],
        outputs: &[usize],
        first_own: usize,
    ) -> Self {
        let mut values = Values::new(graphs, sources);
        assert_eq!(outputs.len(), values.outputs.len(), "outputs of a tape");
        for (i, row) in outputs.iter().enumerate() {
            assert!(!outputs[..i].contains(row), "two outputs of a tape to row {row}");
        }
        pairs::pair_up(&mut values);
        let placed = rows::placed(&schedule::scheduled(values, outputs), first_own);
        Self { steps: placed.steps, own: placed.own }
    }

    /// How many rows of its own it needs.
    pub(crate) fn own_rows(&self) -> usize {
        self.own
    }

    /// Whether it reads a row, as far as it was given.
    pub(crate) fn reads(&self, row: usize) -> bool {
        let operands = self.steps.iter().flat_map(|step| step.operation.operands());
        operands.into_iter().any(|operand| *operand == Place::Row(row))
    }

    /// Evaluates it for the first `lanes` trajectories.
    pub(crate) fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        with.call(Run { steps: &self.steps, frame, lanes });
    }
}
