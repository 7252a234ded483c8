//! One CPU backend, one adapter and several, used from four threads at once.

use std::thread;

use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::Injection;
use reachcast::model::Plant;
use reachcast::policy::{Activation, Mlp};
use reachcast::race::DroneRace;
use reachcast::rollout::{
    DeviationTask, Farthest, PairControl, PairMeasure, Pairs, Query, ReachAvoidTask, RolloutSpec,
    Stream,
};
use reachcast::scenario::purpose;
use reachcast::{Fault, Result};

use crate::{drawn, gpu, ramp, random_network, whole_box};

const THREADS: u64 = 4;
/// Calls of each thread.
const CALLS: u64 = 6;

/// Measures and pairs of one seed.
#[derive(Debug, Default, PartialEq)]
struct Found {
    measures: Vec<f32>,
    pairs: Vec<PairMeasure>,
    farthest: Vec<Farthest>,
}

fn run(backend: &Backend, policy: &Mlp, seed: u64) -> Result<Found> {
    let system = DroneRace::default();
    let program = backend.prepare(&Plant::of(system, policy.clone()))?;
    let spec = RolloutSpec::new(10, 0.95)?;
    let tightening = ramp(&spec);
    let mut found = Found::default();
    let starts = drawn(whole_box(&system), seed);
    let task = ReachAvoidTask {
        starts: starts.clone(),
        range: 0..150,
        spec,
        tightening: &tightening,
        query: if seed.is_multiple_of(2) { Query::Measure } else { Query::Sign },
    };
    program.reach_avoid(&task, &mut |first, values| {
        assert_eq!(first, found.measures.len() as u64);
        found.measures.extend_from_slice(values);
        Ok(())
    })?;
    let stream = Stream::new(seed, purpose::DEVIATION_PERTURBATION, 0);
    let task = DeviationTask {
        pairs: Pairs { nominal: starts, radius: 0.1, stream },
        range: 0..150,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    found.farthest = program.deviation(&task, &mut |first, pairs| {
        assert_eq!(first, found.pairs.len() as u64);
        found.pairs.extend_from_slice(pairs);
        Ok(())
    })?;
    Ok(found)
}

/// Four threads on `backend`, each with seeds of its own, against the same one after the other.
fn check(backend: &Backend, serial: &Backend) {
    let policy = random_network(&[12, 16, 3], Activation::Tanh);
    let seeds = |thread: u64| (0..CALLS).map(move |call| CALLS * thread + call);
    let of = |backend: &Backend, thread: u64| -> Vec<Found> {
        seeds(thread).map(|seed| run(backend, &policy, seed).expect("it runs")).collect()
    };
    let expected: Vec<Vec<Found>> = (0..THREADS).map(|thread| of(serial, thread)).collect();
    let found: Vec<Vec<Found>> = thread::scope(|scope| {
        let spawn = |thread| scope.spawn(move || of(backend, thread));
        let threads: Vec<_> = (0..THREADS).map(spawn).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert_eq!(found, expected);
}

#[test]
fn four_threads_share_a_cpu() {
    let cpu = Backend::Cpu(Cpu::new(Some(2)).expect("two threads"));
    check(&cpu, &cpu);
}

#[test]
fn four_threads_share_an_adapter() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    check(&backend, &backend);
}

/// A failure belongs to every call that was under way: no thread takes what it has spoiled.
#[test]
fn four_threads_share_an_adapter_that_fails() {
    let Some(first) = gpu() else { return };
    let serial = Backend::Gpu(first);
    for fault in [Fault::OutOfMemory, Fault::Timeout, Fault::Lost] {
        let Some(gpu) = gpu() else { return };
        let asked = vec![Injection { fault, submission: 20, repeats: false }];
        let backend = Backend::Gpu(gpu.with_failures(asked));
        check(&backend, &serial);
        assert!(!backend.events().is_empty(), "{fault}");
    }
}

#[test]
fn four_threads_open_adapters_of_their_own() {
    let Some(first) = gpu() else { return };
    let serial = Backend::Gpu(first);
    let policy = random_network(&[12, 16, 3], Activation::Tanh);
    let expected = run(&serial, &policy, 7).expect("it runs");
    thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                let own = Backend::Gpu(gpu().expect("one opened before"));
                let found = run(&own, &policy, 7).expect("it runs");
                assert_eq!(found, expected);
            });
        }
    });
}
