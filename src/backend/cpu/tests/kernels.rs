//! The dense-layer kernels against a scalar loop, to the bit.

use super::super::dispatch::{Unit, run};
use super::super::kernel::{GRANULE, Kernel, Panel};
use crate::real::simd::Instructions;

/// Compares every shape of panel with a scalar loop.
struct EveryShape {
    fused: bool,
}

impl Unit for EveryShape {
    type Output = ();

    fn run<K: Kernel, const N: usize>(self, kernel: K) {
        for rows in 1..=K::ROWS {
            for lanes in (GRANULE..=K::BLOCK).step_by(GRANULE) {
                for inputs in [1, 2, 3, 17] {
                    for floor in [0.0, f32::NEG_INFINITY] {
                        self.compare(kernel, [rows, lanes, inputs], floor);
                    }
                }
            }
        }
    }
}

impl EveryShape {
    fn compare<K: Kernel>(&self, kernel: K, [rows, lanes, inputs]: [usize; 3], floor: f32) {
        let number = |i: usize| ((i * 7919 + 13) % 1009) as f32 / 504.5 - 1.0;
        let weights: Vec<f32> = (0..inputs * rows).map(number).collect();
        let bias: Vec<f32> = (0..rows).map(|r| number(r + 5)).collect();
        let mut x: Vec<f32> = (0..inputs * K::BLOCK).map(|i| number(3 * i)).collect();
        // NaN must come through the floor, in its own lane only.
        x[5] = f32::NAN;
        let mut y = vec![0.25; rows * K::BLOCK];
        let panel = Panel { weights: &weights, bias: &bias, floor };
        kernel.panel(panel, lanes, &x, &mut y);
        for (r, bias) in bias.iter().enumerate() {
            for lane in 0..lanes {
                let sum = (0..inputs).fold(*bias, |sum, i| {
                    let (weight, x) = (weights[i * rows + r], x[i * K::BLOCK + lane]);
                    if self.fused { weight.mul_add(x, sum) } else { sum + weight * x }
                });
                let expected = if sum < floor { floor } else { sum };
                let got = y[r * K::BLOCK + lane];
                assert_eq!(got.is_nan(), lane == 5);
                assert!(
                    got.to_bits() == expected.to_bits() || got.is_nan() && expected.is_nan(),
                    "{rows} rows, {lanes} lanes, {inputs} inputs: {got} at ({r}, {lane}), \
                     expected {expected}"
                );
            }
        }
    }
}

#[test]
fn every_kernel_is_the_scalar_loop() {
    for instructions in Instructions::detect() {
        let baseline = matches!(instructions, Instructions::Baseline);
        let fused = !baseline || cfg!(target_arch = "aarch64");
        run(instructions, EveryShape { fused });
    }
}
