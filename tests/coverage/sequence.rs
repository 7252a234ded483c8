//! Conditional sets by fixed sequence.

use crate::pools::{Member, POOL, Pool, pools};
use crate::{BETA, false_ones, violates};
use rand::rngs::StdRng;
use reachcast::scenario::bound::required_with_failures;
use reachcast::scenario::drops_record::SequenceOutcome;
use reachcast::scenario::sequence::{Counts, Failed, Levels, test};

/// Draws of a conditional sample.
const DRAWS: usize = 6000;

/// How a sequence is gone through.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    /// As it has to be.
    Sound,
    /// It goes on after a refusal, to the laxest level whose bound is low enough.
    GoesOn,
    /// Levels are the scores of the very sample that tests them.
    LevelsOfTheSample,
}

/// Whether a sequence for the risk `risk` claims a set whose risk is above.
fn sequence_is_false(
    pool: &Pool,
    risk: f64,
    needed: &[u64],
    rule: Rule,
    random: &mut StdRng,
) -> bool {
    let sample: Vec<Member> = (0..DRAWS).map(|_| pool.draw(random)).collect();
    let pilot: Vec<f64> = (0..2048).map(|_| pool.draw(random).score).collect();
    let mut levels = Levels::new(pilot, DRAWS as u64, Some(risk), BETA, 0.0);
    assert!(levels.tested, "draws enough");
    if rule == Rule::LevelsOfTheSample {
        levels.levels = sample.iter().map(|one| one.score).filter(|score| *score > 0.0).collect();
        levels.levels.sort_unstable_by(|a, b| b.total_cmp(a));
        levels.levels.drain(..(levels.start.expect("a start") as usize) / 3);
    }
    let counts = |all: &[f64]| {
        let mut counts = Counts::new(all.len());
        for one in &sample {
            let first = all.partition_point(|level| *level >= one.score);
            counts.add(first, if one.failed { Failed::Yes } else { Failed::No });
        }
        counts
    };
    if rule == Rule::Sound {
        let found = test(&levels, &counts(&levels.levels), Some(risk), BETA, 0).expect("a test");
        let level = found.level().expect("a level");
        return found.outcome == SequenceOutcome::Accepted && pool.conditional(level) > risk;
    }
    let mut sorted = sample.clone();
    sorted.sort_unstable_by(|a, b| b.score.total_cmp(&a.score));
    let failures: Vec<usize> = std::iter::once(0)
        .chain(sorted.iter().scan(0, |failures, one| {
            *failures += usize::from(one.failed);
            Some(*failures)
        }))
        .collect();
    let accepted = |level: &&f64| {
        let inside = sorted.partition_point(|one| one.score > **level);
        needed.get(failures[inside]).is_some_and(|needed| inside as u64 >= *needed)
    };
    let last = levels.levels.iter().rev().find(accepted);
    last.is_some_and(|level| pool.conditional(*level) > risk)
}

/// Draws that support the risk `risk`, by the failures among them.
fn needed(risk: f64) -> Vec<u64> {
    let needed = |failures| required_with_failures(risk, BETA, failures).expect("a count");
    (0..).map(needed).take_while(|needed| *needed <= DRAWS as u64).collect()
}

#[test]
fn sequences_hold_also_where_the_risk_is_just_above() {
    for (name, pool) in pools() {
        let positive = pool.share(|member| member.score > 0.0);
        let mut tested = 0;
        // Just below the true risk of the last set of the sequence, of one near its end, and of its middle.
        for share in [0.999, 0.9, 0.8] {
            let risk = pool.conditional(pool.quantile(share * positive)) * 0.98;
            if 3.0 * BETA.ln() / (-risk).ln_1p() > 0.8 * positive * DRAWS as f64 {
                println!("{name} at {share}: the risk {risk} takes more draws than there are");
                continue;
            }
            let count =
                false_ones(|random| sequence_is_false(pool, risk, &[], Rule::Sound, random));
            assert!(!violates(&format!("sequence of {name} at the risk {risk:.4}"), count));
            tested += 1;
        }
        assert!(tested >= 2, "{name}: {tested} risks");
    }
}

/// Scores that say nothing of failures: every set has a risk just above the one asked for.
fn flat() -> Pool {
    let risk = 0.0204;
    let member = |i: u64| Member {
        z: 0.0,
        z_of_another: 0.0,
        score: (i * 7919 % POOL) as f64 / POOL as f64,
        failed: (i as f64 * risk).fract() + risk >= 1.0,
    };
    Pool((0..POOL).map(member).collect())
}

#[test]
fn a_sequence_that_goes_on_or_looks_at_its_sample_is_caught() {
    let pool = flat();
    assert!((pool.conditional(0.0) - 0.0204).abs() < 2e-4);
    let needed = needed(0.02);
    let count = |rule| false_ones(|random| sequence_is_false(&pool, 0.02, &needed, rule, random));
    assert!(!violates("sequence", count(Rule::Sound)));
    assert!(violates("sequence that goes on after a refusal", count(Rule::GoesOn)));
    assert!(violates("levels chosen on the test sample", count(Rule::LevelsOfTheSample)));
}
