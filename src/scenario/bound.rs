//! Scenario counts and certified risks: how many samples a claim needs and what a count supports.
//!
//! `epsilon` is the risk, `beta` the chance that the sample misleads: both strictly between 0
//! and 1. Counts are exact up to rounding: a tail within 1e-11 (relative) of `beta` may go
//! either way.

use super::tail::{ln_at_least, ln_at_most, ln_term};
use crate::error::{Error, Result};

/// Counts above this are refused: beyond it an f64 no longer tells neighbours apart.
const MOST_SCENARIOS: f64 = 9_007_199_254_740_992.0;

/// What risks and shares are moved by to their safe side, relative: more than 40 times what the rounding
/// of their tails was seen to make.
const WIDENED: f64 = 1e-11;

/// Which bound a scenario count comes from, section 2 of `docs/method.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CountRule {
    /// [`simple_scenarios`].
    Simple,
    /// [`required_scenarios`].
    Exact,
}

impl CountRule {
    /// The scenarios that a claim needs.
    ///
    /// # Errors
    /// As [`simple_scenarios`].
    pub fn scenarios(self, epsilon: f64, beta: f64, decision_vars: u32) -> Result<u64> {
        match self {
            Self::Simple => simple_scenarios(epsilon, beta, decision_vars),
            Self::Exact => required_scenarios(epsilon, beta, decision_vars),
        }
    }
}

/// Scenarios by the simple bound `ceil((2 / epsilon) (ln(1 / beta) + d))`, Theorem 1 of the paper,
/// section 2 of `docs/method.md`.
///
/// ```
/// use reachcast::scenario::bound::simple_scenarios;
/// // The paper reports 158; the bound is 158.16, and a sample is whole.
/// assert_eq!(simple_scenarios(0.1, 1e-3, 1)?, 159);
/// # Ok::<(), reachcast::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if `epsilon` or `beta` is outside (0, 1), there is no decision variable, or
/// the count exceeds 2^53.
pub fn simple_scenarios(epsilon: f64, beta: f64, decision_vars: u32) -> Result<u64> {
    check_share("epsilon", epsilon)?;
    check_share("beta", beta)?;
    if decision_vars == 0 {
        return Err(Error::invalid("decision variables", "0; expected 1 or more"));
    }
    simple(epsilon, beta, f64::from(decision_vars))
}

/// Scenarios by the exact bound (Campi and Garatti 2008): the smallest N with
/// `sum over i < d of C(N, i) epsilon^i (1 - epsilon)^(N - i) <= beta`, section 2.
///
/// ```
/// use reachcast::scenario::bound::required_scenarios;
/// assert_eq!(required_scenarios(0.1, 1e-3, 1)?, 66);
/// assert_eq!(required_scenarios(1e-3, 1e-9, 1)?, 20_713);
/// # Ok::<(), reachcast::Error>(())
/// ```
///
/// # Errors
/// As [`simple_scenarios`].
pub fn required_scenarios(epsilon: f64, beta: f64, decision_vars: u32) -> Result<u64> {
    let most = simple_scenarios(epsilon, beta, decision_vars)?;
    let failures = f64::from(decision_vars) - 1.0;
    Ok(fewest(epsilon, beta, failures, most))
}

/// Trials of which at most `failures` may fail to support the risk `epsilon` (Clopper and Pearson
/// 1934): the smallest N with `P(Binomial(N, epsilon) <= failures) <= beta`, section 2.
///
/// The number of failures has to be fixed before the draw.
///
/// # Errors
/// [`Error::Invalid`] if `epsilon` or `beta` is outside (0, 1), or the count exceeds 2^53.
pub fn required_with_failures(epsilon: f64, beta: f64, failures: u64) -> Result<u64> {
    check_share("epsilon", epsilon)?;
    check_share("beta", beta)?;
    // The same tail as the scenario bound's, with failures + 1 for the decision variables.
    let most = simple(epsilon, beta, failures as f64 + 1.0)?;
    Ok(fewest(epsilon, beta, failures as f64, most))
}

/// The share of `beta` that each of `rounds` adaptive rounds may spend, `beta / rounds`: the union
/// bound that lets growth stop at its first clean round, section 8.2.
///
/// ```
/// use reachcast::scenario::bound::{per_round, required_scenarios};
/// assert_eq!(required_scenarios(0.1, per_round(1e-3, 5)?, 1)?, 81);
/// # Ok::<(), reachcast::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if `beta` is outside (0, 1) or there is no round.
pub fn per_round(beta: f64, rounds: u32) -> Result<f64> {
    check_share("beta", beta)?;
    if rounds == 0 {
        return Err(Error::invalid("rounds", "0; expected 1 or more"));
    }
    Ok(beta / f64::from(rounds))
}

