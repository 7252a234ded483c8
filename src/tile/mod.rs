//! Tiles of trajectories as rows of numbers, and plants that move them: called once per tile.

mod compiled;
mod frame;
mod native;
mod stages;
mod tape;

pub(crate) use compiled::{CompiledPolicy, CompiledSystem};
pub(crate) use frame::{Aligned, Clock, Frame, Layout};
pub(crate) use native::{NativeFormula, NativeSystem};
pub(crate) use stages::{CompiledStages, NativeStages, Stages, cell_cost, clipped, noise_cost};
pub(crate) use tape::{Source, Tape};

/// Smallest number of trajectories of a tile; widths are multiples of it.
pub(crate) const GRANULE: usize = 16;

/// Numbers of a row that loops take at a time: whole vectors of every instruction set, and a bound
/// that is checked once.
pub(crate) type Block = [f32; GRANULE];
