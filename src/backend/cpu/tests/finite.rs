//! Rollouts that meet infinity or NaN.

use super::fixture::*;
use crate::model::Plant;
use crate::rollout::{
    DeviationTask, HUGE, NON_FINITE, PairControl, Pairs, Purpose, Query, ReachAvoidTask,
    RolloutSpec, Starts, Stream, Tightening,
};

/// Starts of [`Burst`], and what becomes of them under [`Fragile`] with the constraint at 1e30.
///
/// 2 starts in the target, 0 stays where it is, 0.5 reaches with 1.25e14 before it bursts, -0.3
/// and -0.4 burst downward (the policy gives NaN once below -0.5), -0.7 meets NaN at once.
const CASES: [(f32, Fate); 6] = [
    (2.0, Fate::Reached),
    (0.0, Fate::Short),
    (0.5, Fate::Reached),
    (-0.3, Fate::NotFinite),
    (-0.4, Fate::NotFinite),
    (-0.7, Fate::NotFinite),
];

#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Reached,
    Short,
    NotFinite,
}

/// More starts than a group has lanes, each fate in many lanes.
fn starts() -> Vec<[f32; 1]> {
    (0..200).map(|i| [CASES[i % CASES.len()].0]).collect()
}

#[test]
fn a_state_that_is_not_finite_fails_the_rest_of_its_rollout() {
    let (starts, plant) = (starts(), Plant::of(Burst { limit: 1e30 }, Fragile));
    let spec = RolloutSpec::new(8, 0.9).expect("a valid specification");
    for cpu in every_cpu() {
        for query in [Query::Measure, Query::Sign] {
            let task = ReachAvoidTask {
                starts: Starts::listed(&starts),
                range: 0..starts.len() as u64,
                spec,
                tightening: &Tightening::none(&spec),
                query,
            };
            let got = measures(&cpu, &plant, &task);
            for (i, got) in got.into_iter().enumerate() {
                let (start, fate) = CASES[i % CASES.len()];
                let right = match fate {
                    Fate::Reached => got > 0.0 && got < HUGE,
                    Fate::Short => got < 0.0 && got > NON_FINITE,
                    Fate::NotFinite => got == NON_FINITE,
                };
                assert!(right, "{query:?} of start {i}, {start}, is {got}");
            }
        }
    }
}

/// A violation before the burst decides the sign; the measure says that it is not finite.
#[test]
fn a_violation_before_the_burst_decides_the_sign() {
    let (starts, plant) = ([[2.0], [0.5]], Plant::of(Burst { limit: 0.25 }, Fragile));
    let spec = RolloutSpec::new(8, 0.9).expect("a valid specification");
    let run = |query| {
        let task = ReachAvoidTask {
            starts: Starts::listed(&starts),
            range: 0..2,
            spec,
            tightening: &Tightening::none(&spec),
            query,
        };
        measures(&cpu(1), &plant, &task)
    };
    assert_eq!(run(Query::Measure), [NON_FINITE; 2]);
    assert_eq!(run(Query::Sign), [-1.0; 2]);
}

#[test]
fn a_pair_that_is_not_finite_is_the_farthest() {
    let (starts, plant) = (starts(), Plant::of(Burst { limit: 1e30 }, Fragile));
    let spec = RolloutSpec::new(8, 0.9).expect("a valid specification");
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::listed(&starts),
            radius: 1e-3,
            stream: Stream::new(1, Purpose::USER, 0),
        },
        range: 1..200,
        spec,
        tightening: &Tightening::none(&spec),
        control: PairControl::Replay,
    };
    for cpu in every_cpu() {
        let Measured { farthest, measures } = deviation(&cpu, &plant, &task);
        assert!(farthest[0].distance <= 1.001e-3, "{:?}", farthest[0]);
        // The first start of NaN control is number 5; its state is NaN from step 1 on.
        assert_eq!((farthest[1].distance, farthest[1].pair), (HUGE, 5));
        let last = farthest[8];
        // Pair 1 starts at 0, its perturbed rollout beside it.
        assert_eq!((last.distance, last.pair), (HUGE, 1));
        for (i, measure) in (1..).zip(measures) {
            let fails = CASES[i % CASES.len()].1 == Fate::NotFinite;
            assert_eq!(measure.nominal == NON_FINITE, fails, "pair {i}: {measure:?}");
        }
    }
}