/// Upper bound on the failure probability after `failures` of `scenarios` i.i.d. trials failed,
/// one-sided, wrong with probability at most `beta` (Clopper and Pearson 1934), section 2.
///
/// 1 where nothing is supported: no trial passed, or `beta` is outside (0, 1).
///
/// ```
/// use reachcast::scenario::bound::certified_risk;
/// assert!((certified_risk(158, 0, 1e-3) - 0.0428).abs() < 5e-5);
/// ```
pub fn certified_risk(scenarios: u64, failures: u64, beta: f64) -> f64 {
    if failures >= scenarios || !is_share(beta) {
        return 1.0;
    }
    let (n, k, ln_beta) = (scenarios as f64, failures as f64, beta.ln());
    let [_, above] = crossing(|p| ln_at_most(k, n, p) > ln_beta);
    raised(above)
}

/// Lower bound on the success probability after `successes` of `trials` i.i.d. trials succeeded,
/// one-sided, wrong with probability at most `beta`.
///
/// 0 where nothing is supported: no trial succeeded, or `beta` is outside (0, 1).
pub fn lower_bound(successes: u64, trials: u64, beta: f64) -> f64 {
    if successes == 0 || successes > trials || !is_share(beta) {
        return 0.0;
    }
    let (n, k, ln_beta) = (trials as f64, successes as f64, beta.ln());
    let [below, _] = crossing(|p| ln_at_least(k, n, p) < ln_beta);
    below * (1.0 - WIDENED)
}

/// Two-sided interval for a probability after `successes` of `trials` i.i.d. trials: `beta / 2` on
/// either side.
pub fn interval(successes: u64, trials: u64, beta: f64) -> (f64, f64) {
    let side = 0.5 * beta;
    (lower_bound(successes, trials, side), certified_risk(trials, successes, side))
}

/// Risk of a convex scenario program after the fact, from the number of support scenarios among
/// `scenarios` (Campi and Garatti 2018, "Wait-and-judge scenario optimization"), section 2.
///
/// The risk is `1 - t` for the t in (0, 1) with
/// `beta / (N + 1) sum over m = s..=N of C(m, s) t^(m - s) = C(N, s) t^(N - s)`.
/// The left sum counts the trials up to the (s + 1)-th failure, so with Y binomial over N + 1
/// trials of probability epsilon the equation reads
/// `P(Y = s + 1) / P(Y >= s + 1) = beta / (s + 1)`: the left side falls in epsilon, and no sum runs
/// over N.
///
/// 1 where nothing is supported: all scenarios support, or `beta` is outside (0, 1).
pub fn wait_and_judge(scenarios: u64, support: u64, beta: f64) -> f64 {
    if support >= scenarios || !is_share(beta) {
        return 1.0;
    }
    let (n, k) = (scenarios as f64 + 1.0, support as f64 + 1.0);
    let level = beta.ln() - k.ln();
    let [_, above] = crossing(|p| ln_term(k, n, p) - ln_at_least(k, n, p) > level);
    raised(above)
}

/// A risk on its safe side: above what its tail's own rounding may hide, at most 1.
fn raised(risk: f64) -> f64 {
    (risk * (1.0 + WIDENED)).min(1.0)
}

/// The simple bound for any number of decision variables, as a count.
fn simple(epsilon: f64, beta: f64, decision_vars: f64) -> Result<u64> {
    let count = ((2.0 / epsilon) * (decision_vars - beta.ln())).ceil();
    if count > MOST_SCENARIOS {
        let problem = format!("{epsilon} needs {count:e} scenarios; at most 2^53 are supported");
        return Err(Error::invalid("epsilon", problem));
    }
    Ok(count as u64)
}

/// The smallest N with `P(Binomial(N, epsilon) <= failures) <= beta`, known to be at most `most`.
fn fewest(epsilon: f64, beta: f64, failures: f64, most: u64) -> u64 {
    let ln_beta = beta.ln();
    // At N = failures the probability is 1; it falls with N.
    let (mut low, mut high) = (failures as u64, most);
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if ln_at_most(failures, middle as f64, epsilon) <= ln_beta {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// The neighbouring numbers in [0, 1] between which `holds` changes from true to false.
fn crossing(holds: impl Fn(f64) -> bool) -> [f64; 2] {
    let [mut low, mut high] = [0.0, 1.0];
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return [low, high];
        }
        *(if holds(middle) { &mut low } else { &mut high }) = middle;
    }
}

