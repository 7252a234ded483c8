//! Adversaries within the certified balls, and trajectories within the tubes.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use reachcast::rollout::{PairControl, replay};
use reachcast::tube::Tube;

use crate::cases::{Case, cases, spec, with_radii};

/// Rounding of an f64 rollout of these plants, far above what it is.
const ROUNDING: f64 = 1e-9;

/// Where a rollout ends.
#[derive(Clone, Copy, PartialEq)]
enum Until {
    /// Where it is decided.
    Decided,
    /// At the horizon.
    Horizon,
}

/// The measure of a perturbed rollout in f64.
fn measure(case: &Case, nominal: &[Vec<f64>], start: &[f64], until: Until) -> f64 {
    let Case { plant, control, horizon, .. } = case;
    let (mut x, mut safe, mut best) = (start.to_vec(), f64::INFINITY, f64::NEG_INFINITY);
    for step in 0..=*horizon {
        safe = safe.min(plant.model.constraint_at(&x, step));
        best = best.max(safe.min(plant.model.target_at(&x, step)));
        let decided = best > 0.0 || safe <= 0.0;
        if step == *horizon || (decided && until == Until::Decided) {
            break;
        }
        let driver = match control {
            PairControl::Replay => &nominal[step as usize],
            PairControl::ClosedLoop => &x,
        };
        x = plant.model.next(&x, &plant.control(driver, step), step);
    }
    best
}

/// A direction, of length 1.
fn direction(random: &mut StdRng, size: usize) -> Vec<f64> {
    loop {
        let d: Vec<f64> = (0..size).map(|_| random.random_range(-1.0..1.0)).collect();
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length > 0.1 {
            return d.into_iter().map(|x| x / length).collect();
        }
    }
}

/// The start moved by `radius` along `d`, which has length 1 or less, a hair inside of the ball.
fn moved(start: &[f32], d: &[f64], radius: f64) -> Vec<f64> {
    let inside = radius * (1.0 - 1e-12);
    start.iter().zip(d).map(|(x, d)| f64::from(*x) + inside * d).collect()
}

/// The direction in which the measure falls at `d`, from differences.
fn downhill(case: &Case, nominal: &[Vec<f64>], start: &[f32], d: &[f64], radius: f64) -> Vec<f64> {
    let slope = |i: usize| {
        let [ahead, back] = [1e-4, -1e-4].map(|step| {
            let mut other = d.to_vec();
            other[i] += step;
            measure(case, nominal, &moved(start, &other, radius), Until::Horizon)
        });
        back - ahead
    };
    let slopes: Vec<f64> = (0..d.len()).map(slope).collect();
    let length = slopes.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length == 0.0 { d.to_vec() } else { slopes.into_iter().map(|x| x / length).collect() }
}

/// Failures and trials among perturbations of one start: random ones, and some that follow the gradient.
fn attack(case: &Case, start: &[f32], radius: f64, trials: u64, seed: u64) -> (u64, u64) {
    let mut random = StdRng::seed_from_u64(seed);
    let nominal = replay::states::<f64>(&case.plant, start, case.horizon);
    let (mut failures, mut done) = (0, 0);
    let fails =
        |d: &[f64]| measure(case, &nominal, &moved(start, d, radius), Until::Decided) <= 0.0;
    while done < trials {
        let mut d = direction(&mut random, start.len());
        if done % 50 == 0 {
            for _ in 0..3 {
                d = downhill(case, &nominal, start, &d, radius);
                failures += u64::from(fails(&d));
                done += 1;
            }
        }
        let length = random.random_range(0.0_f64..1.0).powf(0.2);
        let shorter: Vec<f64> = d.iter().map(|x| length * x).collect();
        failures += u64::from(fails(&d)) + u64::from(fails(&shorter));
        done += 2;
    }
    (failures, done)
}

/// Trials at the certified radius itself, where a bound that is too wide by a hundredth already fails.
fn assert_no_failure(case: &Case, starts: usize, trials: u64) {
    let found = with_radii(case, starts);
    let mut radii: Vec<f64> = found.iter().map(|(_, radius)| *radius).collect();
    radii.sort_by(f64::total_cmp);
    let median = radii[radii.len() / 2];
    let certified: Vec<_> = (0..).zip(found).filter(|(_, (_, radius))| *radius > 0.0).collect();
    let each = trials / certified.len() as u64 + 1;
    let counts = certified.par_iter().map(|(i, (x, radius))| attack(case, x, *radius, each, *i));
    let (failures, done) = counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    println!(
        "{}: median certified radius {median:.5} of {} starts, {failures} of {done} perturbations fail",
        case.name,
        radii.len()
    );
    assert!(median > 0.0, "{}: {radii:?}", case.name);
    assert_eq!(failures, 0, "{}", case.name);
}

#[test]
fn nothing_certified_fails() {
    for case in cases() {
        assert_no_failure(&case, 10, 400);
    }
}

/// A million perturbations of each plant.
#[test]
#[ignore = "takes many minutes"]
fn nothing_certified_fails_in_a_million() {
    for case in cases() {
        assert_no_failure(&case, 100, 1_000_000);
    }
}

/// A twentieth beyond the certified radius the same adversary does find failures around some starts: it is able to.
#[test]
fn the_adversary_finds_failures_beyond() {
    let [case, ..] = cases();
    let mut failing = 0;
    let found = with_radii(&case, 12);
    for (i, (x, radius)) in (0..).zip(&found) {
        failing += u64::from(attack(&case, x, 1.05 * radius, 100, i).0 > 0);
    }
    assert!(failing >= 3, "{failing} of {}", found.len());
}

/// Every sampled trajectory is inside the tube, at every step.
#[test]
fn tubes_hold_every_trajectory() {
    let mut held = 0;
    for case in cases() {
        let tube = Tube::new(&case.plant, spec(case.horizon), case.control);
        let mut random = StdRng::seed_from_u64(5);
        for (x, radius) in with_radii(&case, 4) {
            let nominal = replay::states::<f64>(&case.plant, &x, case.horizon);
            let enclosed = tube.nominal(&x);
            for radius in [0.0, radius, 2.0 * radius] {
                let sides = tube.states(&enclosed, radius);
                for _ in 0..10 {
                    let d = direction(&mut random, x.len());
                    let mut y = moved(&x, &d, radius);
                    for (step, sides) in (0..).zip(&sides) {
                        for (y, side) in y.iter().zip(sides) {
                            let (low, high) = (side.low - ROUNDING, side.high + ROUNDING);
                            assert!(low <= *y && *y <= high, "{} {step}: {y} {side:?}", case.name);
                            held += 1;
                        }
                        let driver = match case.control {
                            PairControl::Replay => &nominal[step as usize],
                            PairControl::ClosedLoop => &y,
                        };
                        let u = case.plant.control(driver, step);
                        y = case.plant.model.next(&y, &u, step);
                    }
                }
            }
        }
    }
    assert!(held > 50_000, "{held}");
}
