//! What the machine can do at most: matrix products, memory, and the way to an adapter and back.

use std::hint::black_box;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::measure::{Protocol, Timing, measure};
use crate::backend::Backend;
use crate::backend::gpu::DeviceLimits;
use crate::error::Result;
use crate::files::{CONFIG_BYTES, read_text};
use crate::model::Plant;
use crate::rollout::{Query, ReachAvoidTask, RolloutSpec, Starts, Tightening};
use crate::system::{BangBang, DoubleIntegrator};

/// Rows and columns of the square matrices: three of them fit the inner caches of a core.
const SIZE: usize = 512;
/// Products of a call, so that starting threads does not count.
const PRODUCTS: usize = 4;
/// Smallest array of the triad, numbers.
const LEAST_ARRAY: usize = 1 << 24;
/// Size of an array of the triad over that of the largest cache.
const CACHES: usize = 4;
/// Bytes that the triad moves per number: two are read, one is written.
const TRIAD_BYTES: usize = 3 * size_of::<f32>();

/// The limits of the processor and its memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HostLimits {
    /// f32 matrix products on one thread, floating-point operations per second: the best call.
    #[serde(with = "crate::files::number")]
    pub gemm_one_flops: f64,
    /// The same on all threads, each with matrices of its own: the limit of every CPU workload.
    #[serde(with = "crate::files::number")]
    pub gemm_all_flops: f64,
    /// `a = b + s c` over arrays larger than the caches on all threads, bytes per second: two
    /// numbers read and one written; that a cache may read the line it is to write is not counted.
    #[serde(with = "crate::files::number")]
    pub triad_bytes: f64,
    /// Length of each of the three arrays, bytes.
    pub triad_array_bytes: usize,
    /// Threads of the figures for all of them.
    pub threads: usize,
}

impl HostLimits {
    /// Measures them on one and on `threads` threads.
    ///
    /// # Errors
    /// None of its own.
    pub fn measure(protocol: &Protocol, threads: usize) -> Result<Self> {
        let array = (CACHES * largest_cache() / size_of::<f32>()).max(LEAST_ARRAY);
        Ok(Self {
            gemm_one_flops: gemm_flops(protocol, 1)?,
            gemm_all_flops: gemm_flops(protocol, threads)?,
            triad_bytes: triad_bytes(protocol, threads, array)?,
            triad_array_bytes: array * size_of::<f32>(),
            threads,
        })
    }

    /// The better of two measurements of the same machine: others use it too, and a limit is what
    /// it does undisturbed.
    #[must_use]
    pub fn better(self, other: &Self) -> Self {
        Self {
            gemm_one_flops: self.gemm_one_flops.max(other.gemm_one_flops),
            gemm_all_flops: self.gemm_all_flops.max(other.gemm_all_flops),
            triad_bytes: self.triad_bytes.max(other.triad_bytes),
            ..self
        }
    }
}

/// Operations per second of the best call.
fn gemm_flops(protocol: &Protocol, threads: usize) -> Result<f64> {
    let square = || vec![0.5_f32; SIZE * SIZE];
    let mut work: Vec<[Vec<f32>; 3]> =
        (0..threads).map(|_| [square(), square(), square()]).collect();
    let timing = measure(protocol, || {
        each(&mut work, |[y, w, x]| {
            for _ in 0..PRODUCTS {
                multiply(y, w, x, [SIZE; 3]);
            }
            black_box(y);
        });
        Ok(())
    })?;
    let products = (threads * PRODUCTS) as f64;
    Ok(products * 2.0 * (SIZE as f64).powi(3) / timing.best_seconds)
}

/// Bytes per second of the best call.
fn triad_bytes(protocol: &Protocol, threads: usize, length: usize) -> Result<f64> {
    let (mut a, b, c) = (vec![0.0_f32; length], vec![1.0_f32; length], vec![2.0_f32; length]);
    let part = length.div_ceil(threads);
    let mut work: Vec<_> = a.chunks_mut(part).zip(b.chunks(part).zip(c.chunks(part))).collect();
    let timing = measure(protocol, || {
        each(&mut work, |(a, (b, c))| {
            for (a, (b, c)) in a.iter_mut().zip(b.iter().zip(*c)) {
                *a = b + 3.0 * c;
            }
            black_box(a);
        });
        Ok(())
    })?;
    Ok((TRIAD_BYTES * length) as f64 / timing.best_seconds)
}

