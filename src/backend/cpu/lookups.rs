//! Maps that formulas of costs ask, over the rows of a tile.

use std::ops::Range;
use std::sync::Arc;

use super::chained::{Chained, Pack};
use super::interpreted::Inputs;
use crate::cost::CostMap;
use crate::model::Lookups;
use crate::real::Vector;
use crate::real::simd::{Formulas, Instructions};
use crate::tile::Frame;

/// Maps, the tape of the numbers of their cells, and the rows that what they say goes to.
#[derive(Debug)]
pub(super) struct Asked {
    maps: Vec<Arc<CostMap>>,
    cells: Chained,
    rows: Range<usize>,
}

impl Asked {
    /// What `lookups` ask at `inputs`; answers are in the rows from `first` on, what lies between is in
    /// rows from `own` on, and `pack` packs the networks of the places.
    pub(super) fn new(
        lookups: &Lookups,
        inputs: &Inputs,
        first: usize,
        own: usize,
        pack: Pack<'_>,
    ) -> Self {
        let rows = first..first + lookups.maps.len();
        let to: Vec<usize> = rows.clone().collect();
        let cells = inputs.chained(&lookups.cells, &to, own, pack);
        Self { maps: lookups.maps.clone(), cells, rows }
    }

    /// The tape of the places.
    pub(super) fn cells(&self) -> &Chained {
        &self.cells
    }

    /// Asks the maps for the first `lanes` samples.
    pub(super) fn evaluate(&self, with: Instructions, frame: &mut Frame, lanes: usize) {
        self.cells.evaluate(with, frame, lanes);
        with.call(Look { asked: self, frame, lanes });
    }
}

/// Numbers of cells become what the cells say, in place.
struct Look<'a> {
    asked: &'a Asked,
    frame: &'a mut Frame,
    lanes: usize,
}

impl Formulas for Look<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        for (map, row) in self.asked.maps.iter().zip(self.asked.rows.clone()) {
            for at in (0..self.lanes).step_by(V::WIDTH) {
                let cell = V::load(&self.frame.row(row)[at..]);
                cell.each(|cell| map.at_cell(cell)).store(&mut self.frame.row_mut(row)[at..]);
            }
        }
    }
}
