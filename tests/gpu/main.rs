//! On an adapter: the kernels against the host's starts, the f32 formulas and the f64 oracle.
//!
//! Without an adapter every test says so and passes, unless `REACHCAST_REQUIRE_GPU` is 1.

mod activations;
mod cache;
mod calls;
mod certificates;
#[path = "../common/mod.rs"]
mod common;
mod counts;
mod edges;
mod failures;
mod faults;
mod held;
mod infinite;
#[path = "../learned/mod.rs"]
mod learned;
mod learned_plants;
mod lost;
mod measures;
#[path = "../models/mod.rs"]
mod models;
mod mppi;
mod narrowed;
mod networks;
#[path = "../oracle/mppi.rs"]
mod oracle;
mod pairs;
mod plants;
mod starts;
mod systems;
mod threads;
mod timing;

use std::path::Path;

use reachcast::Result;
use reachcast::backend::Backend;
use reachcast::backend::gpu::{Choice, Gpu, NetworkKernels};
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::rollout::{
    DeviationTask, Farthest, PairMeasure, Purpose, ReachAvoidTask, Region, RolloutSpec, Starts,
    Stream, Tightening,
};
use reachcast::system::System;

/// An adapter of any kind, as pessimistic as `REACHCAST_PESSIMIST` asks for; `None`, said aloud, where there is none.
fn gpu() -> Option<Gpu> {
    match Gpu::open(&Choice::Any) {
        Ok(gpu) => Some(common::pessimist::as_asked(gpu)),
        Err(e) if std::env::var("REACHCAST_REQUIRE_GPU").is_ok_and(|value| value == "1") => {
            panic!("REACHCAST_REQUIRE_GPU is 1: {e}")
        }
        Err(_) => {
            println!("SKIPPED: no adapter");
            None
        }
    }
}

/// Runs `test` on an adapter whose rollouts run networks in layers, and on one that fuses them.
fn each_way(test: impl Fn(Gpu)) {
    for networks in [NetworkKernels::Layered, NetworkKernels::Fused] {
        let Some(gpu) = gpu() else { return };
        test(gpu.with_networks(networks));
    }
}

fn reach_avoid(gpu: Gpu, plant: &Plant, task: &ReachAvoidTask<'_>) -> (Gpu, Result<Vec<f32>>) {
    let backend = Backend::Gpu(gpu);
    let mut all = Vec::new();
    let mut sink = |first, values: &[f32]| {
        assert_eq!(first, task.range.start + all.len() as u64, "order of the sink");
        all.extend_from_slice(values);
        Ok(())
    };
    let prepared = backend.prepare(plant);
    let result = prepared.and_then(|program| program.reach_avoid(task, &mut sink));
    let Backend::Gpu(gpu) = backend else { unreachable!("it was made a GPU above") };
    (gpu, result.map(|()| all))
}

fn measures(gpu: Gpu, plant: &Plant, task: &ReachAvoidTask<'_>) -> (Gpu, Vec<f32>) {
    let (gpu, all) = reach_avoid(gpu, plant, task);
    let all = all.expect("a batch that runs");
    assert_eq!(all.len() as u64, task.range.end - task.range.start);
    (gpu, all)
}

fn deviation(
    gpu: Gpu,
    plant: &Plant,
    task: &DeviationTask<'_>,
) -> (Gpu, Vec<Farthest>, Vec<PairMeasure>) {
    let backend = Backend::Gpu(gpu);
    let mut all = Vec::new();
    let mut sink = |first, values: &[PairMeasure]| {
        assert_eq!(first, task.range.start + all.len() as u64, "order of the sink");
        all.extend_from_slice(values);
        Ok(())
    };
    let prepared = backend.prepare(plant);
    let farthest = prepared.and_then(|program| program.deviation(task, &mut sink));
    assert_eq!(all.len() as u64, task.range.end - task.range.start);
    let Backend::Gpu(gpu) = backend else { unreachable!("it was made a GPU above") };
    (gpu, farthest.expect("a batch that runs"), all)
}

/// A tightening that differs at every step, so that no step can stand in for another.
fn ramp(spec: &RolloutSpec) -> Tightening {
    let steps = 0..=spec.horizon;
    Tightening {
        target: steps.clone().map(|t| 0.01 * t as f32).collect(),
        constraint: steps.map(|t| 0.02 * t as f32).collect(),
        ..Tightening::default()
    }
}

/// The box of a system's axes.
fn whole_box<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> Region {
    let axes = system.states();
    let (low, high) = (axes.each_ref().map(|a| a.low), axes.each_ref().map(|a| a.high));
    Region::new_box(low, high).expect("the box of a system")
}

fn drawn(region: Region, seed: u64) -> Starts<'static> {
    Starts::Drawn { region, stream: Stream::new(seed, Purpose::USER, 3) }
}

fn race_policy() -> Mlp {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    Mlp::load(&root.join("configs/policies/race_policy.safetensors")).expect("the race policy")
}

/// A network with uniform weights of the variance that keeps activations in range.
fn random_network(widths: &[usize], activation: Activation) -> Mlp {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let layers = widths.windows(2).map(|pair| {
        let bound = (3.0 / pair[0] as f32).sqrt();
        Layer::dense(
            (0..pair[0] * pair[1]).map(|_| bound * uniform()).collect(),
            (0..pair[1]).map(|_| 0.1 * uniform()).collect(),
        )
    });
    Mlp::new(layers.collect(), activation, Activation::Tanh).expect("a whole network")
}

/// How far a GPU may lie from f64: a multiple of the host's worst f32 distance.
///
/// A GPU may contract products and sum a layer in another order, each of which changes rounding
/// by a small factor; hence 8. The floor covers batches in which f32 happens to be exact.
fn band(host: impl IntoIterator<Item = (f32, f64)>) -> f64 {
    let distances = host.into_iter().map(|(host, oracle)| (f64::from(host) - oracle).abs());
    8.0 * distances.fold(0.0, f64::max) + 1e-6
}