/// Does `job` on each of `work`, each on a thread of its own; a single one on this thread.
fn each<T: Send>(work: &mut [T], job: impl Fn(&mut T) + Sync) {
    if let [only] = work {
        return job(only);
    }
    std::thread::scope(|scope| {
        for work in work {
            scope.spawn(|| job(work));
        }
    });
}

/// `y = w x` by the crate `gemm-f32` on this thread: w `[outputs, inputs]`, x `[inputs, lanes]`, y
/// `[outputs, lanes]`, each row by row.
///
/// # Panics
/// If a slice is shorter than its shape.
#[allow(unsafe_code, reason = "the crate's interface takes pointers")]
pub fn multiply(y: &mut [f32], w: &[f32], x: &[f32], [outputs, inputs, lanes]: [usize; 3]) {
    assert!(y.len() >= outputs * lanes, "y [outputs, lanes]");
    assert!(w.len() >= outputs * inputs, "w [outputs, inputs]");
    assert!(x.len() >= inputs * lanes, "x [inputs, lanes]");
    // Its kernels take columns: rows of y, x and w are those of their transposes, whose product is in turn.
    let product = gemm_f32::gemm::f32::get_gemm_fn();
    // SAFETY: the strides are those of the shapes asserted above.
    unsafe {
        product(
            lanes,
            outputs,
            inputs,
            y.as_mut_ptr(),
            lanes as isize,
            1,
            false,
            x.as_ptr(),
            lanes as isize,
            1,
            w.as_ptr(),
            inputs as isize,
            1,
            0.0,
            1.0,
            false,
            false,
            false,
            gemm_common::Parallelism::None,
        );
    }
}

/// Bytes of the largest cache that a core sees, where the system tells; else 0.
fn largest_cache() -> usize {
    let size = |index: usize| {
        let path = format!("/sys/devices/system/cpu/cpu0/cache/index{index}/size");
        let kibibytes = read_text(Path::new(&path), CONFIG_BYTES).ok()?;
        kibibytes.trim().strip_suffix('K')?.parse::<usize>().ok().map(|size| size << 10)
    };
    (0..8).filter_map(size).max().unwrap_or(0)
}

/// The limits of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdapterLimits {
    /// One rollout of one step and no network: submission, kernels and readback. No batch takes
    /// less.
    pub round_trip: Timing,
    /// Arithmetic, memory, and what a submission and a dispatch cost.
    pub device: DeviceLimits,
}

impl AdapterLimits {
    /// Measures those of the adapter of `backend`; none without one.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn measure(protocol: &Protocol, backend: &Backend) -> Result<Option<Self>> {
        let Backend::Gpu(gpu) = backend else { return Ok(None) };
        let (system, policy) = (DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
        let spec = RolloutSpec::new(1, 1.0)?;
        let task = ReachAvoidTask {
            starts: Starts::listed(&[[0.5, 0.0]]),
            range: 0..1,
            spec,
            tightening: &Tightening::none(&spec),
            query: Query::Measure,
        };
        let program = backend.prepare(&Plant::of(system, policy))?;
        // Compiles the kernels, which no later call does.
        program.reach_avoid(&task, &mut |_, _| Ok(()))?;
        let round_trip = measure(protocol, || program.reach_avoid(&task, &mut |_, _| Ok(())))?;
        Ok(Some(Self { round_trip, device: gpu.measure_limits()? }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_have_the_stated_shapes() {
        // [2, 3] times [3, 2], by hand.
        let (w, x) = ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let mut y = [0.0; 4];
        multiply(&mut y, &w, &x, [2, 3, 2]);
        assert_eq!(y, [22.0, 28.0, 49.0, 64.0]);
    }

    #[test]
    fn the_better_of_two_limits_counts() {
        let of = |one, all, triad| HostLimits {
            gemm_one_flops: one,
            gemm_all_flops: all,
            triad_bytes: triad,
            triad_array_bytes: 1,
            threads: 2,
        };
        assert_eq!(of(1.0, 5.0, 3.0).better(&of(2.0, 4.0, 6.0)), of(2.0, 5.0, 6.0));
    }

    #[test]
    fn every_thread_does_its_part() {
        let mut work = [1, 2, 3];
        each(&mut work, |part| *part *= 10);
        assert_eq!(work, [10, 20, 30]);
    }
}
