//! Vectors of AVX-512 and of AVX2: a formula over them is one instruction per operation.
//!
//! The types are named by the kernels of their instructions alone, whose values prove that the
//! processor has them, and formulas over them run in bodies that such a kernel calls. This is what
//! every `unsafe` here relies on.

use std::arch::x86_64::{_CMP_LT_OQ, _CMP_ORD_Q, _CMP_UNORD_Q, _MM_FROUND_TO_NEG_INF};
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::real::{Real, Vector};

/// The bits of 1 and of the root of 1/2.
const ONE: i32 = 0x3f80_0000;
const ROOT_HALF: i32 = 0x3f35_04f3;
/// The bits of a mantissa, and the exponent of 1.
const MANTISSA: i32 = 0x7f_ffff;
const BIAS: i32 = 127;

/// Instructions of AVX-512 by names that both sets share.
mod avx512 {
    pub(super) use std::arch::x86_64::{
        __m512 as Register, _mm512_abs_ps as abs, _mm512_add_epi32 as add_int,
        _mm512_add_ps as add, _mm512_and_si512 as and_int, _mm512_castps_si512 as as_int,
        _mm512_castsi512_ps as as_float, _mm512_cmp_ps_mask as compare,
        _mm512_cvtepi32_ps as to_float, _mm512_div_ps as div, _mm512_loadu_ps as load,
        _mm512_mask_blend_ps as choose, _mm512_mul_ps as mul, _mm512_roundscale_ps as round,
        _mm512_set1_epi32 as splat_int, _mm512_set1_ps as splat, _mm512_sqrt_ps as sqrt,
        _mm512_srli_epi32 as shift, _mm512_storeu_ps as store, _mm512_sub_epi32 as sub_int,
        _mm512_sub_ps as sub, _mm512_xor_ps as xor,
    };
    use std::arch::x86_64::{_mm512_mask_max_ps, _mm512_mask_min_ps, _mm512_max_ps};

    use super::{_CMP_ORD_Q, _CMP_UNORD_Q};

    /// Numbers of a register.
    pub(super) const WIDTH: usize = 16;

    // The instruction has the second operand where either is NaN; where it is the first, that stays.
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(super) fn min(a: Register, b: Register) -> Register {
        _mm512_mask_min_ps(a, compare::<_CMP_ORD_Q>(a, a), a, b)
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(super) fn max(a: Register, b: Register) -> Register {
        _mm512_mask_max_ps(a, compare::<_CMP_ORD_Q>(a, a), a, b)
    }

    // The second operand stays where it is NaN, and of two zeros.
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(super) fn at_least(x: Register, low: Register) -> Register {
        _mm512_max_ps(low, x)
    }

    // Bounds rarely change, so that their comparison is done ahead of a loop.
    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(super) fn clamp(x: Register, low: Register, high: Register) -> Register {
        let bounded = compare::<_CMP_ORD_Q>(low, high);
        _mm512_mask_min_ps(splat(f32::NAN), bounded, high, _mm512_max_ps(low, x))
    }

    #[target_feature(enable = "avx512f")]
    #[inline]
    pub(super) fn nan_unless_ordered(a: Register, b: Register, x: Register) -> Register {
        choose(compare::<_CMP_UNORD_Q>(a, b), x, splat(f32::NAN))
    }
}

/// Instructions of AVX2 by the same names.
mod avx2 {
    pub(super) use std::arch::x86_64::{
        __m256 as Register, _mm256_add_epi32 as add_int, _mm256_add_ps as add,
        _mm256_and_si256 as and_int, _mm256_castps_si256 as as_int,
        _mm256_castsi256_ps as as_float, _mm256_cmp_ps as compare, _mm256_cvtepi32_ps as to_float,
        _mm256_div_ps as div, _mm256_loadu_ps as load, _mm256_mul_ps as mul,
        _mm256_round_ps as round, _mm256_set1_epi32 as splat_int, _mm256_set1_ps as splat,
        _mm256_sqrt_ps as sqrt, _mm256_srli_epi32 as shift, _mm256_storeu_ps as store,
        _mm256_sub_epi32 as sub_int, _mm256_sub_ps as sub, _mm256_xor_ps as xor,
    };
    use std::arch::x86_64::{
        _mm256_andnot_ps, _mm256_blendv_ps, _mm256_max_ps, _mm256_min_ps, _mm256_or_ps,
    };

    use super::_CMP_UNORD_Q;

