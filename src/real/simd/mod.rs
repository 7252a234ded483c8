//! Instruction sets: what formulas are compiled for, picked when the program starts.

mod body;
#[cfg(target_arch = "x86_64")]
mod vector_x86;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::marker::PhantomData;
use std::sync::OnceLock;

use super::Lanes;
pub(crate) use body::{Body, Formulas, Simd};
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Avx2, Avx512};

/// Numbers of the vectors that the compiler makes of plain arrays.
const PORTABLE: usize = 16;

/// Those that the whole program is compiled for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

impl Simd for Portable {
    type Vector = Lanes<PORTABLE>;

    #[inline(never)]
    fn call<B: Body>(self, body: B) -> B::Output {
        body.run()
    }
}

/// Formulas as the body that an instruction set calls.
struct InVectors<K, F> {
    set: PhantomData<K>,
    formulas: F,
}

impl<K: Simd, F: Formulas> Body for InVectors<K, F> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.formulas.run::<K::Vector>();
    }
}

/// An instruction set that the processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instructions {
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
    pub(crate) fn detect() -> Vec<Self> {
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
    pub(crate) fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "AVX-512",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "AVX2",
            Self::Baseline => "baseline instructions",
        }
    }

    /// The fastest that the processor has.
    pub(crate) fn fastest() -> Self {
        static FASTEST: OnceLock<Instructions> = OnceLock::new();
        *FASTEST.get_or_init(|| Self::detect().remove(0))
    }

    /// Runs `body` with these instructions.
    pub(crate) fn run<B: Body>(self, body: B) -> B::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(kernel) => kernel.call(body),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(kernel) => kernel.call(body),
            Self::Baseline => Portable.call(body),
        }
    }

    /// Evaluates `formulas` with these instructions.
    pub(crate) fn call<F: Formulas>(self, formulas: F) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(kernel) => in_vectors(kernel, formulas),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(kernel) => in_vectors(kernel, formulas),
            Self::Baseline => in_vectors(Portable, formulas),
        }
    }
}

/// Calls `formulas` through `set`.
fn in_vectors<K: Simd, F: Formulas>(set: K, formulas: F) {
    set.call(InVectors::<K, F> { set: PhantomData, formulas });
}
