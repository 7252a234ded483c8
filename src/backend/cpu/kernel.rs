//! Dense-layer kernels: a panel of neurons times a block of trajectories, summed in registers.

use crate::real::simd::{Portable, Simd};
pub(super) use crate::tile::GRANULE;

/// Consecutive neurons of a layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Panel<'a> {
    /// Their weights, `[inputs, rows]`.
    pub(super) weights: &'a [f32],
    /// Their biases, `[rows]`.
    pub(super) bias: &'a [f32],
    /// Lower bound of the results: 0 for a rectified layer, else minus infinity.
    pub(super) floor: f32,
}

/// The dense-layer kernel of an instruction set.
///
/// Each sum starts with the bias and takes the inputs in order, so the bits depend neither on the
/// place of a trajectory in its block nor on the panel that a neuron belongs to; with and without
/// fused multiply-add they differ.
pub(super) trait Kernel: Simd {
    /// Most neurons of a panel.
    const ROWS: usize;
    /// Trajectories of a block, a multiple of [`GRANULE`].
    const BLOCK: usize;

    /// Writes `max(floor, W x + b)`, `[rows, BLOCK]`, of the inputs `[inputs, BLOCK]`; NaN stays.
    ///
    /// Only the first `lanes` trajectories are computed, rounded up to a granule.
    ///
    /// # Panics
    /// If a slice has not its shape.
    fn panel(self, panel: Panel<'_>, lanes: usize, inputs: &[f32], outputs: &mut [f32]);
}

impl Kernel for Portable {
    // 16 vector registers of 4 lanes hold 2 rows of sums beside the inputs, 32 hold 4.
    const ROWS: usize = if FUSED { 4 } else { 2 };
    const BLOCK: usize = GRANULE;

    fn panel(self, panel: Panel<'_>, _lanes: usize, inputs: &[f32], outputs: &mut [f32]) {
        match panel.bias.len() {
            1 => portable::<1>(panel, inputs, outputs),
            2 => portable::<2>(panel, inputs, outputs),
            3 => portable::<3>(panel, inputs, outputs),
            rows => {
                assert_eq!(rows, 4, "a panel has 1 to 4 rows");
                portable::<4>(panel, inputs, outputs);
            }
        }
    }
}

/// Whether the target always has fused multiply-add; elsewhere it would be a library call.
const FUSED: bool = cfg!(target_arch = "aarch64");

#[inline(always)]
fn portable<const R: usize>(panel: Panel<'_>, inputs: &[f32], outputs: &mut [f32]) {
    let mut sums = [[0.0; GRANULE]; R];
    for (sums, bias) in sums.iter_mut().zip(panel.bias) {
        *sums = [*bias; GRANULE];
    }
    let columns = panel.weights.as_chunks::<R>().0;
    for (weights, x) in columns.iter().zip(inputs.as_chunks::<GRANULE>().0) {
        for (sums, &weight) in sums.iter_mut().zip(weights) {
            for (sum, &x) in sums.iter_mut().zip(x) {
                *sum = if FUSED { weight.mul_add(x, *sum) } else { *sum + weight * x };
            }
        }
    }
    for (outputs, sums) in outputs.as_chunks_mut::<GRANULE>().0.iter_mut().zip(sums) {
        for (output, sum) in outputs.iter_mut().zip(sums) {
            *output = if sum < panel.floor { panel.floor } else { sum };
        }
    }
}
