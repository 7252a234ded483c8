//! `Real` for f32 (the same bits as a lane) and f64 (the oracle, with the platform's functions).

use super::Real;

impl Real for f32 {
    #[inline(always)]
    fn lit(value: f32) -> Self {
        value
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f32::abs(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        f32::floor(self)
    }
    #[inline(always)]
    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        if self < rhs { yes } else { no }
    }
}

impl Real for f64 {
    #[inline(always)]
    fn lit(value: f32) -> Self {
        f64::from(value)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn floor(self) -> Self {
        f64::floor(self)
    }
    #[inline(always)]
    fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
        if self < rhs { yes } else { no }
    }
    fn hypot(self, rhs: Self) -> Self {
        f64::hypot(self, rhs)
    }
    fn sin(self) -> Self {
        f64::sin(self)
    }
    fn cos(self) -> Self {
        f64::cos(self)
    }
    fn principal_sin_cos(self) -> [Self; 2] {
        self.sin_cos().into()
    }
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
    fn exp_negative(self) -> Self {
        f64::exp(self)
    }
    fn ln_unit(self) -> Self {
        f64::ln(self)
    }
}
