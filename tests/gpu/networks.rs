//! Networks that the rollouts run themselves, against the f64 oracle and against layers.

use reachcast::Error;
use reachcast::backend::gpu::{Form, Gpu, NetworkKernels};
use reachcast::model::Plant;
use reachcast::policy::{Activation, Mlp};
use reachcast::race::DroneRace;
use reachcast::rollout::{
    DeviationTask, Farthest, NON_FINITE, PairControl, PairMeasure, Pairs, Query, ReachAvoidTask,
    RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::scenario::purpose;

use crate::measures::assert_close_to_f64;
use crate::systems::Count;
use crate::{
    deviation, drawn, each_way, gpu, measures, race_policy, random_network, reach_avoid, whole_box,
};

pub(crate) fn fusing() -> Option<Gpu> {
    gpu().map(|gpu| gpu.with_networks(NetworkKernels::Fused))
}

/// A tightening under which the measure is the target margin of the last state, undiscounted.
fn last_state_only(horizon: u32) -> (RolloutSpec, Tightening) {
    let spec = RolloutSpec::new(horizon, 1.0).expect("a horizon");
    let mut target = vec![1e3; horizon as usize + 1];
    target[horizon as usize] = 0.0;
    (spec, Tightening::losing(target.clone(), vec![-1e3; target.len()]))
}

#[test]
fn last_states_under_networks_of_every_width_and_depth() {
    let Some(mut gpu) = fusing() else { return };
    let system = DroneRace::default();
    let (spec, tightening) = last_state_only(12);
    let cases = [
        (vec![12, 64, 64, 64, 3], Activation::Relu),
        (vec![12, 128, 128, 3], Activation::Relu),
        (vec![12, 67, 3], Activation::Tanh),
        (vec![12, 5, 9, 3], Activation::Silu),
        (vec![12, 3], Activation::Relu),
    ];
    for (widths, activation) in cases {
        let task = ReachAvoidTask {
            starts: drawn(whole_box(&system), 31),
            range: 0..100,
            spec,
            tightening: &tightening,
            query: Query::Measure,
        };
        let plant = Plant::of(system, random_network(&widths, activation));
        let (back, found) = measures(gpu, &plant, &task);
        gpu = back;
        assert!(found.iter().all(|margin| *margin > -900.0), "the last state decides");
        assert_close_to_f64(&plant, &task, &found);
    }
}

#[test]
fn batches_around_whole_workgroups() {
    let Some(mut gpu) = fusing() else { return };
    let system = DroneRace::default();
    let plant = Plant::of(system, race_policy());
    let (spec, tightening) = last_state_only(3);
    let mut task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 32),
        range: 0..600,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (back, all) = measures(gpu, &plant, &task);
    gpu = back;
    assert_close_to_f64(&plant, &task, &all);
    for count in [1, 63, 64, 65, 127, 255, 256, 257] {
        task.range = 7..7 + count;
        let (back, found) = measures(gpu, &plant, &task);
        gpu = back;
        assert_eq!(found, all[7..7 + count as usize], "{count} trajectories");
    }
}

/// Whoever adds them up, sums are one chain over ascending inputs: which form a batch gets must not be
/// seen in a single bit.
#[test]
fn a_trajectory_has_the_same_bits_in_every_form() {
    let tiles = |trajectories, neurons, columns| Form::Tiles { trajectories, neurons, columns };
    let slices = |trajectories| Form::Slices { trajectories };
    let rows = |trajectories| Form::Rows { trajectories };
    for (widths, activation, forms) in [
        (vec![12, 64, 64, 3], Activation::Relu, vec![tiles(64, 8, 8), slices(64), rows(8)]),
        (vec![12, 70, 72, 3], Activation::Silu, vec![tiles(8, 4, 4), slices(32)]),
        (vec![12, 13, 30, 3], Activation::Tanh, vec![tiles(32, 8, 4), tiles(64, 4, 8)]),
        (vec![12, 3], Activation::Relu, vec![tiles(64, 8, 8), tiles(8, 4, 4)]),
    ] {
        let plant = Plant::of(DroneRace::default(), random_network(&widths, activation));
        let mut first = None;
        for form in forms {
            let Some(gpu) = gpu() else { return };
            let found = in_form(gpu.with_networks(NetworkKernels::Form(form)), &plant);
            assert_eq!(first.get_or_insert(found.clone()), &found, "{widths:?} {form:?}");
        }
    }
}

