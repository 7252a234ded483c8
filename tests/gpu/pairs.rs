//! Pairs rolled out side by side against the f64 oracle.

use reachcast::backend::gpu::Gpu;
use reachcast::model::Plant;
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{
    DeviationTask, Farthest, Fold, PairControl, PairMeasure, Pairs, Region, RolloutSpec, Stream,
    Tightening, replay,
};
use reachcast::scenario::purpose;

use crate::systems::{Idle, Reveal};
use crate::{band, deviation, drawn, each_way, gpu, race_policy, ramp, whole_box};

#[test]
fn deviation_of_the_race_against_f64() {
    each_way(race_deviation);
}

fn race_deviation(mut gpu: Gpu) {
    let system = DroneRace::default();
    let plant = Plant::of(system, race_policy());
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
        let (back, farthest, found) = deviation(gpu, &plant, &task);
        gpu = back;
        assert_pairs_close_to_f64(&plant, &task, &found);
        assert_farthest_close_to_f64(&plant, &task, &farthest);
    }
}

/// Both measures of a pair in f32 on the host.
fn pair_f32(plant: &Plant, task: &DeviationTask<'_>, pair: u64) -> [f32; 2] {
    let model = &plant.model;
    let mut folds = [Fold::new(), Fold::new()];
    let losses = task.tightening.target.iter().zip(&task.tightening.constraint);
    let states = (0..).zip(pair_states::<f32>(plant, task, pair));
    for ((step, [a, b]), (target, constraint)) in states.zip(losses) {
        let margins = |x: &[f32]| (model.target_at(x, step), model.constraint_at(x, step));
        let (nominal, perturbed) = (margins(&a), margins(&b));
        folds[0].add(nominal.0 - target, nominal.1 - constraint, task.spec.gamma);
        folds[1].add(perturbed.0, perturbed.1, task.spec.gamma);
    }
    folds.map(|fold| fold.measure())
}

fn assert_pairs_close_to_f64(plant: &Plant, task: &DeviationTask<'_>, found: &[PairMeasure]) {
    let pairs = task.range.clone().map(|pair| {
        let [nominal, perturbed] = task.pairs.pair(pair);
        let starts = [&nominal[..], &perturbed];
        let (nominal, perturbed) =
            replay::pair_measures(plant, starts, &task.spec, task.tightening, task.control);
        (pair_f32(plant, task, pair), [nominal, perturbed])
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

/// Both states of a pair at each step, `[T + 1]` of `[2, states]`.
fn pair_states<R: Real>(plant: &Plant, task: &DeviationTask<'_>, pair: u64) -> Vec<[Vec<R>; 2]> {
    let [mut a, mut b]: [Vec<R>; 2] =
        task.pairs.pair(pair).map(|x| x.into_iter().map(R::lit).collect());
    let mut all = Vec::new();
    for step in 0..=task.spec.horizon {
        let u = plant.control(&a, step);
        let v = match task.control {
            PairControl::Replay => u.clone(),
            PairControl::ClosedLoop => plant.control(&b, step),
        };
        let next = [plant.model.next(&a, &u, step), plant.model.next(&b, &v, step)];
        all.push([a, b]);
        [a, b] = next;
    }
    all
}

/// Distances of a pair at each step.
fn distances<R: Real>(plant: &Plant, task: &DeviationTask<'_>, pair: u64) -> Vec<R> {
    let distance = |[a, b]: &[Vec<R>; 2]| {
        let gaps = a.iter().zip(b).map(|(&a, &b)| b - a);
        gaps.fold(R::lit(0.0), |sum, gap| sum + gap * gap).sqrt()
    };
    pair_states(plant, task, pair).iter().map(distance).collect()
}

fn assert_farthest_close_to_f64(plant: &Plant, task: &DeviationTask<'_>, farthest: &[Farthest]) {
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
    let plant = Plant::of(Reveal::<3>(0), Idle);
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
    let (_, farthest, _) = deviation(gpu, &plant, &task);
    assert!(farthest[0].distance > 0.09 && farthest[0].distance < 0.1001);
    let together = Farthest { distance: 0.0, pair: 77 };
    assert!(farthest[1..].iter().all(|found| *found == together), "{farthest:?}");
}
