//! Evidence that grows start by start: an e-process against a risk that is too large.
//!
//! For q below epsilon, a failure multiplies the bet on q by `q / epsilon` and a success by
//! `(1 - q) / (1 - epsilon)`. Where the risk is epsilon or more, no start raises the bet on average, and
//! neither does it raise a mixture of bets; so by Ville's inequality the mixture ever reaches `1 / beta`
//! with probability at most beta, whenever one looks and whenever one stops.

/// The mixture's first parameter: weight near 0, where good policies are.
const FIRST: f64 = 0.3;
/// Its second parameter times epsilon: half of the weight lies below a fifteenth of epsilon.
const SECOND: f64 = 3.0;
/// Beyond this a sum is scaled down.
const LARGE: f64 = 1e200;

/// The mixture over q in (0, epsilon) with density in proportion to `q^(a - 1) (1 - q)^(b - 1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    epsilon: f64,
    a: f64,
    b: f64,
}

impl Evidence {
    /// Evidence against a risk of `epsilon` or more, in (0, 1).
    pub fn new(epsilon: f64) -> Self {
        Self { epsilon, a: FIRST, b: SECOND / epsilon }
    }

    /// The parameters a and b of the mixture.
    pub fn parameters(&self) -> [f64; 2] {
        [self.a, self.b]
    }

    /// Natural logarithm of the e-process after `failures` of `starts`.
    ///
    /// With `B(x; a, b) = x^a (1 - x)^b / a (1 + sum over j >= 1 of product over i < j of
    /// (a + b + i) / (a + 1 + i) x)` the powers of epsilon and `1 - epsilon` cancel against those of the
    /// bets, and what is left is a ratio of two sums of positive terms.
    pub fn ln_e(&self, failures: u64, starts: u64) -> f64 {
        let (k, n) = (failures as f64, starts as f64);
        let part = |k: f64, n: f64| {
            ln_sum(self.a + k, self.a + self.b + n, self.epsilon) - (self.a + k).ln()
        };
        part(k, n) - part(0.0, 0.0)
    }

    /// Natural logarithm of the bet on a risk well above epsilon, as far above it as 0 is below or half way
    /// to 1: an e-process against a risk of epsilon or less.
    pub fn ln_against(&self, failures: u64, starts: u64) -> f64 {
        let above = self.epsilon + self.epsilon.min(0.5 * (1.0 - self.epsilon));
        let (k, n) = (failures as f64, starts as f64);
        k * (above / self.epsilon).ln() + (n - k) * ((1.0 - above) / (1.0 - self.epsilon)).ln()
    }
}

