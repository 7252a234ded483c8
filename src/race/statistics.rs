//! Comparison of controllers: intervals, and paired tests on the same starts.

use super::difference;
use super::judge::{FailureClass, Judge};
use super::record::{FailureRecord, JudgedRecord, PairedRecord, PublishedRecord};
use crate::scenario::bound::interval;
use crate::scenario::tail::ln_at_most;

/// One minus the confidence of every interval.
const BETA: f64 = 0.05;
/// Quantile of the standard normal distribution at 1 - BETA / 2.
const NORMAL_QUANTILE: f64 = 1.959_963_984_540_054;
/// Races of each published rate.
const PUBLISHED_RACES: u64 = 500;
/// Successes in percent of the published races, by the name of the controller.
const PUBLISHED_PERCENT: [(&str, f64); 8] = [
    ("hybrid", 90.2),
    ("hybrid-no-policy", 68.4),
    ("mppi", 63.4),
    ("mppi-soft", 63.2),
    ("mppi-warmstart", 62.8),
    ("mppi-cbf", 62.4),
    ("policy", 51.8),
    ("ppo-cbf", 14.2),
];

/// Verdicts of one judge on one controller, `[seeds, starts]`; `None` for a success.
pub type Verdicts = [Vec<Option<FailureClass>>];

/// Exact two-sided p-value of McNemar's test: the pairs that differ fall either way with
/// probability 1/2, so it is twice the smaller tail of Binomial(n, 1/2), at most 1; 1 for n = 0.
pub fn mcnemar(only_this: u64, only_other: u64) -> f64 {
    let (fewer, pairs) = (only_this.min(only_other), only_this + only_other);
    // Within one of the middle the two tails meet, rounding aside.
    if 2 * fewer + 1 >= pairs {
        return 1.0;
    }
    (2.0 * ln_at_most(fewer as f64, pairs as f64, 0.5).exp()).min(1.0)
}

/// The paired comparison of two controllers on the same starts and seeds.
///
/// # Panics
/// If there is no race, or the two did not run the same starts with as many seeds.
pub fn paired(this: &Verdicts, other: &Verdicts) -> PairedRecord {
    let starts = this[0].len();
    let same =
        this.iter().chain(other).all(|seed| seed.len() == starts) && this.len() == other.len();
    assert!(starts > 0 && same, "races were run, and from the same starts");
    let wins = |a: &Verdicts, b: &Verdicts| -> Vec<u64> {
        let of = |(a, b): (&Vec<Option<FailureClass>>, &Vec<Option<FailureClass>>)| {
            a.iter().zip(b).filter(|(a, b)| a.is_none() && b.is_some()).count() as u64
        };
        a.iter().zip(b).map(of).collect()
    };
    let both = [wins(this, other), wins(other, this)];
    let [only_this, only_other] = both.each_ref().map(|seeds| seeds[0]);
    let means = both.map(|seeds| seeds.iter().sum::<u64>() as f64 / seeds.len() as f64);
    let starts = starts as f64;
    PairedRecord {
        only_this,
        only_other,
        p_value: mcnemar(only_this, only_other),
        difference: (means[0] - means[1]) / starts,
        interval: difference::interval(means[0], means[1], starts, NORMAL_QUANTILE),
    }
}

/// What is stored of the verdicts of one judge on one controller; `hybrid` are those of the
/// hybrid controller, none for itself or where it did not run.
///
/// # Panics
/// If there is no race, or the two did not run the same starts with as many seeds.
pub fn judged(
    judge: Judge,
    controller: &str,
    verdicts: &Verdicts,
    hybrid: Option<&Verdicts>,
) -> JudgedRecord {
    let starts = verdicts[0].len();
    assert!(starts > 0 && verdicts.iter().all(|seed| seed.len() == starts), "races were run");
    let won = |seed: &Vec<Option<FailureClass>>| seed.iter().filter(|v| v.is_none()).count() as u64;
    let successes: Vec<u64> = verdicts.iter().map(won).collect();
    let rates: Vec<f64> = successes.iter().map(|&n| n as f64 / starts as f64).collect();
    JudgedRecord {
        judge,
        rate: mean(&rates),
        interval: interval(successes[0], starts as u64, BETA).into(),
        spread: sample_deviation(&rates),
        failures: failures(verdicts),
        published: published(controller).filter(|_| judge == Judge::Study),
        against_hybrid: hybrid.map(|hybrid| paired(verdicts, hybrid)),
        successes,
    }
}

/// What the study published for a controller, under its own judge; the interval is computed.
pub fn published(controller: &str) -> Option<PublishedRecord> {
    let (_, percent) = PUBLISHED_PERCENT.iter().find(|(name, _)| *name == controller)?;
    let rate = percent / 100.0;
    let successes = (PUBLISHED_RACES as f64 * rate).round() as u64;
    Some(PublishedRecord { rate, interval: interval(successes, PUBLISHED_RACES, BETA).into() })
}

