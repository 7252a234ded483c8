//! The text of each kernel: constants, recorded formulas and the files of `shaders/`, concatenated.

mod chain;
mod fit;
mod fused;
mod glue;
mod kernels;
mod layers;
mod limits;
mod lookups;
mod mppi;
mod mppi_terminal;
mod narrowed;
mod physics_glue;
mod plant;

pub use chain::ChainText;
pub(super) use chain::{AskShape, ChainSizes};
pub(super) use fused::packed as packed_by_inputs;
pub use fused::{Form, Fused};
pub use kernels::{
    Access, COUNTED, Kernel, PARTIAL_HEADER, Slot, TILE_COLUMNS, TILE_PITCH, TILE_QUADS, WORKGROUP,
};
pub(super) use layers::{
    LayerShape, input_quads, layer_dispatches, layer_trips, output_quads, parameter_quads,
};
pub use limits::limit_kernel;
pub use mppi::MppiText;
pub(super) use mppi::tile_steps;
pub(super) use narrowed::{BLOCK_WORDS, COLUMNS_WORD, GROUPS_WORD};
pub use plant::PlantText;
pub(super) use plant::layer_kernel;
