//! What formulas that call networks cost, as far as it decides the chunks.

use super::compose::{
    AskShape, ChainSizes, ChainText, layer_dispatches, layer_trips, output_quads, parameter_quads,
};
use super::network::network_flops;
use crate::policy::Mlp;

/// Bytes of a vector of 4 numbers.
const VECTOR_BYTES: u64 = 16;

/// What a chain costs, as far as it decides the chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChainLoad {
    /// Bytes that each of its buffers holds per trajectory.
    pub(super) bytes: [u64; 5],
    /// Operations of its networks for a step.
    pub(super) flops: u64,
    /// Bytes of the parameters of the largest of its networks.
    pub(super) parameters: u64,
    /// Vectors of the widest input of a layer.
    pub(super) inputs: u64,
    /// Dispatches of a step.
    pub(super) dispatches: usize,
}

impl ChainLoad {
    /// Of `chain`.
    pub(super) fn new(chain: &ChainText) -> Self {
        let networks = chain.networks();
        let most = |of: fn(&Mlp) -> u64| networks.iter().map(|mlp| of(mlp)).max().unwrap_or(0);
        let asks = || (0..chain.count()).flat_map(|link| chain.asks(link));
        let layers = |ask: &AskShape| layer_dispatches(&networks[ask.network]);
        let activations = VECTOR_BYTES * most(widest_quads);
        let ChainSizes { kept, asked, said } = chain.sizes();
        let vectors = |numbers: usize| VECTOR_BYTES * numbers.div_ceil(4) as u64;
        Self {
            bytes: [4 * kept as u64, vectors(asked), vectors(said), activations, activations],
            flops: asks().map(|ask| network_flops(&networks[ask.network])).sum(),
            parameters: VECTOR_BYTES * most(|mlp| parameter_quads(mlp) as u64),
            inputs: most(layer_trips),
            dispatches: chain.count() + asks().map(layers).sum::<usize>(),
        }
    }
}

/// Vectors of the widest layer.
fn widest_quads(mlp: &Mlp) -> u64 {
    let quads = mlp.layers().iter().map(|layer| output_quads(layer.outputs) as u64);
    quads.max().unwrap_or(0)
}