/// `ln(1 + sum over j >= 1 of product over i < j of (c + i) / (a + 1 + i) x)`.
fn ln_sum(a: f64, c: f64, x: f64) -> f64 {
    let (mut sum, mut term, mut offset, mut i) = (1.0, 1.0, 0.0, 0.0);
    loop {
        let ratio = (c + i) / (a + 1.0 + i) * x;
        term *= ratio;
        sum += term;
        i += 1.0;
        if sum > LARGE {
            (sum, term, offset) = (sum / LARGE, term / LARGE, offset + LARGE.ln());
        }
        // Ratios fall toward x: the rest is at most a geometric sum.
        let rest = term * ratio / (1.0 - ratio);
        if ratio < 1.0 && rest < 1e-17 * sum {
            return offset + sum.ln();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By Simpson's rule after `q = epsilon u^(1/a)`, which takes the pole at 0 away.
    fn quadrature(evidence: Evidence, failures: u64, starts: u64) -> f64 {
        let Evidence { epsilon, a, b } = evidence;
        let (k, n) = (failures as f64, starts as f64);
        let nodes = 400_000;
        // The logarithm, since bets leave the range of numbers.
        let integral = |bet: &dyn Fn(f64) -> f64| {
            let value = |i: usize| {
                let q = epsilon * (i as f64 / nodes as f64).powf(1.0 / a);
                (b - 1.0) * (-q).ln_1p() + bet(q)
            };
            let weight = |i: usize| match i {
                0 => 1.0,
                last if last == nodes => 1.0,
                odd if odd % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let values: Vec<f64> = (0..=nodes).map(value).collect();
            let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let scaled = values.iter().enumerate().map(|(i, x)| weight(i) * (x - largest).exp());
            largest + scaled.sum::<f64>().ln()
        };
        let failed = |q: f64| if failures == 0 { 0.0 } else { k * (q / epsilon).ln() };
        let bet = |q: f64| failed(q) + (n - k) * ((1.0 - q) / (1.0 - epsilon)).ln();
        integral(&bet) - integral(&|_| 0.0)
    }

    #[test]
    fn the_closed_form_is_the_integral() {
        for epsilon in [0.1, 0.01, 0.5] {
            for (k, n) in
                [(0, 0), (0, 1), (1, 1), (0, 70), (3, 150), (12, 100), (40, 400), (5, 3000)]
            {
                let evidence = Evidence::new(epsilon);
                let (ours, theirs) = (evidence.ln_e(k, n), quadrature(evidence, k, n));
                assert!(
                    (ours - theirs).abs() < 1e-6 * theirs.abs().max(1.0),
                    "{epsilon} {k} {n}: {ours} {theirs}"
                );
            }
        }
        assert_eq!(Evidence::new(0.1).ln_e(0, 0), 0.0);
        // Far beyond the range of numbers: the bets on q near 0 alone are about 0.9^-n.
        let far = Evidence::new(0.1).ln_e(0, 1_000_000);
        assert!((far / (-1e6 * (0.9_f64).ln()) - 1.0).abs() < 1e-3, "{far}");
    }

    /// At a risk of epsilon the mean over the next start is what it was, below it grows.
    #[test]
    fn no_start_raises_it_on_average_where_the_risk_is_epsilon() {
        for epsilon in [0.1, 0.003, 0.6] {
            for (k, n) in [(0, 0), (0, 50), (7, 60), (200, 2000)] {
                let evidence = Evidence::new(epsilon);
                let mean = |p: f64, ln: &dyn Fn(u64, u64) -> f64| {
                    let grown = |failures| (ln(failures, n + 1) - ln(k, n)).exp();
                    p * grown(k + 1) + (1.0 - p) * grown(k)
                };
                let ours = |k: u64, n: u64| evidence.ln_e(k, n);
                let against = |k: u64, n: u64| evidence.ln_against(k, n);
                assert!((mean(epsilon, &ours) - 1.0).abs() < 1e-9, "{epsilon} {k} {n}");
                assert!((mean(epsilon, &against) - 1.0).abs() < 1e-9, "{epsilon} {k} {n}");
                assert!(mean(0.5 * epsilon, &ours) > 1.0 && mean(1.5 * epsilon, &ours) < 1.0);
                assert!(mean(1.5 * epsilon, &against) > 1.0 && mean(0.5 * epsilon, &against) < 1.0);
            }
        }
    }

    /// Starts until the claim of risk 0.1 and beta 1e-3 holds, on average, without sampling.
    #[test]
    fn good_policies_need_few_starts() {
        let evidence = Evidence::new(0.1);
        let needed = |p: f64| {
            let (mut open, mut mean) = (vec![1.0], 0.0);
            for n in 1..=1500_u64 {
                let mut next = vec![0.0; open.len() + 1];
                for (k, share) in open.iter().enumerate() {
                    next[k] += share * (1.0 - p);
                    next[k + 1] += share * p;
                }
                let most = next.len().min(80);
                next.truncate(most);
                for (k, share) in next.iter_mut().enumerate() {
                    if *share > 0.0 && evidence.ln_e(k as u64, n) >= -(1e-3_f64).ln() {
                        mean += n as f64 * *share;
                        *share = 0.0;
                    }
                }
                open = next;
            }
            mean
        };
        // A fixed sample of 159 without failure has power 1, .20 and .04 there.
        for (p, most) in [(0.0, 70.0), (0.01, 103.0), (0.02, 149.0)] {
            let mean = needed(p);
            println!("true risk {p}: {mean:.1} starts");
            assert!(mean <= most && mean > 60.0, "{p}: {mean}");
        }
    }
}
