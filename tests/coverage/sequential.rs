//! Sequential claims: looked at after every start, where Clopper and Pearson's bound looked at in the same way is
//! false far more often.

use crate::pools::{Member, Pool, pools};
use crate::{BETA, CERTIFICATES, EPSILON, false_ones, violates};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::scenario::bound::certified_risk;
use reachcast::scenario::evidence::Evidence;
use reachcast::scenario::sequential_record::{SequentialOf, SequentialOutcome, SequentialSettings};

/// Starts after which a certificate ends.
const MOST: u64 = 2000;
/// The true risk over the one that is claimed.
const ABOVE: f64 = 1.01;

/// A claim of that risk about the certified set.
fn asked(epsilon: f64, beta: f64) -> SequentialSettings {
    let of = SequentialOf::Set;
    SequentialSettings { of, epsilon, beta, most: MOST, radius: 0.0, carried: 0.0 }
}

/// Whether failures and starts end the work with the claim.
fn is_certified(asked: &SequentialSettings, failures: u64, starts: u64) -> bool {
    failures <= starts && asked.end(failures, starts) == Some(SequentialOutcome::Certified)
}

/// The start after which `holds` says of failures and starts that the claim holds.
fn stopped(mut failed: impl FnMut() -> bool, holds: impl Fn(u64, u64) -> bool) -> Option<u64> {
    let mut failures = 0;
    (1..=MOST).find(|&starts| {
        failures += u64::from(failed());
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

/// When a claim of that risk holds.
fn certifies(epsilon: f64, beta: f64) -> impl Fn(u64, u64) -> bool {
    let asked = asked(epsilon, beta);
    table(move |failures, starts| is_certified(&asked, failures, starts))
}

/// Of each pool, the pairs of its laxest set: those whose nominal rollout succeeds.
fn sets() -> impl Iterator<Item = (&'static str, Pool)> {
    let inside = |pool: &Pool| {
        pool.0.iter().filter(|member| member.score > 0.0).copied().collect::<Vec<Member>>()
    };
    pools().iter().map(move |(name, pool)| (*name, Pool(inside(pool))))
}

#[test]
fn claims_are_false_at_most_as_often_as_claimed_whenever_one_looks() {
    for (name, set) in sets() {
        let risk = set.share(|member| member.failed);
        let epsilon = risk / ABOVE;
        println!("{name}: {risk} fails, {epsilon} is claimed");
        let count = |holds: &(dyn Fn(u64, u64) -> bool + Sync)| {
            false_ones(|random| stopped(|| set.draw(random).failed, holds).is_some())
        };
        assert!(!violates(&format!("evidence on {name}"), count(&certifies(epsilon, BETA))));
        let lax = certifies(epsilon, 4.0 * BETA);
        assert!(violates(&format!("evidence on {name}, four times beta"), count(&lax)));
        let fixed = table(|k, n| k <= n && certified_risk(n, k, BETA) <= epsilon);
        assert!(violates(&format!("Clopper-Pearson after every start of {name}"), count(&fixed)));
    }
}

/// Attempts one after the other whose evidence is multiplied: the product is evidence, failed ones included.
#[test]
fn products_of_all_attempts_are_evidence() {
    for (name, set) in sets() {
        let epsilon = set.share(|member| member.failed) / ABOVE;
        let count = false_ones(|random| {
            let mut asked = asked(epsilon, BETA);
            // Five attempts of 60 starts; each goes on from what those before it came to.
            (0..5).any(|_| {
                let mut failures = 0;
                let reached = (1..=60).any(|starts| {
                    failures += u64::from(set.draw(random).failed);
                    is_certified(&asked, failures, starts)
                });
                asked.carried += Evidence::new(epsilon).ln_e(failures, 60);
                reached
            })
        });
        assert!(!violates(&format!("products on {name}"), count));
    }
}

/// The starts that good policies need, by simulation.
#[test]
fn good_policies_need_few_starts() {
    let holds = certifies(EPSILON, 1e-3);
    for (risk, most) in [(0.0, 70.0), (0.01, 103.0), (0.02, 149.0)] {
        let one = |seed| {
            let mut random = StdRng::seed_from_u64(seed);
            stopped(|| random.random_bool(risk), &holds).expect("a claim") as f64
        };
        let starts: Vec<f64> = (0..CERTIFICATES).map(one).collect();
        let mean = starts.iter().sum::<f64>() / CERTIFICATES as f64;
        let square = starts.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / CERTIFICATES as f64;
        let error = (square / CERTIFICATES as f64).sqrt();
        println!("true risk {risk}: {mean:.1} +- {error:.1} starts");
        assert!(mean <= most + 3.0 * error, "{risk}: {mean} +- {error}");
    }
}
