//! Starts, networks and small systems that the tests run.

use std::path::Path;

use super::super::Cpu;
use crate::model::Plant;
use crate::policy::{Activation, Layer, Mlp, Norm, Policy};
use crate::race::system::DroneRace;
use crate::real::Real;
use crate::real::simd::Instructions;
use crate::rollout::{
    DeviationTask, Farthest, PairMeasure, Query, ReachAvoidTask, Region, RolloutSpec, Starts,
    Stream, Tightening,
};
use crate::rollout::{Pairs, Purpose};
use crate::system::{Axis, System};

/// The backend with `threads` threads and the best instructions.
pub(super) fn cpu(threads: usize) -> Cpu {
    Cpu::new(Some(threads)).expect("threads can be started")
}

/// One backend for each instruction set of this machine.
pub(super) fn every_cpu() -> Vec<Cpu> {
    let all = Instructions::detect().into_iter();
    all.map(|set| Cpu::with_instructions(Some(1), set).expect("a thread can be started")).collect()
}

/// T = 30, gamma = 0.95.
pub(super) fn spec() -> RolloutSpec {
    RolloutSpec::new(30, 0.95).expect("a valid specification")
}

/// Losses that grow over time.
pub(super) fn tightening(spec: &RolloutSpec) -> Tightening {
    let growing = |rate: f32| (0..=spec.horizon).map(|t| rate * t as f32).collect();
    Tightening::losing(growing(0.01), growing(0.02))
}

/// Race starts near the study's: the positions of both drones vary with its box.
pub(super) fn race_starts() -> Starts<'static> {
    let low = [-0.8, 0.0, -2.5, 0.5, -0.1, -0.1, -0.8, 0.0, -2.5, 0.3, -0.1, -0.1];
    let high = [0.8, 0.0, -1.0, 0.7, 0.1, 0.1, 0.8, 0.0, -1.0, 0.5, 0.1, 0.1];
    Starts::Drawn {
        region: Region::new_box(low, high).expect("a valid box"),
        stream: Stream::new(7, Purpose::USER, 0),
    }
}

/// Pairs around [`race_starts`].
pub(super) fn race_pairs() -> Pairs<'static> {
    Pairs { nominal: race_starts(), radius: 0.1, stream: Stream::new(7, Purpose::USER, 1) }
}

/// The policy of the race.
pub(super) fn race_policy() -> Mlp {
    let file = "configs/policies/race_policy.safetensors";
    Mlp::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("the policy is there")
}

/// A network with weights that keep the size of its activations, from a fixed generator.
pub(super) fn network(widths: &[usize], activation: Activation, output: Activation) -> Mlp {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut number = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 40) as f32 / (1_u32 << 23) as f32 - 1.0
    };
    let mut layer = |inputs: usize, outputs: usize| {
        let scale = (3.0 / inputs as f32).sqrt();
        Layer::dense(
            (0..inputs * outputs).map(|_| scale * number()).collect(),
            (0..outputs).map(|_| 0.1 * number()).collect(),
        )
    };
    let layers = widths.windows(2).map(|pair| layer(pair[0], pair[1])).collect();
    Mlp::new(layers, activation, output).expect("a valid network")
}

/// The same with a norm behind each layer but the last.
pub(super) fn normed(widths: &[usize], activation: Activation) -> Mlp {
    let mut layers = network(widths, activation, Activation::Tanh).layers().to_vec();
    let hidden = layers.len() - 1;
    for layer in &mut layers[..hidden] {
        let row = |from: f32| (0..layer.outputs).map(|i| from + 0.1 * (i % 4) as f32).collect();
        layer.norm = Some(Norm { scale: row(0.7), shift: row(-0.2), epsilon: 1e-5 });
    }
    Mlp::from_layers(layers).expect("a valid network")
}

/// The measures of `task`, which the sink must get in order.
pub(super) fn measures(cpu: &Cpu, plant: &Plant, task: &ReachAvoidTask<'_>) -> Vec<f32> {
    let mut all = Vec::new();
    let prepared = cpu.prepare(plant).expect("it fits");
    let ran = prepared.reach_avoid(cpu, task, &mut |first, values| {
        assert_eq!(first, task.range.start + all.len() as u64, "order of the sink");
        all.extend_from_slice(values);
        Ok(())
    });
    ran.expect("the batch runs");
    assert_eq!(all.len() as u64, task.range.end - task.range.start);
    all
}

/// The race under `policy`.
pub(super) fn race_under<P: Policy<12, 3> + Send + Sync + 'static>(policy: P) -> Plant {
    Plant::of(DroneRace::default(), policy)
}

/// The measures of the starts `range` of the race, `plant`.
pub(super) fn race(
    cpu: &Cpu,
    plant: &Plant,
    range: std::ops::Range<u64>,
    query: Query,
) -> Vec<f32> {
    let spec = spec();
    let task = ReachAvoidTask {
        starts: race_starts(),
        range,
        spec,
        tightening: &tightening(&spec),
        query,
    };
    measures(cpu, plant, &task)
}

/// What pairs come to.
#[derive(Debug, PartialEq)]
pub(super) struct Measured {
    /// Of each step.
    pub(super) farthest: Vec<Farthest>,
    /// Of each pair.
    pub(super) measures: Vec<PairMeasure>,
}

/// What the pairs of `task` come to; the sink must get their measures in order.
pub(super) fn deviation(cpu: &Cpu, plant: &Plant, task: &DeviationTask<'_>) -> Measured {
    let mut measures = Vec::new();
    let prepared = cpu.prepare(plant).expect("it fits");
    let farthest = prepared.deviation(cpu, task, &mut |first, values| {
        assert_eq!(first, task.range.start + measures.len() as u64, "order of the sink");
        measures.extend_from_slice(values);
        Ok(())
    });
    Measured { farthest: farthest.expect("the batch runs"), measures }
}

/// The bits of `values`.
pub(super) fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Damping of all velocities of the race.
#[derive(Debug)]
pub(super) struct Damping;

impl Policy<12, 3> for Damping {
    fn name(&self) -> String {
        "damping".to_owned()
    }

    #[inline(always)]
    fn control<R: Real>(&self, x: [R; 12]) -> [R; 3] {
        let gain = R::lit(-0.5);
        [gain * x[1], R::lit(0.7) - x[3], gain * x[5].sin()]
    }
}

/// `x[t+1] = 1e15 x[t]^3 + u`: bursts from everywhere but near 0. Target and constraint are
/// `x - 1` and `limit - x`.
#[derive(Debug)]
pub(super) struct Burst {
    /// Where the constraint ends.
    pub(super) limit: f32,
}

impl System<1, 1> for Burst {
    fn name(&self) -> &str {
        "burst"
    }

    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }

    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }

    #[inline(always)]
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [R::lit(1e15) * x * x * x + u]
    }

    #[inline(always)]
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        x - R::lit(1.0)
    }

    #[inline(always)]
    fn constraint<R: Real>(&self, [x]: [R; 1]) -> R {
        R::lit(self.limit) - x
    }
}

/// 0, but NaN (the root of a negative number) below -0.5.
#[derive(Debug)]
pub(super) struct Fragile;

impl Policy<1, 1> for Fragile {
    fn name(&self) -> String {
        "fragile".to_owned()
    }

    #[inline(always)]
    fn control<R: Real>(&self, [x]: [R; 1]) -> [R; 1] {
        [R::lit(0.0) * (x + R::lit(0.5)).sqrt()]
    }
}
