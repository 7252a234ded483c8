//! A tile of trajectories as rows of numbers: states, controls, margins, and whatever a plant's
//! formulas need besides.

use std::ops::Range;

use super::kernel::GRANULE;

/// Bytes of a cache line: rows begin at one, so that no vector crosses two.
const LINE: usize = 64;

/// Rows of `width` numbers, one for each trajectory: the states, the controls, the step, the target
/// margin, the constraint margin, then rows of the plant's own.
#[derive(Debug)]
pub(super) struct Frame {
    numbers: Vec<f32>,
    /// Where the first row begins in `numbers`.
    begin: usize,
    width: usize,
    states: usize,
    controls: usize,
}

impl Frame {
    /// Zeros for tiles of up to `lanes` trajectories of that many states and controls.
    pub(super) fn new([states, controls]: [usize; 2], own: usize, lanes: usize) -> Self {
        let width = lanes.next_multiple_of(GRANULE);
        let rows = states + controls + 3 + own;
        let numbers = vec![0.0; rows * width + LINE / size_of::<f32>()];
        // A place beyond the allowance cannot be: then rows begin where they do.
        let begin = numbers.as_ptr().align_offset(LINE).min(LINE / size_of::<f32>());
        Self { numbers, begin, width, states, controls }
    }

    /// Numbers of a row.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Numbers of the rows of the states.
    pub(super) fn states(&self) -> Range<usize> {
        0..self.states
    }

    /// Numbers of the rows of the controls.
    pub(super) fn controls(&self) -> Range<usize> {
        self.states..self.states + self.controls
    }

    /// Number of the row of the steps taken.
    pub(super) fn step(&self) -> usize {
        self.states + self.controls
    }

    /// Numbers of the rows of the target and the constraint margin.
    pub(super) fn margins(&self) -> [usize; 2] {
        [self.step() + 1, self.step() + 2]
    }

    /// All rows, one after the other, `[rows, width]`.
    #[inline(always)]
    pub(super) fn rows(&self) -> &[f32] {
        &self.numbers[self.begin..]
    }

    /// The same to write to.
    #[inline(always)]
    pub(super) fn rows_mut(&mut self) -> &mut [f32] {
        &mut self.numbers[self.begin..]
    }

    /// The row number `row`.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.rows()[row * self.width..][..self.width]
    }

    /// The same to write to.
    #[inline(always)]
    pub(super) fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let width = self.width;
        &mut self.rows_mut()[row * width..][..width]
    }

    /// Copies the states of trajectory `from` of `source` to trajectory `to`.
    pub(super) fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        for row in self.states() {
            self.row_mut(row)[to] = source.row(row)[from];
        }
    }

    /// Copies the states of trajectory `from` to trajectory `to`.
    pub(super) fn move_lane(&mut self, to: usize, from: usize) {
        for row in self.states() {
            let row = self.row_mut(row);
            row[to] = row[from];
        }
    }

    /// Takes the controls of `source` over.
    pub(super) fn copy_controls(&mut self, source: &Self) {
        let range = self.controls();
        let (rows, width) = (range.start * self.width..range.end * self.width, self.width);
        debug_assert_eq!(width, source.width, "tiles of one width");
        self.rows_mut()[rows.clone()].copy_from_slice(&source.rows()[rows]);
    }
}
