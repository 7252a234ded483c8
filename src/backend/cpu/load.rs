//! Starts and pairs of a group of lanes.

use super::dispatch::Body;
use crate::real::Lanes;
use crate::rollout::{Pairs, Starts};

/// The starts from `first` on.
pub(super) struct LoadStarts<'a, const N: usize, const NX: usize> {
    pub(super) starts: &'a Starts<'a, NX>,
    pub(super) first: u64,
    pub(super) x: &'a mut [Lanes<N>; NX],
}

impl<const N: usize, const NX: usize> Body for LoadStarts<'_, N, NX> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        *self.x = self.starts.load(self.first);
    }
}

/// The pairs from `first` on.
pub(super) struct LoadPairs<'a, const N: usize, const NX: usize> {
    pub(super) pairs: &'a Pairs<'a, NX>,
    pub(super) first: u64,
    pub(super) nominal: &'a mut [Lanes<N>; NX],
    pub(super) perturbed: &'a mut [Lanes<N>; NX],
}

impl<const N: usize, const NX: usize> Body for LoadPairs<'_, N, NX> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        [*self.nominal, *self.perturbed] = self.pairs.load(self.first);
    }
}
