//! How a batch is cut: into chunks for the sink, units for the threads, tiles in lockstep.

use std::ops::Range;

use super::kernel::GRANULE;

/// Most results held at a time.
const CHUNK: u64 = 65_536;
/// Units per thread of a full chunk: the last ones to end leave the other threads idle.
const UNITS: usize = 16;

/// A part of a batch whose results go to the sink at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chunk {
    /// Index of its first trajectory.
    pub(super) first: u64,
    /// How many there are.
    pub(super) count: usize,
}

/// The chunks of a range, in order.
pub(super) fn chunks(range: &Range<u64>) -> impl Iterator<Item = Chunk> {
    let Range { start, end } = *range;
    let count = end.saturating_sub(start).div_ceil(CHUNK);
    (0..count).map(move |i| {
        let first = start + i * CHUNK;
        let count = CHUNK.min(end - first) as usize;
        Chunk { first, count }
    })
}

/// How a chunk is spread; the results do not depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Schedule {
    /// Trajectories per unit, a multiple of the width.
    pub(super) unit: usize,
    /// Trajectories per tile, a multiple of [`GRANULE`].
    pub(super) width: usize,
}

impl Schedule {
    /// For `count` trajectories on `threads` threads, under a network as wide as `widest`.
    ///
    /// As few tiles as fit the caches, but one for each thread, and equally full.
    pub(super) fn new(count: usize, threads: usize, widest: Option<usize>) -> Self {
        let most = most_lanes(widest);
        let tiles = count.div_ceil(most).next_multiple_of(threads).max(1);
        let width = count.div_ceil(tiles).next_multiple_of(GRANULE).max(GRANULE);
        let tiles = count.div_ceil(width);
        Self { unit: width * tiles.div_ceil(UNITS * threads).max(1), width }
    }
}

/// Most trajectories of a tile: multiples of the blocks of every kernel, found by measurement.
fn most_lanes(widest: Option<usize>) -> usize {
    match widest {
        None => 256,
        Some(0..=256) => 96,
        Some(_) => 192,
    }
}
