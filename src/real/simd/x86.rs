//! AVX-512 and AVX2 with fused multiply-add: the proofs that a processor has them.

use super::body::{Body, Simd};
use super::vector_x86::{Vector256, Vector512};

/// The processor has AVX-512 as in x86-64-v4.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx512(());

/// The processor has AVX2 and fused multiply-add.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

impl Avx512 {
    /// The proof, if there is one.
    pub(crate) fn detect() -> Option<Self> {
        let found = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512cd")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        (found && Avx2::detect().is_some()).then_some(Self(()))
    }
}

impl Avx2 {
    /// The proof, if there is one.
    pub(crate) fn detect() -> Option<Self> {
        let found = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        found.then_some(Self(()))
    }
}

#[allow(unsafe_code, reason = "instructions behind a proof of their presence")]
mod calls {
    use super::{Avx2, Avx512, Body, Simd, Vector256, Vector512};

    #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,avx2,fma")]
    fn call_avx512<B: Body>(body: B) -> B::Output {
        body.run()
    }

    #[target_feature(enable = "avx2,fma")]
    fn call_avx2<B: Body>(body: B) -> B::Output {
        body.run()
    }

    impl Simd for Avx512 {
        type Vector = Vector512;

        fn call<B: Body>(self, body: B) -> B::Output {
            // SAFETY: `self` proves that the processor has the instructions.
            unsafe { call_avx512(body) }
        }
    }

    impl Simd for Avx2 {
        type Vector = Vector256;

        fn call<B: Body>(self, body: B) -> B::Output {
            // SAFETY: `self` proves that the processor has the instructions.
            unsafe { call_avx2(body) }
        }
    }
}