fn is_share(value: f64) -> bool {
    value > 0.0 && value < 1.0
}

fn check_share(name: &str, value: f64) -> Result<()> {
    if is_share(value) {
        Ok(())
    } else {
        let problem = format!("{value} is not strictly between 0 and 1");
        Err(Error::invalid(name, problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_counts() {
        let table = [
            (0.1, 1e-3, 1, 159, 66),
            (0.01, 1e-6, 1, 2964, 1375),
            (0.1, 1e-3, 31, 759, 501),
            (1e-3, 1e-9, 1, 43_447, 20_713),
            (0.1, 1e-3, 2, 179, 89),
            (0.05, 1e-6, 1, 593, 270),
            (0.03, 1e-10, 12, 2336, 1597),
        ];
        for (epsilon, beta, dim, simple, exact) in table {
            assert_eq!(simple_scenarios(epsilon, beta, dim).unwrap(), simple);
            assert_eq!(required_scenarios(epsilon, beta, dim).unwrap(), exact);
        }
        let rounds = |m| required_scenarios(0.1, per_round(1e-3, m).unwrap(), 1).unwrap();
        assert_eq!([1, 5, 10].map(rounds), [66, 81, 88]);
    }

    #[test]
    fn failures_cost_scenarios() {
        let counts = [0, 1, 2, 3, 4, 5].map(|k| required_with_failures(0.1, 1e-3, k).unwrap());
        assert_eq!(counts, [66, 89, 108, 126, 143, 159]);
        let risks = [0, 1, 2, 5].map(|k| (certified_risk(158, k, 1e-3) * 1e4).round());
        assert_eq!(risks, [428.0, 569.0, 690.0, 1004.0]);
    }

    #[test]
    fn support_scenarios_set_the_risk() {
        let risks = [1, 2, 3, 4, 5, 6].map(|s| (wait_and_judge(158, s, 1e-3) * 1e4).round());
        assert_eq!(risks, [723.0, 861.0, 986.0, 1102.0, 1213.0, 1319.0]);
    }

    /// The polynomial of the definition changes sign within 1e-9 of the root.
    #[test]
    fn wait_and_judge_solves_its_polynomial() {
        let positive = |n: i32, s: i32, beta: f64, t: f64| {
            // Both sides over C(n, s) t^(n - s), summed from m = n down.
            let (mut term, mut sum) = (1.0, 0.0);
            for m in (s..=n).rev() {
                sum += term;
                term *= f64::from(m - s) / f64::from(m) / t;
            }
            beta / f64::from(n + 1) * sum > 1.0
        };
        for (n, s, beta) in [(158, 0, 1e-3), (158, 6, 1e-3), (3, 2, 0.5), (2000, 40, 1e-9)] {
            let t = 1.0 - wait_and_judge(n as u64, s as u64, beta);
            assert!(positive(n, s, beta, t - 1e-9) && !positive(n, s, beta, t + 1e-9));
        }
        // Scales like 1 / N: a large N is as precise as a small one.
        let scaled = [1e6_f64, 1e12].map(|n| n * wait_and_judge(n as u64, 3, 1e-3));
        assert!((scaled[0] / scaled[1] - 1.0).abs() < 1e-4);
    }

    /// Whether `sum over i < d of C(n, i) a^i (b - a)^(n - i)` is below and at most `beta b^n`,
    /// for `beta = num / den`, in integers.
    fn admitted(n: u32, d: u32, [a, b]: [u128; 2], [num, den]: [u128; 2]) -> [bool; 2] {
        let (mut choose, mut sum) = (1, 0);
        for i in 0..d.min(n + 1) {
            sum += choose * a.pow(i) * (b - a).pow(n - i);
            choose = choose * u128::from(n - i) / u128::from(i + 1);
        }
        [sum * den < num * b.pow(n), sum * den <= num * b.pow(n)]
    }

    #[test]
    fn small_counts_are_exact() {
        for risk in [[1, 2], [1, 4], [5, 8], [3, 4], [7, 8]] {
            for share in [[1, 8], [3, 16], [1, 2], [7, 8], [1, 64]] {
                for dim in 1..=4 {
                    let smallest = |at| (1..).find(|&n| admitted(n, dim, risk, share)[at]);
                    let [epsilon, beta] = [risk, share].map(|[n, d]| n as f64 / d as f64);
                    let ours = required_scenarios(epsilon, beta, dim).unwrap() as u32;
                    // They differ only where a tail equals beta, which rounding may decide.
                    let [strict, exact] = [smallest(0), smallest(1)].map(Option::unwrap);
                    assert!(ours == exact || ours == strict, "{risk:?} {share:?} {dim}: {ours}");
                }
            }
        }
    }

    /// The count is where the tail crosses beta, also for tiny risks and many variables.
    #[test]
    fn extreme_counts_sit_at_the_crossing() {
        for (epsilon, beta, dim) in [(1e-9, 1e-12, 1), (1e-9, 1e-9, 5000), (0.5, 1e-300, 4000)] {
            let n = required_scenarios(epsilon, beta, dim).unwrap();
            assert!(n < simple_scenarios(epsilon, beta, dim).unwrap());
            let tail = |n: u64| ln_at_most(f64::from(dim) - 1.0, n as f64, epsilon);
            assert!(tail(n) <= beta.ln() && beta.ln() < tail(n - 1));
        }
        // One variable has the closed form ln beta / ln(1 - epsilon).
        let closed = ((1e-12_f64).ln() / (-1e-9_f64).ln_1p()).ceil() as u64;
        assert_eq!(required_scenarios(1e-9, 1e-12, 1).unwrap(), closed);
    }

    #[test]
    fn counts_and_risks_invert_each_other() {
        for k in [0, 3, 40] {
            for epsilon in [0.3, 0.01, 1e-4] {
                let n = required_with_failures(epsilon, 1e-6, k).unwrap();
                assert!(certified_risk(n, k, 1e-6) <= epsilon);
                assert!(certified_risk(n - 1, k, 1e-6) > epsilon);
            }
        }
    }

    #[test]
    fn intervals_mirror() {
        // R: binom.test(451, 500)$conf.int is 0.8725 to 0.9266.
        let (low, high) = interval(451, 500, 0.05);
        assert_eq!([low, high].map(|p| (p * 1e4).round()), [8725.0, 9266.0]);
        for (k, n) in [(0, 7), (7, 7), (3, 10), (1, 1_000_000)] {
            let (low, high) = interval(k, n, 1e-3);
            let (mirror_high, mirror_low) = interval(n - k, n, 1e-3);
            assert!(low <= k as f64 / n as f64 && k as f64 / n as f64 <= high);
            // Each end is moved outwards by its own share.
            assert!((low + mirror_low - 1.0).abs() < 1.1 * WIDENED);
            assert!((high + mirror_high - 1.0).abs() < 1.1 * WIDENED);
        }
        assert_eq!(interval(0, 0, 1e-3), (0.0, 1.0));
    }

    /// Where the exact number is known, it lies below by the share that risks are widened by.
    #[test]
    fn risks_lie_on_the_safe_side_of_the_exact_ones() {
        for n in [66_u64, 158, 1377, 20_000, 3_000_001] {
            for beta in [1e-3_f64, 0.05, 1e-9] {
                // Without a failure the risk is 1 - beta^(1/n).
                let exact = -(beta.ln() / n as f64).exp_m1();
                let (risk, share) = (certified_risk(n, 0, beta), lower_bound(n, n, beta));
                assert!(risk > exact * (1.0 + 0.5 * WIDENED), "{n} {beta}: {risk}, {exact}");
                assert!(risk < exact * (1.0 + 2.0 * WIDENED), "{n} {beta}: {risk}, {exact}");
                assert!(share < (1.0 - exact) * (1.0 - 0.5 * WIDENED), "{n} {beta}: {share}");
            }
        }
    }

    #[test]
    fn wrong_arguments_are_named() {
        for bad in [0.0, 1.0, -0.1, f64::NAN, f64::INFINITY] {
            let in_epsilon = required_scenarios(bad, 1e-3, 1).unwrap_err().to_string();
            assert!(in_epsilon.starts_with("epsilon: "), "{in_epsilon}");
            let in_beta = required_with_failures(0.1, bad, 1).unwrap_err().to_string();
            assert!(in_beta.starts_with("beta: "), "{in_beta}");
            assert!(per_round(bad, 5).is_err());
            assert_eq!(certified_risk(100, 0, bad), 1.0);
            assert_eq!(lower_bound(100, 100, bad), 0.0);
            assert_eq!(wait_and_judge(100, 1, bad), 1.0);
        }
        assert!(simple_scenarios(0.1, 1e-3, 0).is_err() && per_round(0.1, 0).is_err());
        assert!(required_scenarios(1e-17, 1e-3, 1).is_err());
        assert_eq!(certified_risk(10, 11, 0.1), 1.0);
    }
}
