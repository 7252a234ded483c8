//! Starts and pairs that the device draws have the bits of those that the host draws.

use reachcast::backend::gpu::Gpu;
use reachcast::model::Plant;
use reachcast::rollout::{
    Ball, DeviationTask, Ellipsoid, PairControl, Pairs, Query, ReachAvoidTask, Region, RolloutSpec,
    Starts, Stream, Tightening,
};
use reachcast::scenario::purpose;

use crate::systems::{Idle, Reveal};
use crate::{deviation, drawn, gpu, measures};

fn bits(values: impl IntoIterator<Item = f32>) -> Vec<u32> {
    values.into_iter().map(f32::to_bits).collect()
}

fn revealed_starts<const NX: usize>(mut gpu: Gpu, starts: &Starts<'_>, first: u64) -> Gpu {
    let spec = RolloutSpec::new(1, 0.5).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = ReachAvoidTask {
        starts: starts.clone(),
        range: first..first + 300,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    for coordinate in 0..NX {
        let plant = Plant::of(Reveal::<NX>(coordinate), Idle);
        let (back, found) = measures(gpu, &plant, &task);
        gpu = back;
        let expected = task.range.clone().map(|i| starts.start(i)[coordinate]);
        assert_eq!(bits(found), bits(expected), "coordinate {coordinate} of {NX}");
    }
    gpu
}

#[test]
fn starts_have_the_host_bits() {
    let Some(mut gpu) = gpu() else { return };
    // Across 2^32, where the index carries into its high word.
    let first = (1 << 32) - 150;
    let low = [-1.5, 0.25, -7.0, 0.1, 2.0];
    let high = [1.5, 0.75, 9.0, 0.1, 2.5];
    let region = Region::new_box(low, high).expect("a box");
    gpu = revealed_starts::<5>(gpu, &drawn(region, 0x1234_5678_9abc_def0), first);
    let list: Vec<[f32; 5]> = (0..700).map(|i| [0.1 * i as f32, 1.0, -2.0, 3.0, 0.7]).collect();
    gpu = revealed_starts::<5>(gpu, &Starts::listed(&list), 123);
    for varies in [[true; 6], [true, false, true, true, false, true]] {
        let center = vec![0.3, -0.2, 1.0, 0.0, 5.0, -0.7];
        let ball = Ball { center, radius: 0.55, varies: varies.to_vec() };
        gpu = revealed_starts::<6>(gpu, &drawn(Region::Ball(ball), 7), first);
    }
    let center = vec![0.3, -0.2, 1.0, 0.0, 5.0, -0.7];
    let set = Ellipsoid { center, half_axes: vec![0.55, 0.1, 0.0, 3.0, 0.25, 1e-3] };
    gpu = revealed_starts::<6>(gpu, &drawn(Region::Ellipsoid(set), 7), first);
    let interval = Region::new_box([-1.0], [2.0]).expect("an interval");
    revealed_starts::<1>(gpu, &drawn(interval, 7), 0);
}

#[test]
fn pairs_have_the_host_bits() {
    let Some(mut gpu) = gpu() else { return };
    let spec = RolloutSpec::new(1, 0.5).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let pairs = Pairs {
        nominal: drawn(Region::new_box([-1.0; 3], [1.0, 2.0, 3.0]).expect("a box"), 11),
        radius: 0.1,
        stream: Stream::new(12, purpose::DEVIATION_PERTURBATION, 0),
    };
    let task = DeviationTask {
        pairs: pairs.clone(),
        range: 5..305,
        spec,
        tightening: &tightening,
        control: PairControl::Replay,
    };
    for coordinate in 0..3 {
        let plant = Plant::of(Reveal::<3>(coordinate), Idle);
        let (back, _, found) = deviation(gpu, &plant, &task);
        gpu = back;
        let expected = (5..305).map(|i| pairs.pair(i).map(|x| x[coordinate]));
        let (nominal, perturbed): (Vec<f32>, Vec<f32>) =
            expected.map(|[nominal, perturbed]| (nominal, perturbed)).unzip();
        assert_eq!(bits(found.iter().map(|m| m.nominal)), bits(nominal));
        assert_eq!(bits(found.iter().map(|m| m.perturbed)), bits(perturbed));
    }
}
