//! Starts and pairs of a tile, drawn group by group.

use super::kernel::Kernel;
use crate::real::Lanes;
use crate::real::simd::Body;
use crate::rollout::{Pairs, Starts};
use crate::tile::Frame;

/// What a kernel draws into.
#[derive(Debug)]
pub(super) struct Loader<K, const N: usize> {
    kernel: K,
    rows: [Vec<Lanes<N>>; 2],
}

impl<K: Kernel, const N: usize> Loader<K, N> {
    /// For starts of `states` numbers.
    pub(super) fn new(kernel: K, states: usize) -> Self {
        let rows = || vec![Lanes([0.0; N]); states];
        Self { kernel, rows: [rows(), rows()] }
    }

    /// Puts the starts `first..first + count` into a tile; lanes beyond them get the next ones.
    pub(super) fn starts(
        &mut self,
        starts: &Starts<'_>,
        first: u64,
        count: usize,
        frame: &mut Frame,
    ) {
        let [x, _] = &mut self.rows;
        for at in (0..count).step_by(N) {
            self.kernel.call(LoadStarts { starts, first: first + at as u64, x });
            put(x, frame, at);
        }
    }

    /// Puts the pairs `first..first + count` into two tiles, nominal and perturbed.
    pub(super) fn pairs(
        &mut self,
        pairs: &Pairs<'_>,
        first: u64,
        count: usize,
        [nominal, perturbed]: [&mut Frame; 2],
    ) {
        let [x, y] = &mut self.rows;
        for at in (0..count).step_by(N) {
            let first = first + at as u64;
            self.kernel.call(LoadPairs { pairs, first, nominal: x, perturbed: y });
            put(x, nominal, at);
            put(y, perturbed, at);
        }
    }
}

/// Writes a group to the rows of the states, from trajectory `at` on.
fn put<const N: usize>(group: &[Lanes<N>], frame: &mut Frame, at: usize) {
    for (row, lanes) in group.iter().enumerate() {
        // A tile is a multiple of a granule, which a group of more lanes may go beyond.
        let row = &mut frame.row_mut(row)[at..];
        let count = row.len().min(N);
        row[..count].copy_from_slice(&lanes.0[..count]);
    }
}

/// The starts from `first` on.
struct LoadStarts<'a, const N: usize> {
    starts: &'a Starts<'a>,
    first: u64,
    x: &'a mut [Lanes<N>],
}

impl<const N: usize> Body for LoadStarts<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.starts.load(self.first, self.x);
    }
}

/// The pairs from `first` on.
struct LoadPairs<'a, const N: usize> {
    pairs: &'a Pairs<'a>,
    first: u64,
    nominal: &'a mut [Lanes<N>],
    perturbed: &'a mut [Lanes<N>],
}

impl<const N: usize> Body for LoadPairs<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.pairs.load(self.first, self.nominal, self.perturbed);
    }
}
