//! A tile of trajectories as rows of numbers: states, controls, margins, and whatever a plant's
//! formulas need besides.

use std::cell::Cell;
use std::ops::Range;

use super::{Block, GRANULE};

/// Bytes of a cache line: rows begin at one, so that no vector crosses two.
const LINE: usize = 64;

/// Which rows a frame has: the states, the controls, the step, the target margin, the constraint
/// margin, the periods since the start, then rows that formulas have to themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// Number of states.
    pub(crate) states: usize,
    /// Number of controls.
    pub(crate) controls: usize,
    /// Number of rows of formulas' own.
    pub(crate) own: usize,
}

impl Layout {
    /// Number of the row of the steps taken.
    #[inline(always)]
    pub(crate) fn step(&self) -> usize {
        self.states + self.controls
    }

    /// Numbers of the rows of the target and the constraint margin.
    #[inline(always)]
    pub(crate) fn margins(&self) -> [usize; 2] {
        [self.step() + 1, self.step() + 2]
    }

    /// Number of the row of the periods since the start, which are no whole number between samples.
    #[inline(always)]
    pub(crate) fn elapsed(&self) -> usize {
        self.step() + 3
    }

    /// Number of the first row of formulas' own.
    pub(crate) fn first_own(&self) -> usize {
        self.elapsed() + 1
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.first_own() + self.own
    }
}

/// Whether formulas read the rows of steps and of periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clock {
    /// Some formula does.
    Read,
    /// None does: the rows are not kept.
    Ignored,
}

/// Numbers that begin at a cache line.
#[derive(Debug)]
pub(crate) struct Aligned {
    numbers: Vec<f32>,
    /// Where they begin.
    begin: usize,
}

impl Aligned {
    /// `count` zeros.
    pub(crate) fn zeros(count: usize) -> Self {
        let numbers = vec![0.0; count + LINE / size_of::<f32>()];
        // A place beyond the allowance cannot be: then they begin where they do.
        let begin = numbers.as_ptr().align_offset(LINE).min(LINE / size_of::<f32>());
        Self { numbers, begin }
    }

    /// All of them, and perhaps a few zeros behind.
    #[inline(always)]
    pub(crate) fn all(&self) -> &[f32] {
        &self.numbers[self.begin..]
    }

    /// The same to write to.
    #[inline(always)]
    pub(crate) fn all_mut(&mut self) -> &mut [f32] {
        &mut self.numbers[self.begin..]
    }
}

/// Rows of `width` numbers, one for each trajectory, as a [`Layout`] says.
#[derive(Debug)]
pub(crate) struct Frame {
    numbers: Aligned,
    width: usize,
    layout: Layout,
    /// Room that networks inside formulas take turns with.
    room: [Vec<f32>; 2],
}

impl Frame {
    /// Zeros for tiles of up to `lanes` trajectories.
    pub(crate) fn new(layout: Layout, lanes: usize) -> Self {
        let width = lanes.next_multiple_of(GRANULE);
        let numbers = Aligned::zeros(layout.rows() * width);
        Self { numbers, width, layout, room: Default::default() }
    }

    /// Numbers of a row.
    #[inline(always)]
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    /// Numbers of the rows of the states.
    #[inline(always)]
    pub(crate) fn states(&self) -> Range<usize> {
        0..self.layout.states
    }

    /// Numbers of the rows of the controls.
    #[inline(always)]
    pub(crate) fn controls(&self) -> Range<usize> {
        self.layout.states..self.layout.step()
    }

    /// Number of the row of the steps taken.
    #[inline(always)]
    pub(crate) fn step(&self) -> usize {
        self.layout.step()
    }

    /// Numbers of the rows of the target and the constraint margin.
    #[inline(always)]
    pub(crate) fn margins(&self) -> [usize; 2] {
        self.layout.margins()
    }

    /// Number of the row of the periods since the start.
    #[inline(always)]
    pub(crate) fn elapsed(&self) -> usize {
        self.layout.elapsed()
    }

    /// All rows, one after the other, `[rows, width]`.
    #[inline(always)]
    pub(crate) fn rows(&self) -> &[f32] {
        self.numbers.all()
    }

    /// The same to write to.
    #[inline(always)]
    pub(crate) fn rows_mut(&mut self) -> &mut [f32] {
        self.numbers.all_mut()
    }

    /// The rows in blocks, `[rows, width / GRANULE]`: cells, as formulas write rows that they read.
    #[inline(always)]
    pub(crate) fn blocks(&mut self) -> &[Cell<Block>] {
        let (blocks, _) = self.rows_mut().as_chunks_mut::<GRANULE>();
        Cell::from_mut(blocks).as_slice_of_cells()
    }

    /// The row number `row`.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &[f32] {
        &self.rows()[row * self.width..][..self.width]
    }

    /// The same to write to.
    #[inline(always)]
    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let width = self.width;
        &mut self.rows_mut()[row * width..][..width]
    }

    /// Takes the room for activations of networks out, to be put back with [`Frame::put_room`].
    pub(crate) fn take_room(&mut self) -> [Vec<f32>; 2] {
        std::mem::take(&mut self.room)
    }

    /// Puts the room for activations back, so that it is there the next time.
    pub(crate) fn put_room(&mut self, room: [Vec<f32>; 2]) {
        self.room = room;
    }

    /// Copies the states of trajectory `from` of `source` to trajectory `to`.
    pub(crate) fn copy_lane(&mut self, to: usize, source: &Self, from: usize) {
        for row in self.states() {
            self.row_mut(row)[to] = source.row(row)[from];
        }
    }

    /// Copies the states of trajectory `from` to trajectory `to`, and its controls: it may be inside a period.
    pub(crate) fn move_lane(&mut self, to: usize, from: usize) {
        for row in 0..self.layout.step() {
            let row = self.row_mut(row);
            row[to] = row[from];
        }
    }

    /// Takes the controls of `source` over.
    pub(crate) fn copy_controls(&mut self, source: &Self) {
        let range = self.controls();
        let (rows, width) = (range.start * self.width..range.end * self.width, self.width);
        debug_assert_eq!(width, source.width, "tiles of one width");
        self.rows_mut()[rows.clone()].copy_from_slice(&source.rows()[rows]);
    }
}
