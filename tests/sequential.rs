//! Sequential claims repeated over thousands of seeds: looked at after every start, the share of false ones
//! is at most beta, where Clopper and Pearson's bound looked at in the same way is false far more often.

mod common;

use common::binomial_limit;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::scenario::bound::certified_risk;
use reachcast::scenario::evidence::Evidence;

/// Repetitions.
const SEEDS: u64 = 4000;
/// Starts after which a repetition ends.
const MOST: u64 = 2000;
/// Risk that is claimed.
const EPSILON: f64 = 0.1;
/// True risk just above it.
const ABOVE: f64 = 1.01 * EPSILON;
/// Chance that a claim may be false.
const BETA: f64 = 0.05;

/// The start after which `holds` says of failures and starts that the claim holds, of a true risk.
fn stopped(seed: u64, risk: f64, holds: impl Fn(u64, u64) -> bool) -> Option<u64> {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut failures = 0;
    (1..=MOST).find(|&starts| {
        failures += u64::from(rng.random_bool(risk));
        holds(failures, starts)
    })
}

/// `holds` for every count of starts and failures that comes up, computed once.
fn table(holds: impl Fn(u64, u64) -> bool) -> impl Fn(u64, u64) -> bool {
    // With n starts the claim holds up to a number of failures that never falls with n.
    let mut most: Vec<Option<u64>> = vec![None];
    for starts in 1..=MOST {
        let mut allowed = most[starts as usize - 1];
        while holds(allowed.map_or(0, |allowed| allowed + 1), starts) {
            allowed = Some(allowed.map_or(0, |allowed| allowed + 1));
        }
        most.push(allowed);
    }
    move |failures, starts| most[starts as usize].is_some_and(|allowed| failures <= allowed)
}

fn false_claims(name: &str, holds: impl Fn(u64, u64) -> bool) -> u64 {
    let holds = table(holds);
    let count = (0..SEEDS).filter(|seed| stopped(*seed, ABOVE, &holds).is_some()).count() as u64;
    println!("{name}: {count} of {SEEDS} false, limit {}", binomial_limit(SEEDS, BETA));
    count
}

#[test]
fn claims_are_false_at_most_as_often_as_claimed_whenever_one_looks() {
    let evidence = Evidence::new(EPSILON);
    let limit = binomial_limit(SEEDS, BETA);
    let ours = |k: u64, n: u64| k <= n && evidence.ln_e(k, n) >= -BETA.ln();
    assert!(false_claims("evidence", ours) <= limit);
    // A threshold of twice beta's is noticed too.
    let lax = |k: u64, n: u64| k <= n && evidence.ln_e(k, n) >= -(4.0 * BETA).ln();
    assert!(false_claims("evidence, four times beta", lax) > limit);
    let fixed = |k: u64, n: u64| k <= n && certified_risk(n, k, BETA) <= EPSILON;
    assert!(false_claims("Clopper-Pearson after every start", fixed) > limit);
}

/// Attempts one after the other whose evidence is multiplied: the product is evidence, failed ones included.
#[test]
fn products_of_all_attempts_are_evidence() {
    let evidence = Evidence::new(EPSILON);
    let mut rng = StdRng::seed_from_u64(1);
    let mut count = 0;
    for _ in 0..SEEDS {
        let mut carried = 0.0;
        // Five attempts of 60 starts; each goes on from what those before it came to.
        let reached = (0..5).any(|_| {
            let mut failures = 0;
            let before = carried;
            (1..=60).any(|starts| {
                failures += u64::from(rng.random_bool(ABOVE));
                carried = before + evidence.ln_e(failures, starts);
                carried >= -BETA.ln()
            })
        });
        count += u64::from(reached);
    }
    let limit = binomial_limit(SEEDS, BETA);
    println!("products: {count} of {SEEDS} false, limit {limit}");
    assert!(count <= limit);
}

/// The starts that good policies need, by simulation.
#[test]
fn good_policies_need_few_starts() {
    let evidence = Evidence::new(EPSILON);
    let holds = table(|k, n| k <= n && evidence.ln_e(k, n) >= -(1e-3_f64).ln());
    for (risk, most) in [(0.0, 70.0), (0.01, 103.0), (0.02, 149.0)] {
        let starts = (0..SEEDS).map(|seed| stopped(seed, risk, &holds).expect("a claim") as f64);
        let starts: Vec<f64> = starts.collect();
        let mean = starts.iter().sum::<f64>() / SEEDS as f64;
        let square = starts.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / SEEDS as f64;
        let error = (square / SEEDS as f64).sqrt();
        println!("true risk {risk}: {mean:.1} +- {error:.1} starts");
        assert!(mean <= most + 3.0 * error, "{risk}: {mean} +- {error}");
    }
}