/// Measures and pairs of a few starts of the race, the measures close to those in f64.
fn in_form(gpu: Gpu, plant: &Plant) -> (Vec<f32>, Vec<Farthest>, Vec<PairMeasure>) {
    let (spec, tightening) = last_state_only(3);
    let nominal = drawn(whole_box(&DroneRace::default()), 37);
    let starts = ReachAvoidTask {
        starts: nominal.clone(),
        range: 0..70,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let stream = Stream::new(37, purpose::DEVIATION_PERTURBATION, 0);
    let pairs = DeviationTask {
        pairs: Pairs { nominal, radius: 0.1, stream },
        range: 0..70,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    let (gpu, found) = measures(gpu, plant, &starts);
    assert_close_to_f64(plant, &starts, &found);
    let (_, farthest, pairs) = deviation(gpu, plant, &pairs);
    (found, farthest, pairs)
}

#[test]
fn fused_chunks_join_without_a_seam() {
    let Some(gpu) = fusing() else { return };
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 8, 3], Activation::Relu));
    let (spec, tightening) = last_state_only(2);
    let pairs = |range| DeviationTask {
        pairs: Pairs {
            nominal: drawn(whole_box(&system), 33),
            radius: 0.1,
            stream: Stream::new(33, purpose::DEVIATION_PERTURBATION, 0),
        },
        range,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    let seam = 1 << 16;
    let (gpu, farthest, whole) = deviation(gpu, &plant, &pairs(0..seam + 300));
    let (gpu, before, left) = deviation(gpu, &plant, &pairs(0..seam - 100));
    let (_, after, right) = deviation(gpu, &plant, &pairs(seam - 100..seam + 300));
    assert_eq!(whole, [left, right].concat());
    let merged: Vec<_> = before.iter().zip(after).map(|(a, b)| a.merge(b)).collect();
    assert_eq!(farthest, merged);
}

#[test]
fn a_decided_sign_stays_when_the_state_overflows() {
    each_way(|gpu| {
        // Not safe from t = 3 on; infinite at t = 7, within the same dispatch.
        let mut constraint = vec![0.0; 8];
        constraint[3] = 1e7;
        let tightening = Tightening::losing(vec![0.0; 8], constraint);
        let mut task = ReachAvoidTask {
            starts: Starts::listed(&[[-20.0, 2.1]]),
            range: 0..1,
            spec: RolloutSpec::new(7, 1.0).expect("a horizon"),
            tightening: &tightening,
            query: Query::Sign,
        };
        let plant = Plant::of(Count, random_network(&[2, 4, 1], Activation::Tanh));
        let (gpu, sign) = measures(gpu, &plant, &task);
        assert_eq!(sign, [-1.0]);
        task.query = Query::Measure;
        assert_eq!(measures(gpu, &plant, &task).1, [NON_FINITE]);
    });
}

/// Kernels that a rollout of 40 steps dispatches, and how often.
fn dispatches(gpu: Gpu, policy: &Mlp) -> Vec<(&'static str, u64)> {
    let system = DroneRace::default();
    let (spec, tightening) = last_state_only(40);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 34),
        range: 0..10,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    gpu.time_kernels(true);
    let (gpu, _) = measures(gpu, &Plant::of(system, policy.clone()), &task);
    gpu.take_kernel_times().iter().map(|time| (time.kernel, time.dispatches)).collect()
}

#[test]
fn a_fused_rollout_has_no_dispatches_of_layers() {
    let policy = random_network(&[12, 16, 16, 3], Activation::Relu);
    let Some(gpu) = gpu() else { return };
    let layered = dispatches(gpu.with_networks(NetworkKernels::Layered), &policy);
    assert_eq!(layered, [("sample", 1), ("mlp", 120), ("reach_avoid", 41)]);
    let Some(gpu) = fusing() else { return };
    // 41 states in submissions of at most 32.
    assert_eq!(dispatches(gpu, &policy), [("sample", 1), ("reach_avoid", 2)]);
}

#[test]
fn a_network_too_wide_to_fuse_is_refused() {
    let Some(gpu) = fusing() else { return };
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 200, 3], Activation::Relu));
    let (spec, tightening) = last_state_only(1);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 35),
        range: 0..1,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, result) = reach_avoid(gpu, &plant, &task);
    let Err(Error::Device(problem)) = result else { panic!("{result:?}") };
    assert!(problem.contains("200") && problem.contains("128"), "{problem}");
}
