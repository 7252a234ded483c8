//! The standard normal distribution in f64: what no library of the language has.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Beyond it the share is 1 in f64.
const FAR: f64 = 8.5;

/// The probability of a standard normal number within `|x|`, with the sign of `x`: `erf(x / sqrt(2))`. Relative
/// error below 1e-14.
pub(super) fn normal_share(x: f64) -> f64 {
    // Not at once, so that NaN goes on to the series.
    if x.abs() > FAR {
        return x.signum();
    }
    // sqrt(2 / pi) exp(-x^2 / 2) (x + x^3 / 3 + x^5 / 15 + ...): no term has another sign.
    let (mut term, mut sum, mut odd) = (x, x, 1.0);
    while term.abs() > f64::EPSILON * 0.01 * sum.abs() {
        odd += 2.0;
        term *= x * x / odd;
        sum += term;
    }
    sum * 2.0 * normal_density(x)
}

/// The density of the standard normal distribution.
pub(crate) fn normal_density(x: f64) -> f64 {
    (-0.5 * x * x).exp() * FRAC_1_SQRT_2 / PI.sqrt()
}

/// The probability of a standard normal number below `x`; absolute error below 1e-15.
pub(crate) fn normal(x: f64) -> f64 {
    0.5 + 0.5 * normal_share(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of tables.
    #[test]
    fn shares_are_those_of_tables() {
        let table = [
            (0.0, 0.0),
            (1e-9, 7.978_845_608_028_654e-10),
            (0.5, 0.382_924_922_548_026),
            (1.0, 0.682_689_492_137_085_9),
            (2.0, 0.954_499_736_103_641_6),
            (4.0, 0.999_936_657_516_333_8),
            (6.0, 0.999_999_998_026_824_7),
            (9.0, 1.0),
        ];
        for (x, share) in table {
            for sign in [1.0, -1.0] {
                let error = (normal_share(sign * x) - sign * share).abs();
                assert!(error <= 4e-16 + 1e-14 * share, "{x}: {error}");
            }
        }
        assert!(normal_share(f64::NAN).is_nan());
        assert_eq!(normal(f64::NEG_INFINITY), 0.0);
    }
}