/// How often each class occurs, over all seeds; every class, in order.
fn failures(verdicts: &Verdicts) -> Vec<FailureRecord> {
    let count = |class| verdicts.iter().flatten().filter(|v| **v == Some(class)).count() as u64;
    FailureClass::ALL.map(|class| FailureRecord { class, count: count(class) }).into()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The sample standard deviation; `None` of fewer than two values.
fn sample_deviation(values: &[f64]) -> Option<f64> {
    let mean = mean(values);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, Normal};

    /// A success for `1`, a timeout for `0`, a collision for `c`.
    fn seed(pattern: &str) -> Vec<Option<FailureClass>> {
        let verdict = |c| match c {
            '1' => None,
            'c' => Some(FailureClass::Collision),
            _ => Some(FailureClass::Timeout),
        };
        pattern.chars().map(verdict).collect()
    }

    #[test]
    fn mcnemar_is_the_binomial_test() {
        // R: binom.test(3, 10)$p.value is 0.34375, binom.test(1, 8) 0.0703125.
        assert!((mcnemar(3, 7) - 0.343_75).abs() < 1e-14);
        assert!((mcnemar(7, 1) - 0.070_312_5).abs() < 1e-14);
        assert_eq!([mcnemar(0, 0), mcnemar(4, 4), mcnemar(4, 5)], [1.0; 3]);
        assert_eq!(mcnemar(0, 1), 1.0);
        for (b, c) in [(0, 5), (2, 3), (12, 40), (100, 151), (31, 165)] {
            let pairs = Binomial::new(0.5, b + c).unwrap();
            let expected = (2.0 * pairs.cdf(b.min(c))).min(1.0);
            for p in [mcnemar(b, c), mcnemar(c, b)] {
                assert!((p / expected - 1.0).abs() < 1e-9, "{b} {c}: {p}, {expected}");
            }
        }
    }

    #[test]
    fn published_intervals_are_the_printed_ones() {
        let printed = [
            ("hybrid", [87.3, 92.7]),
            ("hybrid-no-policy", [64.1, 72.5]),
            ("mppi", [59.0, 67.6]),
            ("mppi-soft", [58.8, 67.4]),
            ("mppi-warmstart", [58.4, 67.1]),
            ("mppi-cbf", [58.0, 66.7]),
            ("policy", [47.3, 56.3]),
            ("ppo-cbf", [11.3, 17.6]),
        ];
        assert_eq!(printed.len(), PUBLISHED_PERCENT.len());
        for (name, expected) in printed {
            // The printed figures were rounded twice: an end at 67.04997 stands as 67.1.
            let twice = |p: f64| ((p * 1e4).round() / 10.0).round() / 10.0;
            let computed = published(name).unwrap().interval.map(twice);
            assert_eq!(computed, expected, "{name}");
        }
        assert_eq!(published("hybrid").unwrap().rate, 0.902);
        assert_eq!(published("nobody"), None);
    }

    #[test]
    fn pairs_by_hand() {
        let this = [seed("1110c"), seed("11000")];
        let other = [seed("10011"), seed("10000")];
        let record = paired(&this, &other);
        assert_eq!((record.only_this, record.only_other), (2, 2));
        assert_eq!(record.p_value, 1.0);
        // Of five starts this one alone won 2 and 1, the other alone 2 and 0: means of 1.5 and 1.
        assert!((record.difference - 0.1).abs() < 1e-15);
        let z = Normal::standard().inverse_cdf(0.975);
        assert!((z - NORMAL_QUANTILE).abs() < 1e-9);
        assert_eq!(record.interval, difference::interval(1.5, 1.0, 5.0, NORMAL_QUANTILE));
        let mirrored = paired(&other, &this);
        assert!((mirrored.interval[0] + record.interval[1]).abs() < 1e-9);
    }

    #[test]
    fn a_single_start_leaves_the_difference_open() {
        let record = paired(&[seed("1")], &[seed("0")]);
        assert_eq!(record.difference, 1.0);
        assert!(record.interval[0] < -0.5 && record.interval[1] == 1.0, "{record:?}");
    }

    #[test]
    fn record_of_the_verdicts() {
        let verdicts = [seed("1110c"), seed("11c0c"), seed("00000")];
        let record = judged(
            Judge::Study,
            "mppi",
            &verdicts,
            Some(&[seed("11111"), seed("11111"), seed("11111")]),
        );
        assert_eq!(record.successes, [3, 2, 0]);
        assert!((record.rate - 1.0 / 3.0).abs() < 1e-15);
        // Rates 0.6, 0.4, 0: squared distances from 1/3 sum to 14/75.
        assert!((record.spread.unwrap() - (7.0_f64 / 75.0).sqrt()).abs() < 1e-15);
        // R: binom.test(3, 5)$conf.int is 0.1466 to 0.9473.
        assert_eq!(record.interval.map(|p| (p * 1e4).round()), [1466.0, 9473.0]);
        let failed: Vec<_> = record.failures.iter().map(|f| (f.class, f.count)).collect();
        assert_eq!(failed.len(), FailureClass::ALL.len());
        assert!(failed.contains(&(FailureClass::Collision, 3)));
        assert!(failed.contains(&(FailureClass::Timeout, 7)));
        assert!(failed.contains(&(FailureClass::Fence, 0)));
        assert_eq!(record.published, published("mppi"));
        assert_eq!(record.against_hybrid.map(|p| p.only_other), Some(2));
        let alone = judged(Judge::Paper, "mppi", &verdicts[..1], None);
        assert_eq!((alone.spread, alone.published), (None, None));
        assert_eq!(alone.against_hybrid, None);
    }
}
