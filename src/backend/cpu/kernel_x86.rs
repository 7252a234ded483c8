//! The dense-layer kernels for AVX-512 and for AVX2 with fused multiply-add.

use super::kernel::{Kernel, Panel};
use crate::real::simd::{Avx2, Avx512};

/// Rows of inputs that are fetched ahead of their use.
const AHEAD: usize = 8;
/// Numbers in a cache line.
const LINE: usize = 16;
use std::arch::x86_64::{
    _MM_HINT_T0, _mm_prefetch, _mm256_fmadd_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_set1_ps,
    _mm256_storeu_ps, _mm512_fmadd_ps, _mm512_loadu_ps, _mm512_max_ps, _mm512_set1_ps,
    _mm512_storeu_ps,
};

/// A kernel of `R` neurons by `V` vectors of trajectories in blocks of `$block`.
macro_rules! x86_kernel {
    (
        $name:ident, $features:literal, $block:expr, $width:literal,
        $load:ident, $store:ident, $splat:ident, $fma:ident, $max:ident
    ) => {
        #[target_feature(enable = $features)]
        fn $name<const R: usize, const V: usize>(
            panel: Panel<'_>,
            inputs: &[f32],
            outputs: &mut [f32],
        ) {
            let count = panel.weights.len() / R;
            assert!(V * $width <= $block, "the vectors fit the block");
            assert_eq!(panel.weights.len(), count * R, "weights [inputs, rows]");
            assert_eq!(inputs.len(), count * $block, "inputs [inputs, BLOCK]");
            assert_eq!(outputs.len(), R * $block, "outputs [rows, BLOCK]");
            let mut sums = [[$splat(0.0); V]; R];
            for (sums, bias) in sums.iter_mut().zip(panel.bias) {
                *sums = [$splat(*bias); V];
            }
            let (weights, x) = (panel.weights.as_ptr(), inputs.as_ptr());
            for i in 0..count {
                // SAFETY: i < count, so with the shapes asserted above each vector ends within
                // the `$block` inputs of row i, and each weight is one of the R of column i. A
                // prefetch may go anywhere.
                unsafe {
                    let mut lanes = [$splat(0.0); V];
                    for (v, lanes) in lanes.iter_mut().enumerate() {
                        *lanes = $load(x.add(i * $block + v * $width));
                    }
                    for line in 0..V * $width / LINE {
                        let ahead = x.wrapping_add((i + AHEAD) * $block + line * LINE);
                        _mm_prefetch::<_MM_HINT_T0>(ahead.cast());
                    }
                    for r in 0..R {
                        let weight = $splat(*weights.add(i * R + r));
                        for v in 0..V {
                            sums[r][v] = $fma(weight, lanes[v], sums[r][v]);
                        }
                    }
                }
            }
            // The maximum of the floor and NaN is NaN in this order of the operands.
            let floor = $splat(panel.floor);
            let out = outputs.as_mut_ptr();
            for (r, sums) in sums.iter().enumerate() {
                for (v, sum) in sums.iter().enumerate() {
                    // SAFETY: r < R and V vectors fit a block: within the length asserted above.
                    unsafe { $store(out.add(r * $block + v * $width), $max(floor, *sum)) };
                }
            }
        }
    };
}

#[allow(unsafe_code, reason = "vector instructions behind a proof of their presence")]
mod kernels {
    use super::*;

    x86_kernel!(
        avx512,
        "avx512f",
        Avx512::BLOCK,
        16,
        _mm512_loadu_ps,
        _mm512_storeu_ps,
        _mm512_set1_ps,
        _mm512_fmadd_ps,
        _mm512_max_ps
    );
    x86_kernel!(
        avx2,
        "avx2,fma",
        Avx2::BLOCK,
        8,
        _mm256_loadu_ps,
        _mm256_storeu_ps,
        _mm256_set1_ps,
        _mm256_fmadd_ps,
        _mm256_max_ps
    );

    /// Calls the kernel for as many rows as the panel has.
    macro_rules! by_rows {
        ($kernel:ident, $vectors:literal, $panel:ident, $inputs:ident, $outputs:ident: $($rows:literal)*) => {
            match $panel.bias.len() {
                // SAFETY: `self` proves that the processor has the instructions.
                $($rows => unsafe { $kernel::<$rows, $vectors>($panel, $inputs, $outputs) },)*
                rows => panic!("a panel of {rows} rows is wider than the kernel"),
            }
        };
    }

    impl Kernel for Avx512 {
        // 24 of 32 registers hold sums.
        const ROWS: usize = 8;
        const BLOCK: usize = 48;

        fn panel(self, panel: Panel<'_>, lanes: usize, inputs: &[f32], outputs: &mut [f32]) {
            match lanes {
                0..=16 => by_rows!(avx512, 1, panel, inputs, outputs: 1 2 3 4 5 6 7 8),
                17..=32 => by_rows!(avx512, 2, panel, inputs, outputs: 1 2 3 4 5 6 7 8),
                _ => by_rows!(avx512, 3, panel, inputs, outputs: 1 2 3 4 5 6 7 8),
            }
        }
    }

    impl Kernel for Avx2 {
        // 12 of 16 registers hold sums.
        const ROWS: usize = 6;
        const BLOCK: usize = 16;

        fn panel(self, panel: Panel<'_>, _lanes: usize, inputs: &[f32], outputs: &mut [f32]) {
            by_rows!(avx2, 2, panel, inputs, outputs: 1 2 3 4 5 6)
        }
    }
}
