//! Certificates repeated over thousands of samples: the share of false ones is at most beta.
//!
//! "False" is judged against a true risk that the certificate has no part in: a count over a stored pool that
//! its samples are drawn from with replacement, a large sample of another generator, quadrature, or a formula.
//! The number of false certificates among [`CERTIFICATES`] is compared with the exact binomial quantile, and
//! each rule is shown to matter: with the rule broken, the same harness reports a violation.

#[path = "../common/mod.rs"]
mod common;

mod balls;
mod calibration;
mod conditional;
mod deviation;
mod drops;
mod plants;
mod pools;
mod sequence;
mod sequential;
mod shrinking;
mod upward;

use common::binomial_limit;
use rand::SeedableRng;
use rand::rngs::StdRng;
use rayon::prelude::*;

/// Repetitions of each certificate.
const CERTIFICATES: u64 = 2000;
/// Risk that the certificates claim.
const EPSILON: f64 = 0.1;
/// Chance that each may be false.
const BETA: f64 = 0.05;

/// Whether `count` false certificates are more than a chance of [`BETA`] each explains.
fn violates(name: &str, count: u64) -> bool {
    let limit = binomial_limit(CERTIFICATES, BETA);
    println!("{name}: {count} of {CERTIFICATES} false, limit {limit}");
    count > limit
}

/// How many of the certificates are false; each has a generator of its own.
fn false_ones(is_false: impl Fn(&mut StdRng) -> bool + Sync) -> u64 {
    let one = |seed| is_false(&mut StdRng::seed_from_u64(seed));
    (0..CERTIFICATES).into_par_iter().filter(|seed| one(*seed)).count() as u64
}

/// A fivefold fault is far beyond the limit, and so is half as much again with all but certainty.
#[test]
fn a_fivefold_fault_is_seen() {
    let limit = binomial_limit(CERTIFICATES, BETA);
    let seen = |times: f64| 1.0 - binomial_below(limit, times * BETA);
    println!("limit {limit}; seen: {} at twice beta, {} at five times", seen(2.0), seen(5.0));
    assert!(seen(2.0) > 0.999 && seen(5.0) > 1.0 - 1e-12);
}

/// Chance of at most `limit` false certificates where each is with chance `chance`.
fn binomial_below(limit: u64, chance: f64) -> f64 {
    use statrs::distribution::{Binomial, DiscreteCDF};
    Binomial::new(chance, CERTIFICATES).expect("binomial").cdf(limit)
}
