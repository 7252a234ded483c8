//! How a batch is cut up: columns per chunk, steps per dispatch, steps per submission.

use super::compose::{MLP_LANES, TILE_COLUMNS, WORKGROUP};
use super::device::Adapter;
use super::network::{input_quads, output_quads, parameter_quads};
use crate::error::{Error, Result};
use crate::policy::Mlp;

/// Iterations that one invocation may spend, all its loops summed.
///
/// Mesa's lavapipe stops every invocation after 65,535 iterations without an error, its results
/// wrong; no other limit is known to be lower.
pub(super) const MAX_TRIPS: u64 = 60_000;

/// Columns are a multiple of this, so that the tiles of the network's layers are whole.
pub(super) const COLUMN_UNIT: u64 = (MLP_LANES * TILE_COLUMNS) as u64;
/// Most columns of a chunk under a formula: enough threads for any GPU.
pub(super) const FORMULA_COLUMNS: u64 = 1 << 18;
/// Most columns of a chunk under a network, which has a thread per 8 neurons of 8 columns.
pub(super) const NETWORK_COLUMNS: u64 = 1 << 14;
/// Most device memory of one call, bytes.
pub(super) const MEMORY_BYTES: u64 = 256 << 20;

/// What is asked of the rollouts, as far as it decides the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// Measures of trajectories.
    Measure,
    /// Signs of trajectories: the set of open ones is compacted after each submission.
    Sign,
    /// Pairs, whose distances are reduced after each submission.
    Pairs,
}

impl Work {
    /// Steps per submission, driven by a network or by a formula.
    fn segment(self, network: bool) -> u32 {
        match (self, network) {
            (Self::Measure, false) => 256,
            (Self::Measure, true) => 64,
            (Self::Sign, true) => 8,
            (Self::Sign, false) | (Self::Pairs, _) => 32,
        }
    }
}

/// How a batch is cut up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plan {
    /// Columns of a chunk: trajectories or pairs.
    pub(super) stride: u32,
    /// Trajectories in each row of the state: `stride`, or twice that for pairs.
    pub(super) row: u32,
    /// Steps per submission.
    pub(super) segment: u32,
    /// Steps per dispatch: all of a segment, or 1 under a network, whose layers come between.
    pub(super) steps: u32,
}

impl Plan {
    /// The plan for `count` starts or pairs of `states` states on `adapter`.
    ///
    /// # Errors
    /// [`Error::Device`] if not even the smallest chunk fits.
    pub(super) fn new(
        adapter: &Adapter,
        work: Work,
        states: usize,
        network: Option<&Mlp>,
        count: u64,
    ) -> Result<Self> {
        let sides = if work == Work::Pairs { 2 } else { 1 };
        let segment = work.segment(network.is_some());
        let cap = if network.is_some() { NETWORK_COLUMNS } else { FORMULA_COLUMNS };
        let parts = column_bytes(work, states, network, segment);
        let largest = parts.iter().copied().max().unwrap_or(1);
        let binding = adapter.max_binding_bytes.min(adapter.max_buffer_bytes);
        let fitting = (binding / largest).min(MEMORY_BYTES / parts.iter().sum::<u64>());
        let wanted = count.max(1).next_multiple_of(COLUMN_UNIT).min(cap);
        let stride = wanted.min(fitting / COLUMN_UNIT * COLUMN_UNIT);
        let parameters = 16 * network.map_or(0, parameter_quads) as u64;
        if stride == 0 || parameters > binding {
            return Err(too_large(adapter, largest * COLUMN_UNIT, parameters, binding));
        }
        let steps = if network.is_some() { 1 } else { segment };
        let trips = longest_trips(states, network, stride, u64::from(steps));
        if trips > MAX_TRIPS {
            return Err(Error::Device(format!(
                "a kernel would need {trips} loop iterations per thread, and some drivers stop \
                 at {MAX_TRIPS} without notice; use the native CPU backend for this size"
            )));
        }
        Ok(Self { stride: stride as u32, row: stride as u32 * sides, segment, steps })
    }
}

