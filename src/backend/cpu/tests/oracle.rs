//! Measures, signs and deviations against scalar loops in f32 and the reference in f64.

use super::fixture::*;
use crate::policy::{Activation, Mlp, Policy};
use crate::race::system::DroneRace;
use crate::rollout::{
    DeviationTask, Farthest, Fold, PairControl, PairMeasure, Query, RolloutSpec, Tightening, replay,
};
use crate::system::System;

/// Networks of odd widths with every activation, some with norms.
fn networks() -> Vec<Mlp> {
    let mut networks = Vec::new();
    let shapes: [&[usize]; 5] =
        [&[12, 3], &[12, 1, 3], &[12, 3, 7, 3], &[12, 64, 64, 3], &[12, 100, 17, 3]];
    for widths in shapes {
        for activation in [Activation::Relu, Activation::Tanh, Activation::Silu] {
            for output in [Activation::Tanh, Activation::Identity] {
                networks.push(network(widths, activation, output));
            }
        }
    }
    for activation in Activation::ALL {
        networks.push(network(&[12, 19, 3], activation, Activation::Identity));
        networks.push(normed(&[12, 19, 9, 3], activation));
    }
    networks
}

/// The states x_0..=x_T of the race in f32, step after step as the types have it.
fn scalar_states<P: Policy<12, 3>>(
    policy: &P,
    start: [f32; 12],
    spec: &RolloutSpec,
) -> Vec<[f32; 12]> {
    let system = DroneRace::default();
    let mut states = vec![start];
    for t in 0..spec.horizon as usize {
        let x = states[t];
        states.push(system.step(x, policy.control(x)));
    }
    states
}

/// Measure of states that are all finite, in f32, one trajectory at a time.
fn scalar_measure<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    states: &[[f32; NX]],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f32 {
    let mut fold = Fold::new();
    for (t, x) in states.iter().enumerate() {
        let target = system.target(*x) - tightening.target[t];
        let constraint = system.constraint(*x) - tightening.constraint[t];
        fold.add(target, constraint, spec.gamma);
    }
    fold.measure()
}

/// The kernels sum in the order of the scalar network, so their error is its error but for the
/// rounding that fused multiply-add saves or moves: measured, the worst is 1.11 times its worst.
#[test]
fn networks_are_as_near_to_f64_as_the_scalar_loop() {
    const COUNT: u64 = 150;
    let (system, spec) = (DroneRace::default(), spec());
    let tightening = tightening(&spec);
    let mut quotient = 0.0_f64;
    for policy in networks() {
        let plant = race_under(policy.clone());
        let (mut truth, mut worst_scalar) = (Vec::new(), 0.0_f64);
        for index in 0..COUNT {
            let start = race_starts().start_array(index);
            truth.push(replay::measure(&plant, &start, &spec, &tightening));
            let states = scalar_states(&policy, start, &spec);
            let scalar = scalar_measure(&system, &states, &spec, &tightening);
            worst_scalar = worst_scalar.max((f64::from(scalar) - truth[index as usize]).abs());
        }
        for cpu in every_cpu() {
            let got = race(&cpu, &plant, 0..COUNT, Query::Measure);
            for (index, (got, truth)) in got.iter().zip(&truth).enumerate() {
                let error = (f64::from(*got) - truth).abs();
                quotient = quotient.max(error / worst_scalar);
                assert!(
                    error <= 2.0 * worst_scalar,
                    "{} on {}: start {index} is {got}, in f64 {truth}; a scalar loop is within \
                     {worst_scalar}",
                    plant.controller.name,
                    cpu.device()
                );
            }
        }
    }
    println!("worst error is {quotient:.2} times that of the scalar loop");
}