    /// Numbers of a register.
    pub(super) const WIDTH: usize = 8;

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn abs(x: Register) -> Register {
        _mm256_andnot_ps(splat(-0.0), x)
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn choose(mask: Register, no: Register, yes: Register) -> Register {
        _mm256_blendv_ps(no, yes, mask)
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn min(a: Register, b: Register) -> Register {
        nan_unless_ordered(a, a, _mm256_min_ps(a, b))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn max(a: Register, b: Register) -> Register {
        nan_unless_ordered(a, a, _mm256_max_ps(a, b))
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn at_least(x: Register, low: Register) -> Register {
        _mm256_max_ps(low, x)
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn clamp(x: Register, low: Register, high: Register) -> Register {
        nan_unless_ordered(low, high, _mm256_min_ps(high, _mm256_max_ps(low, x)))
    }

    // All bits set are a NaN.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn nan_unless_ordered(a: Register, b: Register, x: Register) -> Register {
        _mm256_or_ps(compare::<_CMP_UNORD_Q>(a, b), x)
    }
}

/// The vector type of a set of instructions.
macro_rules! x86_vector {
    ($(#[$doc:meta])* $name:ident, $set:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name($set::Register);

        x86_vector!(@operator $name, Add, add, $set);
        x86_vector!(@operator $name, Sub, sub, $set);
        x86_vector!(@operator $name, Mul, mul, $set);
        x86_vector!(@operator $name, Div, div, $set);
        // Operations of their own where an instruction or two, or the bits, do what the formulas of
        // `Real` say. The smaller and the larger of two zeros are the second.
        impl Real for $name {
            x86_vector!(@same min, max: $set);
            x86_vector!(@own abs, sqrt: $set);
            #[inline(always)]
            fn lit(value: f32) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::splat(value) })
            }
            #[inline(always)]
            fn floor(self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::round::<_MM_FROUND_TO_NEG_INF>(self.0) })
            }
            #[inline(always)]
            fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
                let chosen = self.select_lt(rhs, yes, no);
                // SAFETY: see the top of this file.
                Self(unsafe { $set::nan_unless_ordered(self.0, rhs.0, chosen.0) })
            }
            #[inline(always)]
            fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe {
                    let less = $set::compare::<_CMP_LT_OQ>(self.0, rhs.0);
                    $set::choose(less, no.0, yes.0)
                })
            }
            #[inline(always)]
            fn at_least(self, low: Self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::at_least(self.0, low.0) })
            }
            #[inline(always)]
            fn clamp(self, low: Self, high: Self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::clamp(self.0, low.0, high.0) })
            }
            #[inline(always)]
            fn unit_parts(self) -> [Self; 2] {
                // SAFETY: see the top of this file.
                unsafe {
                    let bits = $set::add_int($set::as_int(self.0), $set::splat_int(ONE - ROOT_HALF));
                    let power = $set::sub_int($set::shift::<23>(bits), $set::splat_int(BIAS));
                    let rest = $set::and_int(bits, $set::splat_int(MANTISSA));
                    let mantissa = $set::add_int(rest, $set::splat_int(ROOT_HALF));
                    [Self($set::as_float(mantissa)), Self($set::to_float(power))]
                }
            }
        }

        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::xor(self.0, $set::splat(-0.0)) })
            }
        }

        impl Vector for $name {
            const WIDTH: usize = $set::WIDTH;

            #[inline(always)]
            fn load(numbers: &[f32]) -> Self {
                let numbers = numbers[..$set::WIDTH].as_ptr();
                // SAFETY: see the top of this file; there are as many numbers.
                Self(unsafe { $set::load(numbers) })
            }
            #[inline(always)]
            fn store(self, numbers: &mut [f32]) {
                let numbers = numbers[..$set::WIDTH].as_mut_ptr();
                // SAFETY: see the top of this file; there are as many numbers.
                unsafe { $set::store(numbers, self.0) }
            }
            #[inline(always)]
            fn each(self, one: impl Fn(f32) -> f32) -> Self {
                let mut numbers = [0.0; $set::WIDTH];
                self.store(&mut numbers);
                for number in &mut numbers {
                    *number = one(*number);
                }
                Self::load(&numbers)
            }
        }
    };
    (@operator $name:ident, $trait:ident, $method:ident, $set:ident) => {
        impl $trait for $name {
            type Output = Self;
            x86_vector!(@same $method: $set);
        }
    };
    (@same $($method:ident),*: $set:ident) => {
        $(
            #[inline(always)]
            fn $method(self, rhs: Self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::$method(self.0, rhs.0) })
            }
        )*
    };
    (@own $($method:ident),*: $set:ident) => {
        $(
            #[inline(always)]
            fn $method(self) -> Self {
                // SAFETY: see the top of this file.
                Self(unsafe { $set::$method(self.0) })
            }
        )*
    };
}

#[allow(unsafe_code, reason = "vector instructions behind a proof of their presence")]
mod vectors {
    use super::*;

    x86_vector!(
        /// 16 numbers of AVX-512.
        Vector512,
        avx512
    );
    x86_vector!(
        /// 8 numbers of AVX2.
        Vector256,
        avx2
    );
}
pub(super) use vectors::{Vector256, Vector512};
