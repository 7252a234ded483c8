//! Which instructions the rollouts are compiled for: units of work by the set that the backend
//! picked when it started.

use super::kernel::Kernel;
#[cfg(target_arch = "x86_64")]
use crate::real::simd::{Avx2, Avx512};
use crate::real::simd::{Instructions, Portable};

/// Work of a thread: plain code around the bodies that it calls through the kernel.
pub(super) trait Unit {
    /// What it returns.
    type Output;

    /// Whether it draws random words all the time. These are left to the compiler, which finds the
    /// vectors of AVX-512 in loops of two of them alone.
    const DRAWS: bool = false;

    /// Does the work, `N` trajectories per group.
    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Self::Output;
}

/// Neurons per panel of the kernel of an instruction set.
pub(super) fn rows(with: Instructions) -> usize {
    match with {
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(_) => Avx512::ROWS,
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(_) => Avx2::ROWS,
        Instructions::Baseline => Portable::ROWS,
    }
}

/// Does `unit` with an instruction set.
///
/// 16 lanes per group; for a unit that draws, 32 with AVX-512.
pub(super) fn run<U: Unit>(with: Instructions, unit: U) -> U::Output {
    match with {
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(kernel) if U::DRAWS => unit.run::<_, 32>(kernel),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512(kernel) => unit.run::<_, 16>(kernel),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2(kernel) => unit.run::<_, 16>(kernel),
        Instructions::Baseline => unit.run::<_, 16>(Portable),
    }
}
