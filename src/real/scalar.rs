//! `Real` for f32 (the same bits as a lane) and f64 (the oracle, with the platform's functions).

use std::f64::consts::{PI, TAU};

use super::Real;
use super::approx::Exponent;
use super::normal::normal_share;

/// What both have of their own: the primitives, and choices that look for NaN no more often than needed.
macro_rules! primitives {
    ($float:ident) => {
        #[inline(always)]
        fn abs(self) -> Self {
            $float::abs(self)
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            $float::sqrt(self)
        }
        #[inline(always)]
        fn floor(self) -> Self {
            $float::floor(self)
        }
        #[inline(always)]
        fn if_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
            let chosen = self.select_lt(rhs, yes, no);
            if self.is_nan() || rhs.is_nan() { $float::NAN } else { chosen }
        }
        #[inline(always)]
        fn select_lt(self, rhs: Self, yes: Self, no: Self) -> Self {
            if self < rhs { yes } else { no }
        }
        #[inline(always)]
        fn min(self, rhs: Self) -> Self {
            if self < rhs || self.is_nan() { self } else { rhs }
        }
        #[inline(always)]
        fn max(self, rhs: Self) -> Self {
            if rhs < self || self.is_nan() { self } else { rhs }
        }
        #[inline(always)]
        fn at_least(self, low: Self) -> Self {
            if self < low { low } else { self }
        }
        #[inline(always)]
        fn clamp(self, low: Self, high: Self) -> Self {
            let floored = if self < low { low } else { self };
            let held = if high < floored { high } else { floored };
            if low.is_nan() || high.is_nan() { $float::NAN } else { held }
        }
    };
}

impl Real for f32 {
    primitives!(f32);
    #[inline(always)]
    fn lit(value: f32) -> Self {
        value
    }
}

impl Real for f64 {
    primitives!(f64);
    #[inline(always)]
    fn lit(value: f32) -> Self {
        f64::from(value)
    }
    fn hypot(self, rhs: Self) -> Self {
        // The platform's is infinite where one side is, whatever the other.
        self.if_lt(rhs, f64::hypot(self, rhs), f64::hypot(self, rhs))
    }
    fn powf(self, exponent: f32) -> Self {
        match Exponent::of(exponent) {
            Exponent::Whole(exponent) => Real::powi(self, exponent),
            Exponent::Root => f64::sqrt(self),
            // The platform has 1 for 1 to any power, and an infinity for powers of minus infinity.
            Exponent::Other if exponent.is_nan() || self < 0.0 => f64::NAN,
            Exponent::Other => f64::powf(self, f64::from(exponent)),
        }
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
    fn tan(self) -> Self {
        f64::tan(self)
    }
    fn asin(self) -> Self {
        f64::asin(self)
    }
    fn acos(self) -> Self {
        f64::acos(self)
    }
    fn atan(self) -> Self {
        f64::atan(self)
    }
    fn atan2(self, x: Self) -> Self {
        // A negative zero plus zero is zero: the sign of a zero decides nothing.
        f64::atan2(self + 0.0, x + 0.0)
    }
    fn wrap(self) -> Self {
        let wrapped = self - TAU * ((self + PI) / TAU).floor();
        // The quotient is rounded, so the difference may lie at the other end.
        let below = if wrapped < PI { wrapped } else { wrapped - TAU };
        if below < -PI { below + TAU } else { below }
    }
    fn exp(self) -> Self {
        f64::exp(self)
    }
    fn ln(self) -> Self {
        // The platform has minus infinity at 0.
        if self == 0.0 { f64::NAN } else { f64::ln(self) }
    }
    fn tanh(self) -> Self {
        f64::tanh(self)
    }
    fn sigmoid(self) -> Self {
        1.0 / (1.0 + f64::exp(-self))
    }
    fn exp_negative(self) -> Self {
        if self.is_nan() { 0.0 } else { f64::exp(self) }
    }
    fn exp_m1_negative(self) -> Self {
        // The smaller of two drops no NaN here.
        Real::min(self, 0.0).exp_m1()
    }
    fn softplus_excess(self) -> Self {
        f64::exp(-f64::abs(self)).ln_1p()
    }
    fn normal_share(self) -> Self {
        normal_share(self)
    }
    fn ln_unit(self) -> Self {
        f64::ln(self)
    }
}
