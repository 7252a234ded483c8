//! Calibration of the score.

use crate::pools::{Member, Pool, pools};
use crate::{BETA, false_ones, violates};
use reachcast::scenario::bound::required_with_failures;
use reachcast::scenario::drops::level;

/// Whether the nominal rollout has a score above `level` and the perturbed one fails.
fn escapes(member: &Member, level: f64) -> bool {
    member.score > level && member.failed
}

/// Calibrations from `pairs` pairs whose true risk is above `risk`.
fn false_levels(pool: &Pool, risk: f64, discards: u64, pairs: u64) -> u64 {
    false_ones(|random| {
        let sample = (0..pairs).map(|_| pool.draw(random));
        let of = |one: Member| if one.failed { one.score } else { f64::NEG_INFINITY };
        let level = level(sample.map(of), discards);
        pool.share(|member| escapes(member, level)) > risk
    })
}

#[test]
fn calibrations_hold_with_and_without_discards() {
    for (name, pool) in pools() {
        // A level is at least 0, where this share escapes: a larger risk could not be missed.
        let risk = 0.4 * pool.share(|member| escapes(member, 0.0));
        for discards in [0, 7] {
            let need = required_with_failures(risk, BETA, discards).expect("a count");
            let count = |pairs| false_levels(pool, risk, discards, pairs);
            let name = format!("calibration of {name} at {risk:.4}, {discards} discarded");
            assert!(!violates(&name, count(need)));
            assert!(violates(&format!("{name}, from half the pairs"), count(need / 2)));
        }
    }
}
