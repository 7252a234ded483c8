//! Bounds on margin drops.

use crate::pools::{Member, POOL, Pool, pools};
use crate::{BETA, EPSILON, false_ones, violates};
use reachcast::scenario::bound::required_with_failures;
use reachcast::scenario::drops::level;

#[test]
fn bounds_on_drops_hold_with_and_without_discards() {
    for (name, pool) in pools() {
        for discards in [0, 7] {
            let need = required_with_failures(EPSILON, BETA, discards).expect("a count");
            let count = |pairs: u64| {
                false_ones(|random| {
                    let sample = (0..pairs).map(|_| pool.draw(random).z);
                    let level = level(sample, discards);
                    pool.share(|member| member.z > level) > EPSILON
                })
            };
            let name = format!("drops of {name}, {discards} discarded");
            assert!(!violates(&name, count(need)));
            assert!(violates(&format!("{name}, from half the pairs"), count(need / 2)));
        }
    }
}

/// Why a bound on drops certifies: a start that bears more than its pair drops has a perturbed rollout that
/// succeeds.
#[test]
fn no_pair_fails_whose_score_is_above_its_drop() {
    for (name, pool) in pools() {
        let refutes = |member: &Member| member.failed && member.score > member.z.max(0.0);
        assert_eq!(pool.share(refutes), 0.0, "{name}");
        let at_stake = |member: &Member| member.failed && member.score > 0.0;
        assert!(pool.share(at_stake) > 0.0, "{name}: no start that succeeds fails when perturbed");
    }
}

/// A pair counts up to the step at which the nominal rollout fails the task that is asked, and no other.
#[test]
fn pairs_that_another_task_cuts_are_caught() {
    let need = required_with_failures(EPSILON, BETA, 0).expect("a count");
    for (name, pool) in pools() {
        let count = false_ones(|random| {
            let sample = (0..need).map(|_| pool.draw(random).z_of_another);
            let level = level(sample, 0);
            pool.share(|member| member.z > level) > EPSILON
        });
        assert!(violates(&format!("drops of {name}, cut by another task"), count));
    }
}

/// Half of the nominal starts fail at once, as do their perturbed ones; the others are better off when
/// perturbed. A level below 0 would certify starts that fail themselves.
#[test]
fn levels_are_never_below_zero() {
    let member = |i: u64| match i % 2 {
        0 => (f64::NEG_INFINITY, -0.1, true),
        _ => (-0.5, 1.0, false),
    };
    let member = |i: u64| {
        let (z, score, failed) = member(i);
        Member { z, z_of_another: z, score, failed }
    };
    let pool = Pool((0..POOL).map(member).collect());
    let need = required_with_failures(EPSILON, BETA, 0).expect("a count");
    let count = |of: &(dyn Fn(Vec<f64>) -> f64 + Sync)| {
        false_ones(|random| {
            let level = of((0..need).map(|_| pool.draw(random).z).collect());
            pool.share(|member| member.score > level && member.failed) > EPSILON
        })
    };
    assert!(!violates("levels", count(&|sizes| level(sizes.into_iter(), 0))));
    let open = |sizes: Vec<f64>| sizes.into_iter().fold(f64::NEG_INFINITY, f64::max);
    assert!(violates("levels below 0 let through", count(&open)));
}
