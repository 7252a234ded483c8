//! Timing of repeated calls: warm-up, repetitions, median and spread.

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::error::Result;

/// Most calls that are timed: enough for any quantile that is reported.
const MOST_CALLS: usize = 10_000;

/// How long a workload is repeated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Calls are not counted until this has passed, s. A call that alone takes longer than
    /// `budget_seconds` is counted all the same: it has warmed up on its own.
    #[serde(with = "crate::files::number")]
    pub warm_up_seconds: f64,
    /// Calls are repeated until this has passed, s.
    #[serde(with = "crate::files::number")]
    pub budget_seconds: f64,
    /// Fewest calls that are counted.
    pub least_calls: usize,
}

impl Protocol {
    /// For figures that are to be quoted.
    pub const FULL: Self = Self { warm_up_seconds: 0.3, budget_seconds: 2.0, least_calls: 3 };
    /// For a first look.
    pub const QUICK: Self = Self { warm_up_seconds: 0.05, budget_seconds: 0.2, least_calls: 1 };
}

/// The times of the calls that were counted, s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// How many there were.
    pub calls: usize,
    /// The median.
    #[serde(with = "crate::files::number")]
    pub median_seconds: f64,
    /// The shortest.
    #[serde(with = "crate::files::number")]
    pub best_seconds: f64,
    /// One in ten took no longer.
    #[serde(with = "crate::files::number")]
    pub p10_seconds: f64,
    /// One in ten took no less.
    #[serde(with = "crate::files::number")]
    pub p90_seconds: f64,
}

impl Timing {
    /// Summary of `seconds`, in any order.
    ///
    /// # Panics
    /// If there are none.
    pub fn of(mut seconds: Vec<f64>) -> Self {
        seconds.sort_by(f64::total_cmp);
        Self {
            calls: seconds.len(),
            median_seconds: quantile(&seconds, 0.5),
            best_seconds: seconds[0],
            p10_seconds: quantile(&seconds, 0.1),
            p90_seconds: quantile(&seconds, 0.9),
        }
    }
}

/// Times `call` as `protocol` says.
///
/// # Errors
/// The first of a call.
pub fn measure(protocol: &Protocol, mut call: impl FnMut() -> Result<()>) -> Result<Timing> {
    let Protocol { warm_up_seconds, budget_seconds, least_calls } = *protocol;
    let (mut warm, mut spent, mut counted) = (0.0, 0.0, Vec::new());
    while counted.len() < least_calls.max(1) || spent < budget_seconds {
        let begun = Instant::now();
        call()?;
        let seconds = begun.elapsed().as_secs_f64();
        if warm < warm_up_seconds && seconds < budget_seconds {
            warm += seconds;
            continue;
        }
        spent += seconds;
        counted.push(seconds);
        if counted.len() == MOST_CALLS {
            break;
        }
    }
    Ok(Timing::of(counted))
}

/// The quantile at `share` of `sorted` numbers, linear between neighbours.
///
/// # Panics
/// If there are none.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + part * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours() {
        let sorted = [1.0, 2.0, 4.0, 8.0, 16.0];
        let of = |share| quantile(&sorted, share);
        assert_eq!([of(0.0), of(0.25), of(0.5), of(1.0)], [1.0, 2.0, 4.0, 16.0]);
        assert!((of(0.1) - 1.4).abs() < 1e-12);
        assert!((of(0.9) - 12.8).abs() < 1e-12);
        assert_eq!(quantile(&[3.0], 0.9), 3.0);
    }

    #[test]
    fn a_summary_sorts() {
        let timing = Timing::of(vec![3.0, 1.0, 2.0]);
        assert_eq!((timing.calls, timing.best_seconds, timing.median_seconds), (3, 1.0, 2.0));
        assert!(timing.p10_seconds < timing.median_seconds);
        assert!(timing.p90_seconds > timing.median_seconds);
    }

    #[test]
    fn calls_of_the_warm_up_are_not_counted() {
        let (mut calls, pause) = (0, std::time::Duration::from_millis(2));
        let protocol = Protocol { warm_up_seconds: 0.01, budget_seconds: 0.02, least_calls: 4 };
        let timing = measure(&protocol, || {
            calls += 1;
            std::thread::sleep(pause);
            Ok(())
        });
        let timing = timing.unwrap();
        assert!(timing.calls >= 4 && timing.calls < calls, "{} of {calls}", timing.calls);
    }

    #[test]
    fn a_call_longer_than_the_budget_is_counted_at_once() {
        let mut calls = 0;
        let protocol = Protocol { warm_up_seconds: 1.0, budget_seconds: 1e-4, least_calls: 2 };
        let timing = measure(&protocol, || {
            calls += 1;
            std::thread::sleep(std::time::Duration::from_millis(2));
            Ok(())
        });
        assert_eq!((timing.unwrap().calls, calls), (2, 2));
    }

    #[test]
    fn the_first_error_ends_it() {
        let refused = || crate::Error::invalid("call", "refused");
        assert!(measure(&Protocol::QUICK, || Err(refused())).is_err());
    }
}
