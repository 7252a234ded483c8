//! Which instructions the rollouts are compiled for: picked once, when the backend starts.

use super::kernel::{Kernel, Portable};
#[cfg(target_arch = "x86_64")]
use super::kernel_x86::{Avx2, Avx512};

/// Work that is compiled once for each instruction set.
pub(super) trait Body {
    /// What it returns.
    type Output;

    /// Does the work, `N` trajectories per group of lanes; must be `#[inline(always)]`, as all
    /// that it calls in a loop, to be compiled for the instructions of `kernel`.
    fn run<K: Kernel, const N: usize>(self, kernel: K) -> Self::Output;
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

    /// Does `body` with these instructions.
    ///
    /// The lanes per group are those that the compiler vectorises best.
    #[allow(
        unsafe_code,
        reason = "calls functions compiled for other instructions"
    )]
    pub(super) fn run<B: Body>(self, body: B) -> B::Output {
        match self {
            // SAFETY: an `Avx512` is the proof that the processor has these instructions.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(proof) => unsafe { with_avx512(body, proof) },
            // SAFETY: an `Avx2` is the proof that the processor has these instructions.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(proof) => unsafe { with_avx2(body, proof) },
            Self::Baseline => body.run::<_, 16>(Portable),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx2,fma")]
fn with_avx512<B: Body>(body: B, proof: Avx512) -> B::Output {
    body.run::<_, 32>(proof)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx2<B: Body>(body: B, proof: Avx2) -> B::Output {
    body.run::<_, 16>(proof)
}
