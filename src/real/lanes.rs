//! SIMD lanes: a plain array that the compiler vectorises for whatever the caller enabled.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Real;

/// An array of length `$n` whose element `$i` is `$value`, filled in a plain loop.
///
/// Not `array::from_fn` or `map`: they are not always inlined, and outside of the
/// `#[target_feature]` function they would be compiled for the baseline instructions.
macro_rules! per_lane {
    ($n:expr, $i:ident => $value:expr) => {{
        let mut lanes = [Default::default(); $n];
        for $i in 0..$n {
            lanes[$i] = $value;
        }
        lanes
    }};
}
pub(crate) use per_lane;

/// `N` f32 numbers that go through the same formula side by side.
///
/// Every operation is inlined, so the instruction set is that of the `#[target_feature]`
/// function around it (`backend::cpu` picks one when it starts); the bits do not depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<const N: usize>(pub [f32; N]);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<const N: usize> $trait for Lanes<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, rhs: Self) -> Self {
                Self(per_lane!(N, i => self.0[i] $op rhs.0[i]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl<const N: usize> Neg for Lanes<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(per_lane!(N, i => -self.0[i]))
    }
}

impl<const N: usize> Real for Lanes<N> {
    #[inline(always)]
    fn lit(value: f32) -> Self {
        Self([value; N])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(per_lane!(N, i => self.0[i].abs()))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(per_lane!(N, i => self.0[i].sqrt()))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Self(per_lane!(N, i => self.0[i].floor()))
    }
    #[inline(always)]
    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        Self(per_lane!(N, i => Real::if_lt(self.0[i], rhs.0[i], yes.0[i], no.0[i])))
    }
    #[inline(always)]
    fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        Self(per_lane!(N, i => Real::select_lt(self.0[i], rhs.0[i], yes.0[i], no.0[i])))
    }
    #[inline(always)]
    fn min(self, rhs: Self) -> Self {
        Self(per_lane!(N, i => Real::min(self.0[i], rhs.0[i])))
    }
    #[inline(always)]
    fn max(self, rhs: Self) -> Self {
        Self(per_lane!(N, i => Real::max(self.0[i], rhs.0[i])))
    }
    #[inline(always)]
    fn at_least(self, low: Self) -> Self {
        Self(per_lane!(N, i => Real::at_least(self.0[i], low.0[i])))
    }
    #[inline(always)]
    fn clamp(self, low: Self, high: Self) -> Self {
        Self(per_lane!(N, i => Real::clamp(self.0[i], low.0[i], high.0[i])))
    }
}