/// Bytes that each buffer holds per column.
fn column_bytes(work: Work, states: usize, network: Option<&Mlp>, segment: u32) -> Vec<u64> {
    let sides = if work == Work::Pairs { 2 } else { 1 };
    let state = 16 * input_quads(states) as u64 * sides;
    let (folds, origin, measure) = (8 * sides, 4, 4 * sides);
    let mut parts = vec![state, folds, origin, measure];
    match work {
        Work::Measure => {}
        Work::Sign => parts.extend([state, folds, origin]),
        Work::Pairs => parts.push(4 * u64::from(segment)),
    }
    if let Some(mlp) = network {
        let widths = mlp.layers().iter().map(|layer| output_quads(layer.outputs));
        let widest = 16 * widths.max().unwrap_or(0) as u64 * sides;
        parts.extend([widest, widest]);
    }
    parts
}

/// Most loop iterations of one invocation of any kernel of the plan.
fn longest_trips(states: usize, network: Option<&Mlp>, stride: u64, steps: u64) -> u64 {
    let states = states as u64;
    // Philox takes 10 iterations per 4 words; a start and its perturbation run over the states
    // at most 4 times each, and over half as many pairs.
    let blocks = states.div_ceil(4) + 2;
    let sample = 2 * (10 * blocks + 5 * states);
    let layers = network.into_iter().flat_map(Mlp::layers);
    let layer = layers.map(|layer| input_quads(layer.inputs) as u64).max();
    let reduce = stride.div_ceil(u64::from(WORKGROUP)) + 8;
    let compact = states.div_ceil(4);
    [sample, layer.unwrap_or(0), reduce, compact, steps].into_iter().max().unwrap_or(0)
}

fn too_large(adapter: &Adapter, columns: u64, parameters: u64, binding: u64) -> Error {
    Error::Device(format!(
        "{}: a network of {parameters} bytes, or {columns} bytes for the smallest chunk, do not \
         fit the adapter's limit of {binding} bytes per binding; use the native CPU backend",
        adapter.name
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::{Activation, Layer, OutputActivation};

    fn network(widths: &[usize]) -> Mlp {
        let layer = |pair: &[usize]| Layer {
            weight: vec![0.0; pair[0] * pair[1]],
            bias: vec![0.0; pair[1]],
            inputs: pair[0],
            outputs: pair[1],
        };
        let layers = widths.windows(2).map(layer).collect();
        Mlp::new(layers, Activation::Relu, OutputActivation::Tanh).expect("a whole network")
    }

    #[test]
    fn chunks_are_whole_tiles_within_the_limits() {
        let wide = network(&[12, 512, 512, 3]);
        for (binding, count) in [(1 << 27, 1), (1 << 27, u64::MAX / 2), (1 << 20, 100_000_000)] {
            for network in [None, Some(&wide)] {
                for work in [Work::Measure, Work::Sign, Work::Pairs] {
                    // Parameters of the wide network take a megabyte of their own.
                    let binding = binding + if network.is_some() { 1 << 21 } else { 0 };
                    let plan = Plan::new(&Adapter::made_up(binding), work, 12, network, count);
                    let plan = plan.expect("a plan within the limits");
                    let bytes = column_bytes(work, 12, network, plan.segment);
                    let stride = u64::from(plan.stride);
                    assert_eq!(stride % COLUMN_UNIT, 0);
                    assert!(bytes.iter().all(|bytes| bytes * stride <= binding));
                    assert!(bytes.iter().sum::<u64>() * stride <= MEMORY_BYTES);
                    assert!(u64::from(plan.steps) <= MAX_TRIPS);
                }
            }
        }
    }

    #[test]
    fn small_batches_get_small_chunks() {
        let plan = Plan::new(&Adapter::made_up(1 << 27), Work::Measure, 12, None, 468);
        assert_eq!(plan.expect("a plan").stride, 512);
    }

    #[test]
    fn what_cannot_run_is_refused() {
        let small = Plan::new(&Adapter::made_up(1 << 10), Work::Measure, 12, None, 10);
        assert!(matches!(small, Err(Error::Device(_))), "{small:?}");
        let states = 4 * MAX_TRIPS as usize;
        let long = Plan::new(&Adapter::made_up(1 << 30), Work::Measure, states, None, 10);
        let text = long.expect_err("too many iterations").to_string();
        assert!(text.contains("loop iterations"), "{text}");
    }
}
