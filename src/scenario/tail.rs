//! Logarithms of binomial probabilities and tails, at full precision for any number of trials.
//!
//! A term is computed by its distance from the mean (Loader 2000, "Fast and accurate computation
//! of binomial probabilities"), a tail as the term at its edge times the sum of the ratios of
//! successive terms, which falls off within some standard deviations. Going through ln Gamma, as
//! libraries' incomplete beta functions do, subtracts numbers of size N ln N: for risk and beta of
//! 1e-9 and 5000 decision variables `statrs` asks for 1.1e8 scenarios of 5.4e12 too few.

use std::f64::consts::TAU;

/// Where a sum of falling terms stops, relative to the sum: with it the rest, at most the last
/// term times the number of terms so far, is below the rounding of the sum.
const NEGLIGIBLE: f64 = 1e-24;

/// `ln P(X = k)` for X binomial over `n` trials of probability `p`.
pub(super) fn ln_term(k: f64, n: f64, p: f64) -> f64 {
    let rest = n - k;
    if k == 0.0 {
        return n * (-p).ln_1p();
    }
    if rest == 0.0 {
        return n * p.ln();
    }
    let scale = -0.5 * (TAU * k * (rest / n)).ln();
    let stirling = stirling_error(n) - stirling_error(k) - stirling_error(rest);
    scale + stirling - deviance(k, n * p) - deviance(rest, n * (1.0 - p))
}

/// `ln P(X <= k)`.
pub(crate) fn ln_at_most(k: f64, n: f64, p: f64) -> f64 {
    if k >= n || p <= 0.0 {
        0.0
    } else if p >= 1.0 {
        f64::NEG_INFINITY
    } else if k < (n + 1.0) * p {
        falling_down(k, n, p)
    } else {
        ln_complement(falling_up(k + 1.0, n, p))
    }
}

/// `ln P(X >= k)`.
pub(super) fn ln_at_least(k: f64, n: f64, p: f64) -> f64 {
    if k <= 0.0 || p >= 1.0 {
        0.0
    } else if k > n || p <= 0.0 {
        f64::NEG_INFINITY
    } else if k > (n + 1.0) * p {
        falling_up(k, n, p)
    } else {
        ln_complement(falling_down(k - 1.0, n, p))
    }
}

/// `ln P(X <= k)` for k below the mode: terms fall toward 0.
fn falling_down(k: f64, n: f64, p: f64) -> f64 {
    let odds = (1.0 - p) / p;
    let (mut sum, mut term, mut i) = (1.0, 1.0, k);
    while i > 0.0 && term > NEGLIGIBLE * sum {
        term *= i / (n - i + 1.0) * odds;
        sum += term;
        i -= 1.0;
    }
    ln_term(k, n, p) + sum.ln()
}

/// `ln P(X >= k)` for k above the mode: terms fall toward n.
fn falling_up(k: f64, n: f64, p: f64) -> f64 {
    let odds = p / (1.0 - p);
    let (mut sum, mut term, mut i) = (1.0, 1.0, k);
    while i < n && term > NEGLIGIBLE * sum {
        term *= (n - i) / (i + 1.0) * odds;
        sum += term;
        i += 1.0;
    }
    ln_term(k, n, p) + sum.ln()
}

/// `ln(1 - e^x)` for x < 0.
fn ln_complement(x: f64) -> f64 {
    (-x.exp()).ln_1p()
}

/// What Stirling's formula leaves of ln n!: `ln n! - ((n + 1/2) ln n - n + ln(2 pi) / 2)`, n >= 1.
fn stirling_error(n: f64) -> f64 {
    if n <= 15.0 {
        let factorial: f64 = (2..=n as u32).map(f64::from).product();
        return factorial.ln() - ((n + 0.5) * n.ln() - n + 0.5 * TAU.ln());
    }
    let square = n * n;
    let tail = 1.0 / 1260.0 - (1.0 / 1680.0 - 1.0 / (1188.0 * square)) / square;
    (1.0 / 12.0 - (1.0 / 360.0 - tail / square) / square) / n
}

/// `x ln(x / mean) + mean - x`, without cancellation where x is near the mean.
fn deviance(x: f64, mean: f64) -> f64 {
    let ratio = (x - mean) / (x + mean);
    if ratio.abs() >= 0.1 {
        return x * (x / mean).ln() + mean - x;
    }
    // ln(x / mean) = 2 atanh(ratio); the first term of the series absorbs mean - x.
    let square = ratio * ratio;
    let (mut power, mut series, mut odd) = (square, 0.0, 3.0);
    while power > f64::EPSILON * square * 1e-3 {
        series += power / odd;
        power *= square;
        odd += 2.0;
    }
    (x - mean) * ratio + 2.0 * x * ratio * series
}

#[cfg(test)]
mod tests {
    use super::{ln_at_least, ln_at_most, ln_term};
    use statrs::function::beta::beta_reg;

    /// `ln P(X <= k)` as the sum of all its terms, each from sums of logarithms.
    fn direct(k: u32, n: u32, p: f64) -> f64 {
        let mut ln_term = f64::from(n) * (-p).ln_1p();
        let mut sum = 0.0;
        for i in 0..=k {
            sum += ln_term.exp();
            let odds = f64::from(n - i) / f64::from(i + 1) * p / (1.0 - p);
            ln_term += odds.ln();
        }
        sum.ln()
    }

    #[test]
    fn tails_match_the_sum_of_all_terms() {
        for n in [1, 2, 15, 16, 17, 66, 158, 700, 4000] {
            for p in [1e-4, 0.01, 0.1, 0.3, 0.5, 0.9] {
                for k in [0, 1, 2, 5, n / 10, n / 3, n / 2, n - 1] {
                    if k >= n || direct(k, n, p) < -600.0 {
                        continue;
                    }
                    let ours = ln_at_most(k.into(), n.into(), p);
                    // Each of up to n logarithms is rounded at size n ln n.
                    let error = 4e-16 * f64::from(n) * (1.0 + f64::from(n).ln());
                    let theirs = direct(k, n, p);
                    assert!(
                        (ours - theirs).abs() <= error.max(1e-15),
                        "n {n} p {p} k {k}: {ours} {theirs}"
                    );
                }
            }
        }
    }

    #[test]
    fn tails_match_the_incomplete_beta_function() {
        for (n, p) in [(158.0, 0.1), (1375.0, 0.01), (5000.0, 0.02), (43_447.0, 1e-3)] {
            for k in [1.0, 10.0, 40.0, 60.0] {
                let [below, above] =
                    [ln_at_most(k, n, p), ln_at_least(k + 1.0, n, p)].map(f64::exp);
                let theirs = beta_reg(k + 1.0, n - k, p);
                // Both tails are rounded; the library's carries ln Gamma's error, n ln n ulps.
                assert!((above - theirs).abs() <= 1e-16 * n * n.ln(), "n {n} k {k}");
                assert!((below + above - 1.0).abs() <= 4e-15, "n {n} k {k}");
            }
        }
    }

    /// The Poisson limit: `N p = 20` with N = 2e13 differs from it by a relative 1e-11.
    #[test]
    fn many_trials_keep_their_digits() {
        let (n, p, k) = (2e13, 1e-12, 3.0);
        let mean: f64 = n * p;
        let poisson = (mean.powi(3) / 6.0).ln() - mean;
        assert!((ln_term(k, n, p) - poisson).abs() < 1e-11);
        let tail = (1.0 + mean + mean * mean / 2.0 + mean.powi(3) / 6.0).ln() - mean;
        assert!((ln_at_most(k, n, p) - tail).abs() < 1e-11);
    }
}