#[test]
fn signs_are_those_of_the_measures() {
    let (plant, cpu) = (race_under(race_policy()), cpu(2));
    let measures = race(&cpu, &plant, 0..100_000, Query::Measure);
    let signs = race(&cpu, &plant, 0..100_000, Query::Sign);
    let mut positive = 0;
    for (index, (measure, sign)) in measures.iter().zip(&signs).enumerate() {
        let expected = if *measure > 0.0 { 1.0 } else { -1.0 };
        assert_eq!(*sign, expected, "start {index} has the measure {measure}");
        positive += u32::from(*measure > 0.0);
    }
    assert!((5_000..95_000).contains(&positive), "{positive} of either sign");
}

/// Distances, farthest pairs and measures of a formula are those of a scalar f32 loop to the bit.
#[test]
fn deviation_of_a_formula_is_the_scalar_loop() {
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        let (system, spec) = (DroneRace::default(), spec());
        let (tightening, plain) = (tightening(&spec), Tightening::none(&spec));
        let task = DeviationTask {
            pairs: race_pairs(),
            range: 3..130,
            spec,
            tightening: &tightening,
            control,
        };
        let mut farthest = vec![Farthest::NONE; 31];
        let mut measures = Vec::new();
        for pair in task.range.clone() {
            let starts = array_pair(&task, pair);
            let states = scalar_pair(starts, &spec, control);
            for (t, farthest) in farthest.iter_mut().enumerate() {
                let gaps = states[0][t].iter().zip(&states[1][t]);
                let square = gaps.fold(0.0, |sum, (x, y)| sum + (y - x) * (y - x));
                let distance = f32::sqrt(square);
                if distance > farthest.distance {
                    *farthest = Farthest { distance, pair };
                }
            }
            measures.push(PairMeasure {
                nominal: scalar_measure(&system, &states[0], &spec, &tightening),
                perturbed: scalar_measure(&system, &states[1], &spec, &plain),
            });
        }
        let found = deviation(&cpu(2), &race_under(Damping), &task);
        assert_eq!(found, Measured { farthest, measures });
    }
}

/// The states of both rollouts of a pair under [`Damping`], in f32.
fn scalar_pair(
    [nominal, mut perturbed]: [[f32; 12]; 2],
    spec: &RolloutSpec,
    control: PairControl,
) -> [Vec<[f32; 12]>; 2] {
    let nominal = scalar_states(&Damping, nominal, spec);
    let mut states = vec![perturbed];
    for x in &nominal[..spec.horizon as usize] {
        let driver = match control {
            PairControl::Replay => *x,
            PairControl::ClosedLoop => perturbed,
        };
        perturbed = DroneRace::default().step(perturbed, Damping.control(driver));
        states.push(perturbed);
    }
    [nominal, states]
}

/// Under a network the measures of pairs are near those in f64, and the two ways to drive the
/// perturbed rollout differ.
#[test]
fn deviation_of_a_network_is_near_f64() {
    let (plant, spec) = (race_under(race_policy()), spec());
    let tightening = tightening(&spec);
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        let task = DeviationTask {
            pairs: race_pairs(),
            range: 0..200,
            spec,
            tightening: &tightening,
            control,
        };
        let Measured { measures, .. } = deviation(&cpu(2), &plant, &task);
        let mut worst = 0.0_f64;
        for (pair, measure) in measures.iter().enumerate() {
            let [nominal, perturbed] = task.pairs.pair(pair as u64);
            let starts = [&nominal[..], &perturbed];
            let (nominal, perturbed) =
                replay::pair_measures(&plant, starts, &spec, &tightening, control);
            worst = worst.max((f64::from(measure.nominal) - nominal).abs());
            worst = worst.max((f64::from(measure.perturbed) - perturbed).abs());
        }
        println!("{control:?}: worst error {worst:e}");
        // Margins are of the order of 10, an f32 has 24 bits, and errors add up over 30 steps.
        assert!(worst < 30.0 * 10.0 * f64::from(f32::EPSILON), "{control:?}: {worst}");
    }
}

/// A pair of the race: nominal, then perturbed.
fn array_pair(task: &DeviationTask<'_>, pair: u64) -> [[f32; 12]; 2] {
    task.pairs.pair(pair).map(|start| std::array::from_fn(|i| start[i]))
}
