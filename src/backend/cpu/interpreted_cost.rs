//! The cost of a stage or of an end of a plan, as tapes over the rows of a tile.

use super::chained::{Chained, Pack};
use super::interpreted::Inputs;
use super::lookups::Asked;
use crate::formula::Graph;
use crate::model::Lookups;
use crate::real::Vector;
use crate::real::simd::{Formulas, Instructions};
use crate::tile::Frame;

/// A formula of costs as tapes, with the maps that it asks.
#[derive(Debug)]
pub(super) struct InterpretedCost {
    asked: Option<Asked>,
    formula: Chained,
    /// The row of its value.
    row: usize,
}

/// The rows of a formula of costs: the first of what maps say, its value, the first of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct CostRows {
    pub(super) looked: usize,
    pub(super) value: usize,
    pub(super) own: usize,
}

impl InterpretedCost {
    /// `formula` of `inputs`, those of the model and the contexts; `pack` packs the networks.
    pub(super) fn new(
        formula: &Graph,
        lookups: Option<&Lookups>,
        inputs: &Inputs,
        rows: CostRows,
        pack: Pack<'_>,
    ) -> Self {
        let CostRows { looked, value, own } = rows;
        let asked = lookups.map(|all| Asked::new(all, inputs, looked, own, pack));
        let count = lookups.map_or(0, |all| all.maps.len());
        let inputs = inputs.clone().followed_by(looked..looked + count);
        Self { asked, formula: inputs.chained(formula, &[value], own, pack), row: value }
    }

    /// Its tapes.
    pub(super) fn tapes(&self) -> impl Iterator<Item = &Chained> {
        self.asked.iter().map(Asked::cells).chain([&self.formula])
    }

    /// Evaluates it for the first `lanes` samples.
    pub(super) fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        if let Some(asked) = &self.asked {
            asked.evaluate(with, frame, lanes);
        }
        self.formula.evaluate(with, frame, lanes);
    }

    /// Adds it to the row `total` of the first `lanes` samples.
    pub(super) fn charge(&self, with: Instructions, frame: &mut Frame, total: usize, lanes: usize) {
        self.evaluate(with, frame, lanes);
        with.call(Add { frame, rows: [total, self.row], lanes });
    }
}

/// Adds the second of two rows to the first.
struct Add<'a> {
    frame: &'a mut Frame,
    rows: [usize; 2],
    lanes: usize,
}

impl Formulas for Add<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { frame, rows: [total, more], lanes } = self;
        for at in (0..lanes).step_by(V::WIDTH) {
            let sum = V::load(&frame.row(total)[at..]) + V::load(&frame.row(more)[at..]);
            sum.store(&mut frame.row_mut(total)[at..]);
        }
    }
}
