//! The same bits for any threads, split, place in a tile and, for physics, any instructions.

use std::ops::Range;

use super::fixture::*;
use crate::backend::Backend;
use crate::error::Error;
use crate::model::Plant;
use crate::policy::{Activation, Mlp};
use crate::rollout::{
    DeviationTask, Farthest, PairControl, Query, ReachAvoidTask, Starts, Tightening,
};

/// How the starts `0..COUNT` are split into ranges.
const COUNT: u64 = 400;
const SPLITS: [&[u64]; 4] = [&[], &[1], &[158, 159, 333], &[48, 96, 144, 192, 240, 288]];

fn ranges(cuts: &[u64]) -> Vec<Range<u64>> {
    let ends = cuts.iter().copied().chain([COUNT]);
    let starts = std::iter::once(0).chain(cuts.iter().copied());
    starts.zip(ends).map(|(start, end)| start..end).collect()
}

#[test]
fn measures_and_signs_do_not_depend_on_threads_or_place() {
    let odd = network(&[12, 7, 100, 3], Activation::Silu, Activation::Tanh);
    let normed = normed(&[12, 7, 101, 3], Activation::Mish);
    for plant in [odd, normed, race_policy()].map(race_under) {
        for query in [Query::Measure, Query::Sign] {
            let whole = bits(&race(&cpu(1), &plant, 0..COUNT, query));
            for threads in [1, 2, 3] {
                let cpu = cpu(threads);
                for cuts in SPLITS {
                    let parts = ranges(cuts).into_iter();
                    let parts = parts.flat_map(|range| race(&cpu, &plant, range, query));
                    let parts: Vec<f32> = parts.collect();
                    assert_eq!(bits(&parts), whole, "{threads} threads, cuts {cuts:?}");
                }
            }
        }
    }
}

fn race_deviation(
    cpu: &super::super::Cpu,
    plant: &Plant,
    range: Range<u64>,
    control: PairControl,
) -> Measured {
    let spec = spec();
    let task =
        DeviationTask { pairs: race_pairs(), range, spec, tightening: &tightening(&spec), control };
    deviation(cpu, plant, &task)
}

#[test]
fn deviation_does_not_depend_on_threads_or_place() {
    let plant = race_under(race_policy());
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        let whole = race_deviation(&cpu(1), &plant, 0..COUNT, control);
        assert!(whole.farthest.iter().all(|farthest| farthest.pair < COUNT));
        for threads in [1, 2, 3] {
            let cpu = cpu(threads);
            for cuts in SPLITS {
                let mut farthest = vec![Farthest::NONE; whole.farthest.len()];
                let mut measures = Vec::new();
                for range in ranges(cuts) {
                    let part = race_deviation(&cpu, &plant, range, control);
                    for (farthest, part) in farthest.iter_mut().zip(part.farthest) {
                        *farthest = farthest.merge(part);
                    }
                    measures.extend(part.measures);
                }
                assert_eq!(
                    Measured { farthest, measures },
                    whole,
                    "{threads} threads, cuts {cuts:?}"
                );
            }
        }
    }
}

#[test]
fn physics_is_the_same_on_all_instructions() {
    let (cpus, plant) = (every_cpu(), race_under(Damping));
    for query in [Query::Measure, Query::Sign] {
        let expected = bits(&race(&cpus[0], &plant, 0..COUNT, query));
        for cpu in &cpus {
            let got = bits(&race(cpu, &plant, 0..COUNT, query));
            assert_eq!(got, expected, "{}", cpu.device());
        }
    }
    let expected = race_deviation(&cpus[0], &plant, 0..COUNT, PairControl::ClosedLoop);
    for cpu in &cpus {
        let got = race_deviation(cpu, &plant, 0..COUNT, PairControl::ClosedLoop);
        assert_eq!(got, expected, "{}", cpu.device());
    }
}

#[test]
fn fused_kernels_agree_to_the_bit() {
    let policy = network(&[12, 100, 3, 3], Activation::Tanh, Activation::Identity);
    let several = Activation::ALL.map(|activation| normed(&[12, 11, 3], activation));
    several.into_iter().chain([policy]).for_each(agree_where_fused);
}

fn agree_where_fused(policy: Mlp) {
    let plant = race_under(policy);
    let mut cpus = every_cpu();
    let baseline = cpus.pop().expect("baseline instructions are always there");
    let expected = race(&baseline, &plant, 0..COUNT, Query::Measure);
    for pair in cpus.windows(2) {
        let [first, second] = [0, 1].map(|i| race(&pair[i], &plant, 0..COUNT, Query::Measure));
        assert_eq!(bits(&first), bits(&second));
        // Without fused multiply-add some bits differ, else the test compares like with like.
        assert_ne!(bits(&first), bits(&expected));
    }
}

/// The chunks of 65,536 go to the sink on the calling thread; its error ends the batch.
#[test]
fn an_error_of_the_sink_ends_the_batch() {
    let spec = spec();
    let task = ReachAvoidTask {
        starts: race_starts(),
        range: 10..200_000,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Sign,
    };
    let cpu = cpu(2);
    let prepared = cpu.prepare(&race_under(Damping)).expect("it fits");
    let (caller, mut seen) = (std::thread::current().id(), Vec::new());
    let outcome = prepared.reach_avoid(&cpu, &task, &mut |first, values| {
        assert_eq!(std::thread::current().id(), caller);
        seen.push((first, values.len()));
        if seen.len() == 2 { Err(Error::Interrupted) } else { Ok(()) }
    });
    assert!(matches!(outcome, Err(Error::Interrupted)));
    assert_eq!(seen, [(10, 65_536), (65_546, 65_536)]);
}

#[test]
fn wrong_tasks_are_refused() {
    assert!(super::super::Cpu::new(Some(0)).is_err());
    let (spec, policy, backend) = (spec(), race_policy(), Backend::Cpu(cpu(1)));
    let list = [[0.0; 12]; 5];
    let run = |end, tightening: &Tightening, policy: &Mlp| {
        let task = ReachAvoidTask {
            starts: Starts::listed(&list),
            range: 0..end,
            spec,
            tightening,
            query: Query::Measure,
        };
        let program = backend.prepare(&race_under(policy.clone()));
        let outcome = program.and_then(|program| program.reach_avoid(&task, &mut |_, _| Ok(())));
        outcome.err().map(|error| error.to_string())
    };
    let none = Tightening::none(&spec);
    assert_eq!(run(5, &none, &policy), None);
    let short = Tightening { target: vec![0.0; 30], ..none.clone() };
    let wide = network(&[12, 4], Activation::Relu, Activation::Tanh);
    let cases = [
        (run(6, &none, &policy), "the list has 5 starts"),
        (run(5, &short, &policy), "30 values, expected 31"),
        (run(5, &none, &wide), "12 inputs to 4 outputs"),
    ];
    for (message, part) in cases {
        let message = message.expect("the task is refused");
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn an_empty_range_gives_nothing() {
    let plant = race_under(Damping);
    assert!(race(&cpu(2), &plant, 5..5, Query::Sign).is_empty());
    let Measured { farthest, measures } =
        race_deviation(&cpu(2), &plant, 5..5, PairControl::Replay);
    assert_eq!((farthest, measures), (vec![Farthest::NONE; 31], vec![]));
}
