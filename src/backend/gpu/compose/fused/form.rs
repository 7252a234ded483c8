//! How the threads of a workgroup share the layers of its trajectories.

use super::shape::{BLOCK, FusedLayer};
use crate::backend::gpu::compose::kernels::WORKGROUP;

/// Most numbers of weights that a thread keeps: 255 are all that a thread of a GPU has, and sums,
/// activations and addresses need the rest.
const MOST_KEPT: u32 = 160;

/// How the threads of a workgroup share the layers of its trajectories. Which one is fast depends on the
/// size of the batch; all of them give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// A thread has a tile of neurons and trajectories and reads weights from storage: networks of any
    /// widths.
    Tiles {
        /// Trajectories of a workgroup: a multiple of `columns` that divides 64.
        trajectories: u32,
        /// Neurons of a tile, 4 or 8.
        neurons: u32,
        /// Trajectories of a tile, 4 or 8.
        columns: u32,
    },
    /// The same by tiles of 8 by 8, whose weights come by slices of 8 inputs through workgroup memory, the
    /// next slice loaded ahead: hidden layers of one width, from 64 neurons on.
    Slices {
        /// Trajectories of a workgroup: a multiple of 8 that divides 64.
        trajectories: u32,
    },
    /// A thread keeps the weights of its neuron in each layer for all steps: small networks, and batches
    /// that leave most of the device idle.
    Rows {
        /// Trajectories of a workgroup, all by each thread: a number that divides 64.
        trajectories: u32,
    },
}

impl Form {
    /// Trajectories of a workgroup.
    pub fn trajectories(self) -> u32 {
        match self {
            Self::Tiles { trajectories, .. }
            | Self::Slices { trajectories }
            | Self::Rows { trajectories } => trajectories,
        }
    }

    /// Neurons of a tile.
    pub(super) fn tile_neurons(self) -> u32 {
        if let Self::Tiles { neurons, .. } = self { neurons } else { 8 }
    }

    /// Trajectories of a tile.
    pub(super) fn tile_columns(self) -> u32 {
        if let Self::Tiles { columns, .. } = self { columns } else { 8 }
    }

    /// Whether networks of these layers have the form.
    pub(super) fn fits(self, layers: &[FusedLayer]) -> bool {
        let Some((_, hidden)) = layers.split_last() else { return false };
        // Columns are padded to whole workgroups of the other kernels, and so to whole ones of these.
        let divides = self.trajectories() > 0 && WORKGROUP.is_multiple_of(self.trajectories());
        divides && self.has(hidden)
    }

    /// Whether these hidden layers can be shared so.
    fn has(self, hidden: &[FusedLayer]) -> bool {
        match self {
            Self::Tiles { trajectories, neurons, columns } => {
                [4, 8].contains(&neurons)
                    && [4, 8].contains(&columns)
                    && trajectories.is_multiple_of(columns)
            }
            Self::Slices { trajectories } => hidden.first().is_some_and(|first| {
                let equal = hidden.iter().all(|layer| layer.quads == first.quads);
                equal && trajectories.is_multiple_of(8) && first.quads >= 16
            }),
            Self::Rows { .. } => {
                let kept: u32 = hidden.iter().map(|layer| layer.depth).sum();
                !hidden.is_empty() && kept <= MOST_KEPT
            }
        }
    }

    /// Threads of a workgroup for these hidden layers: one for each tile or neuron of the widest, and for
    /// each trajectory.
    pub(super) fn lanes(self, hidden: &[FusedLayer]) -> u32 {
        let widest = hidden.iter().map(|layer| 4 * layer.quads).max().unwrap_or(BLOCK);
        let tiles = widest / self.tile_neurons() * (self.trajectories() / self.tile_columns());
        match self {
            Self::Rows { .. } => whole(widest.max(self.trajectories())),
            Self::Tiles { .. } => whole(tiles.max(self.trajectories())),
            // Each thread loads as much of a slice as any other.
            Self::Slices { .. } => tiles,
        }
    }

    /// Vectors of workgroup memory: activations of all trajectories, twice where rows take turns, and two
    /// slices of weights where there are some.
    pub(super) fn vectors(self, layers: &[FusedLayer]) -> u32 {
        let rows = layers.iter().map(|layer| layer.depth).max().unwrap_or(BLOCK);
        let activations = rows * self.trajectories() / 4;
        match self {
            Self::Tiles { .. } => activations,
            Self::Slices { .. } => activations + 2 * BLOCK * layers[0].quads,
            Self::Rows { .. } => 2 * activations,
        }
    }
}

/// The least number of threads: one for each trajectory, and no less than the other kernels have.
fn whole(lanes: u32) -> u32 {
    lanes.max(1).next_multiple_of(WORKGROUP / 2)
}
