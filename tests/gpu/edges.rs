//! Chunk borders, long horizons and states that are not finite.

use reachcast::backend::gpu::Gpu;
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::rollout::{
    DeviationTask, Farthest, HUGE, NON_FINITE, PairControl, Pairs, Purpose, Query, ReachAvoidTask,
    RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::scenario::purpose;
use reachcast::system::{BangBang, DoubleIntegrator};

use crate::systems::{Count, Idle};
use crate::{
    deviation, drawn, each_way, gpu, measures, race_policy, ramp, random_network, whole_box,
};

#[test]
fn chunks_join_without_a_seam() {
    let Some(gpu) = gpu() else { return };
    let system = DoubleIntegrator::default();
    let plant = Plant::of(system, BangBang { acceleration: 1.0 });
    let spec = RolloutSpec::new(5, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let mut task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 26),
        range: 0..(1 << 18) + 1000,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (gpu, whole) = measures(gpu, &plant, &task);
    task.range = (1 << 18) - 500..(1 << 18) + 1000;
    let (gpu, part) = measures(gpu, &plant, &task);
    assert_eq!(part, whole[(1 << 18) - 500..]);

    let system = DroneRace::default();
    let plant = Plant::of(system, race_policy());
    let spec = RolloutSpec::new(2, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let pairs = |range| DeviationTask {
        pairs: Pairs {
            nominal: drawn(whole_box(&system), 27),
            radius: 0.1,
            stream: Stream::new(27, purpose::DEVIATION_PERTURBATION, 0),
        },
        range,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    let (gpu, farthest, whole) = deviation(gpu, &plant, &pairs(0..(1 << 14) + 300));
    let (gpu, before, left) = deviation(gpu, &plant, &pairs(0..(1 << 14) - 100));
    let (_, after, right) = deviation(gpu, &plant, &pairs((1 << 14) - 100..(1 << 14) + 300));
    assert_eq!(whole, [left, right].concat());
    let merged: Vec<Farthest> = before.iter().zip(after).map(|(a, b)| a.merge(b)).collect();
    assert_eq!(farthest, merged);
}

#[test]
fn every_step_of_a_long_horizon_is_taken() {
    let Some(mut gpu) = gpu() else { return };
    let list: Vec<[f32; 2]> = (0..10).map(|i| [i as f32, 0.5]).collect();
    let horizon = 10_000;
    let spec = RolloutSpec::new(horizon, 1.0).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let plant = Plant::of(Count, Idle);
    let task = ReachAvoidTask {
        starts: Starts::listed(&list),
        range: 0..10,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    // The margin is the number of steps taken, so the measure shows the final state.
    let expected: Vec<f32> = (0..10).map(|i| (i + horizon) as f32).collect();
    let (back, found) = measures(gpu, &plant, &task);
    gpu = back;
    assert_eq!(found, expected);
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::listed(&list),
            radius: 0.0,
            stream: Stream::new(1, Purpose::USER, 0),
        },
        range: 0..10,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    let (_, farthest, pairs) = deviation(gpu, &plant, &task);
    assert_eq!(farthest.len(), horizon as usize + 1);
    for (pair, expected) in pairs.iter().zip(&expected) {
        assert_eq!([pair.nominal, pair.perturbed], [*expected; 2]);
    }
    each_way(every_step_under_a_network);
}

/// Crosses submissions: only the last state counts, whose margin is 150 above the start's, less
/// 149.5.
fn every_step_under_a_network(mut gpu: Gpu) {
    let plant = Plant::of(Count, random_network(&[2, 4, 1], Activation::Relu));
    let spec = RolloutSpec::new(150, 1.0).expect("a horizon");
    let mut target = vec![1000.0; 151];
    target[150] = 0.0;
    let tightening = Tightening::losing(target, vec![0.0; 151]);
    let starts = [[-149.5, 0.5], [-150.5, 0.5]];
    for (query, expected) in [(Query::Measure, [0.5, -0.5]), (Query::Sign, [1.0, -1.0])] {
        let task = ReachAvoidTask {
            starts: Starts::listed(&starts),
            range: 0..2,
            spec,
            tightening: &tightening,
            query,
        };
        let (back, found) = measures(gpu, &plant, &task);
        gpu = back;
        assert_eq!(found, expected);
    }
}

#[test]
fn non_finite_states_fail_unless_the_target_was_reached() {
    each_way(non_finite_states);
}

fn non_finite_states(mut gpu: Gpu) {
    // The second state is infinite after 7 squarings of 2.1 and finite again at t = 8. From -3 the
    // first reaches 0 before that (a margin of 3 at t = 6), from -10 after it, from -20 never.
    let nan = f32::NAN;
    let starts = [[-3.0, 2.1], [-10.0, 2.1], [-20.0, 0.5], [nan, 0.5], [1.0, f32::INFINITY]];
    let spec = RolloutSpec::new(19, 1.0).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let formula = Plant::of(Count, Idle);
    let driven = Plant::of(Count, random_network(&[2, 4, 1], Activation::Tanh));
    let dense = [3.0, NON_FINITE, -1.0, NON_FINITE, NON_FINITE];
    let signs = [1.0, NON_FINITE, -1.0, NON_FINITE, NON_FINITE];
    for (query, expected) in [(Query::Measure, dense), (Query::Sign, signs)] {
        let task = ReachAvoidTask {
            starts: Starts::listed(&starts),
            range: 0..5,
            spec,
            tightening: &tightening,
            query,
        };
        let (back, found) = measures(gpu, &formula, &task);
        assert_eq!(found, expected, "{query:?} under a formula");
        let (back, found) = measures(back, &driven, &task);
        gpu = back;
        assert_eq!(found, expected, "{query:?} under a network");
    }
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::listed(&starts[..3]),
            radius: 0.01,
            stream: Stream::new(1, Purpose::USER, 0),
        },
        range: 0..3,
        spec,
        tightening: &tightening,
        control: PairControl::Replay,
    };
    let (_, farthest, pairs) = deviation(gpu, &formula, &task);
    assert!(pairs[0].nominal == 3.0 && pairs[1].nominal == NON_FINITE);
    assert!(pairs[0].perturbed > 2.9 && pairs[1].perturbed == NON_FINITE);
    assert!(farthest[0].distance <= 0.0101, "{farthest:?}");
    let overflowed = Farthest { distance: HUGE, pair: 0 };
    assert_eq!(farthest[7], overflowed);
    assert!(farthest[8].distance <= 0.0101, "{farthest:?}");
}
