//! Which instructions the rollouts are compiled for: picked once, when the backend starts.

use std::marker::PhantomData;

use super::kernel::{Kernel, Portable};
#[cfg(target_arch = "x86_64")]
use super::kernel_x86::{Avx2, Avx512};
use crate::real::Vector;

/// Work on one group of lanes, compiled for each instruction set by itself.
///
/// Small and few: every body is compiled for every set.
pub(super) trait Body {
    /// What it returns.
    type Output;

    /// Does the work. Must be `#[inline(always)]`, as all that it calls, or it is compiled for
    /// the baseline instructions.
    fn run(self) -> Self::Output;
}

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

/// Formulas over the vectors of an instruction set.
pub(super) trait Formulas {
    /// Does the work. Must be `#[inline(always)]`, as for [`Body`].
    fn run<V: Vector>(self);
}

/// Formulas as the body that a kernel calls.
struct InVectors<K, F> {
    kernel: PhantomData<K>,
    formulas: F,
}

impl<K: Kernel, F: Formulas> Body for InVectors<K, F> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.formulas.run::<K::Vector>();
    }
}

/// An instruction set that the processor has.
#[derive(Clone, Copy, Debug)]
pub(super) enum Instructions {
    /// 16 lanes per register.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// 8 lanes per register.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// Those that the whole program is compiled for.
    Baseline,
}

impl Instructions {
    /// All that the processor has, the fastest first.
    pub(super) fn detect() -> Vec<Self> {
        let mut found = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            found.extend(Avx512::detect().map(Self::Avx512));
            found.extend(Avx2::detect().map(Self::Avx2));
        }
        found.push(Self::Baseline);
        found
    }

    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "AVX-512",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "AVX2",
            Self::Baseline => "baseline instructions",
        }
    }

    /// Neurons per panel of the kernel.
    pub(super) fn rows(self) -> usize {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => Avx512::ROWS,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => Avx2::ROWS,
            Self::Baseline => Portable::ROWS,
        }
    }

    /// Evaluates `formulas` with these instructions.
    pub(super) fn call<F: Formulas>(self, formulas: F) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(kernel) => in_vectors(kernel, formulas),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(kernel) => in_vectors(kernel, formulas),
            Self::Baseline => in_vectors(Portable, formulas),
        }
    }

    /// Does `unit` with these instructions.
    ///
    /// 16 lanes per group; for a unit that draws, 32 with AVX-512.
    pub(super) fn run<U: Unit>(self, unit: U) -> U::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(kernel) if U::DRAWS => unit.run::<_, 32>(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(kernel) => unit.run::<_, 16>(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(kernel) => unit.run::<_, 16>(kernel),
            Self::Baseline => unit.run::<_, 16>(Portable),
        }
    }
}

/// Calls `formulas` through `kernel`.
fn in_vectors<K: Kernel, F: Formulas>(kernel: K, formulas: F) {
    kernel.call(InVectors::<K, F> { kernel: PhantomData, formulas });
}
