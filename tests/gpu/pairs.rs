//! Pairs rolled out side by side against the f64 oracle.

use std::array::from_fn;

use reachcast::backend::gpu::Gpu;
use reachcast::policy::Policy;
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{
    DeviationTask, Farthest, Fold, PairControl, PairMeasure, Pairs, Plant, Region, RolloutSpec,
    Stream, Tightening, pair_measures,
};
use reachcast::scenario::purpose;
use reachcast::system::System;

use crate::systems::{Idle, Reveal};
use crate::{band, deviation, drawn, each_way, gpu, race_policy, ramp, whole_box};

#[test]
fn deviation_of_the_race_against_f64() {
    each_way(race_deviation);
}

fn race_deviation(mut gpu: Gpu) {
    let (system, policy) = (DroneRace::default(), race_policy());
    let plant = Plant { system: &system, policy: &policy };
    let spec = RolloutSpec::new(30, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        let task = DeviationTask {
            pairs: Pairs {
                nominal: drawn(whole_box(&system), 25),
                radius: 0.1,
                stream: Stream::new(25, purpose::DEVIATION_PERTURBATION, 0),
            },
            range: 100..400,
            spec,
            tightening: &tightening,
            control,
        };
        let (back, farthest, found) = deviation(gpu, plant, &task);
        gpu = back;
        assert_pairs_close_to_f64(plant, &task, &found);
        assert_farthest_close_to_f64(plant, &task, &farthest);
    }
}

/// Both measures of a pair in f32 on the host.
fn pair_f32<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_>,
    [mut a, mut b]: [[f32; NX]; 2],
) -> [f32; 2] {
    let (system, policy) = (plant.system, plant.policy);
    let mut folds = [Fold::new(), Fold::new()];
    let losses = task.tightening.target.iter().zip(&task.tightening.constraint);
    for (target, constraint) in losses {
        let margins = (system.target(a) - target, system.constraint(a) - constraint);
        folds[0].add(margins.0, margins.1, task.spec.gamma);
        folds[1].add(system.target(b), system.constraint(b), task.spec.gamma);
        let u = policy.control(a);
        b = match task.control {
            PairControl::Replay => system.step(b, u),
            PairControl::ClosedLoop => system.step(b, policy.control(b)),
        };
        a = system.step(a, u);
    }
    folds.map(|fold| fold.measure())
}

fn assert_pairs_close_to_f64<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_>,
    found: &[PairMeasure],
) where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let pairs = task.range.clone().map(|pair| {
        let starts = task.pairs.pair(pair).map(|x| from_fn(|i| x[i]));
        let (nominal, perturbed) =
            pair_measures(plant, starts, &task.spec, task.tightening, task.control);
        (pair_f32(plant, task, starts), [nominal, perturbed])
    });
    let pairs: Vec<([f32; 2], [f64; 2])> = pairs.collect();
    for side in 0..2 {
        let band = band(pairs.iter().map(|(host, oracle)| (host[side], oracle[side])));
        for (i, ((_, oracle), found)) in pairs.iter().zip(found).enumerate() {
            let gap = (f64::from([found.nominal, found.perturbed][side]) - oracle[side]).abs();
            assert!(gap <= band, "pair {i}: {found:?}, f64 {oracle:?}, band {band}");
        }
    }
}

/// Distances of a pair at each step.
fn distances<R: Real, S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_>,
    pair: u64,
) -> Vec<R> {
    let [mut a, mut b] = task.pairs.pair(pair).map(|x| from_fn(|i| R::lit(x[i])));
    let mut all = Vec::new();
    for _ in 0..=task.spec.horizon {
        let gaps = a.iter().zip(&b).map(|(&a, &b)| b - a);
        all.push(gaps.fold(R::lit(0.0), |sum, gap| sum + gap * gap).sqrt());
        let u = plant.policy.control(a);
        b = match task.control {
            PairControl::Replay => plant.system.step(b, u),
            PairControl::ClosedLoop => plant.system.step(b, plant.policy.control(b)),
        };
        a = plant.system.step(a, u);
    }
    all
}

fn assert_farthest_close_to_f64<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_>,
    farthest: &[Farthest],
) where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let first = task.range.start;
    let pairs = || task.range.clone();
    let all: Vec<Vec<f64>> = pairs().map(|pair| distances(plant, task, pair)).collect();
    let host: Vec<Vec<f32>> = pairs().map(|pair| distances(plant, task, pair)).collect();
    assert_eq!(farthest.len(), task.spec.horizon as usize + 1);
    for (t, found) in farthest.iter().enumerate() {
        let largest = all.iter().map(|distances| distances[t]).fold(0.0, f64::max);
        let band = band(host.iter().zip(&all).map(|(host, all)| (host[t], all[t])));
        let gap = (f64::from(found.distance) - largest).abs();
        assert!(gap <= band, "step {t}: {found:?}, f64 {largest}, band {band}");
        let claimed = all[(found.pair - first) as usize][t];
        let gap = (claimed - largest).abs();
        assert!(gap <= 2.0 * band, "step {t}: pair {} is at {claimed}, {largest}", found.pair);
    }
}

#[test]
fn equal_distances_go_to_the_first_pair() {
    let Some(gpu) = gpu() else { return };
    let system = Reveal::<3>(0);
    let plant = Plant { system: &system, policy: &Idle };
    let spec = RolloutSpec::new(40, 0.5).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = DeviationTask {
        pairs: Pairs {
            nominal: drawn(Region::new_box([-1.0; 3], [1.0; 3]).expect("a box"), 11),
            radius: 0.1,
            stream: Stream::new(12, purpose::DEVIATION_PERTURBATION, 0),
        },
        range: 77..777,
        spec,
        tightening: &tightening,
        control: PairControl::Replay,
    };
    let (_, farthest, _) = deviation::<_, _, 3, 1>(gpu, plant, &task);
    assert!(farthest[0].distance > 0.09 && farthest[0].distance < 0.1001);
    let together = Farthest { distance: 0.0, pair: 77 };
    assert!(farthest[1..].iter().all(|found| *found == together), "{farthest:?}");
}
