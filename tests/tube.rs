//! Deterministic certificates: what they certify, and that nothing certified fails.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod common;

use std::path::Path;

use common::{ClosedForm, race_policy};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use reachcast::model::{Plant, text};
use reachcast::policy::Mlp;
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{PairControl, Purpose, Region, RolloutSpec, StateList, Stream, replay};
use reachcast::scenario::deterministic::{Deterministic, Kind};
use reachcast::system::{Axis, BangBang, DoubleIntegrator, System};
use reachcast::tube::Tube;

/// Rounding of an f64 rollout of these plants, far above what it is.
const ROUNDING: f64 = 1e-9;

fn spec(horizon: u32) -> RolloutSpec {
    RolloutSpec::new(horizon, 0.95).unwrap()
}

/// A carried file of `configs`.
fn carried(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)
}

fn race() -> Plant {
    Plant::of(DroneRace::default(), race_policy())
}

fn bang_bang() -> Plant {
    Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 })
}

fn learned() -> Plant {
    let network = Mlp::load(&carried("policies/double_integrator_policy.safetensors")).unwrap();
    Plant::of(DoubleIntegrator::default(), network)
}

fn dubins() -> Plant {
    let written = std::fs::read_to_string(carried("models/dubins.toml")).unwrap();
    text::read(&written, "dubins.toml", Path::new(".")).unwrap().plant().unwrap()
}

/// Starts over the default box of the plant.
fn starts(plant: &Plant, count: u64) -> StateList {
    let side = |end: fn(&Axis) -> f32| plant.model.states.iter().map(end).collect::<Vec<f32>>();
    let region = Region::new_box(side(|axis| axis.low), side(|axis| axis.high)).unwrap();
    let stream = Stream::new(7, Purpose::USER, 3);
    StateList::new(plant.model.states.len()).with((0..count).map(|i| region.point(stream, i)))
}

/// A plant, how it is driven, steps, kind, and the radius that its tests look at.
struct Case {
    name: &'static str,
    plant: Plant,
    control: PairControl,
    horizon: u32,
    kind: Kind,
    most: f64,
}

fn cases() -> [Case; 5] {
    use PairControl::{ClosedLoop, Replay};
    let case = |name, plant, control, horizon, kind, most| Case {
        name,
        plant,
        control,
        horizon,
        kind,
        most,
    };
    [
        case("race, replay", race(), Replay, 30, Kind::Pieces, 0.3),
        case("race, network", race(), ClosedLoop, 30, Kind::Tube, 0.1),
        case("double integrator", bang_bang(), ClosedLoop, 30, Kind::Tube, 0.3),
        case("double integrator, network", learned(), ClosedLoop, 30, Kind::Tube, 0.3),
        case("dubins", dubins(), ClosedLoop, 60, Kind::Tube, 0.2),
    ]
}

/// The measure of a perturbed rollout in f64, as it stands at the first success.
fn measure(case: &Case, nominal: &[Vec<f64>], start: &[f64]) -> f64 {
    let Case { plant, control, horizon, .. } = case;
    let (mut x, mut safe, mut best) = (start.to_vec(), f64::INFINITY, f64::NEG_INFINITY);
    for step in 0..=*horizon {
        safe = safe.min(plant.model.constraint_at(&x, step));
        best = best.max(safe.min(plant.model.target_at(&x, step)));
        if best > 0.0 || safe <= 0.0 || step == *horizon {
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

/// The measure without a stop, whose gradient leads an adversary.
fn whole_measure(case: &Case, nominal: &[Vec<f64>], start: &[f64]) -> f64 {
    let Case { plant, control, horizon, .. } = case;
    let (mut x, mut safe, mut best) = (start.to_vec(), f64::INFINITY, f64::NEG_INFINITY);
    for step in 0..=*horizon {
        safe = safe.min(plant.model.constraint_at(&x, step));
        best = best.max(safe.min(plant.model.target_at(&x, step)));
        let driver = match control {
            PairControl::Replay => &nominal[step as usize],
            PairControl::ClosedLoop => &x,
        };
        x = plant.model.next(&x, &plant.control(driver, step), step);
    }
    best
}

/// A direction uniform on the sphere.
fn direction(random: &mut StdRng, size: usize) -> Vec<f64> {
    loop {
        let d: Vec<f64> = (0..size).map(|_| random.random_range(-1.0..1.0)).collect();
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (0.1..1.0).contains(&length) {
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
            whole_measure(case, nominal, &moved(start, &other, radius))
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
    let fails = |d: &[f64]| measure(case, &nominal, &moved(start, d, radius)) <= 0.0;
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

/// Certified radii of the first starts of a case that have one.
fn with_radii(case: &Case, count: usize) -> Vec<(Vec<f32>, f64)> {
    let certificate =
        Deterministic::new(&case.plant, spec(case.horizon), case.control, case.kind).unwrap();
    let none = reachcast::rollout::Tightening::none(&spec(case.horizon));
    let starts = starts(&case.plant, 40 * count as u64);
    let succeeds = |x: &&[f32]| replay::measure(&case.plant, x, &spec(case.horizon), &none) > 0.0;
    let reached: Vec<&[f32]> = starts.iter().filter(succeeds).take(count).collect();
    let list = StateList::new(starts.view().size()).with(reached);
    let radii = certificate.radii(list.view(), case.most);
    list.iter().map(<[f32]>::to_vec).zip(radii).collect()
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

/// The certified radius is no more than a few hundredths short of the first failure along the gradient: a bound
/// that is much too narrow, or a test that looks at nothing, would pass the others.
#[test]
fn radii_are_tight_where_the_plant_is_linear() {
    let [case, ..] = cases();
    let mut tight = 0;
    let found = with_radii(&case, 12);
    for (i, (x, radius)) in (0..).zip(&found) {
        tight += u64::from(attack(&case, x, 1.05 * radius, 100, i).0 > 0);
    }
    assert!(tight >= 6, "{tight} of {}", found.len());
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

/// The race's measure over the ball, worked out in plain f64 without the library's enclosures: pieces of both
/// margins by hand, each less `radius |A^t' gradient|`.
fn pieces_by_hand(plant: &Plant, start: &[f32], radius: f64) -> f64 {
    let race = DroneRace::default();
    let nominal = replay::states::<f64>(plant, start, 30);
    let unit = |i: usize| -> [f64; 12] { std::array::from_fn(|j| f64::from(u8::from(i == j))) };
    let zero = race.step([0.0; 12], [0.0; 3]);
    let columns: Vec<[f64; 12]> =
        (0..12).map(|i| race.step(unit(i), [0.0; 3])).map(|x| less(x, zero)).collect();
    let mut powers: Vec<[f64; 12]> = (0..12).map(unit).collect();
    let (mut safe, mut best) = (f64::INFINITY, f64::NEG_INFINITY);
    for (step, x) in nominal.iter().enumerate() {
        let lost = |gradient: [f64; 12]| {
            let along = powers.iter().map(|column| dot(*column, gradient));
            radius * along.map(|x| x * x).sum::<f64>().sqrt()
        };
        let affine = |terms: &[(usize, f64)], offset: f64| {
            let gradient: [f64; 12] = std::array::from_fn(|i| {
                terms.iter().filter(|(j, _)| *j == i).map(|(_, factor)| *factor).sum()
            });
            let state: [f64; 12] = x.as_slice().try_into().unwrap();
            offset + dot(gradient, state) - lost(gradient)
        };
        let (gate, fence, cone) = (0.3_f32, 0.05_f32, 0.2_f32);
        let (gate, fence, cone) = (f64::from(gate), f64::from(fence), f64::from(cone));
        let target = [
            affine(&[(2, 1.0), (8, -1.0)], 0.0),
            affine(&[(3, 1.0), (9, -1.0)], 0.0),
            affine(&[(0, 1.0)], gate),
            affine(&[(0, -1.0)], gate),
            affine(&[(4, 1.0)], gate),
            affine(&[(4, -1.0)], gate),
        ];
        let (dx, dy) = (x[0] - x[6], x[2] - x[8]);
        let distance = dx.hypot(dy);
        let (p, q) = (dx / distance, dy / distance);
        let around = [(0, p), (6, -p), (2, q), (8, -q)];
        // The tangent of the distance goes through the origin.
        let constraint = [
            affine(&around, -cone),
            affine(&[&around[..], &[(4, cone), (10, -cone)]].concat(), -cone),
            affine(&[(2, -1.0), (0, 1.0)], fence),
            affine(&[(2, -1.0), (0, -1.0)], fence),
            affine(&[(2, -1.0), (4, 1.0)], fence),
            affine(&[(2, -1.0), (4, -1.0)], fence),
        ];
        let least = |pieces: [f64; 6]| pieces.into_iter().fold(f64::INFINITY, f64::min);
        safe = safe.min(least(constraint));
        best = best.max(safe.min(least(target)));
        if step < 30 {
            powers.iter_mut().for_each(|column| {
                let sum = |i: usize| (0..12).map(|j| columns[j][i] * column[j]).sum::<f64>();
                *column = std::array::from_fn(sum);
            });
        }
    }
    best
}

fn less(a: [f64; 12], b: [f64; 12]) -> [f64; 12] {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: [f64; 12], b: [f64; 12]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Pieces and tube certify what the formulas by hand do; the Lipschitz form certifies less.
#[test]
fn the_race_is_certified_piece_by_piece() {
    let plant = race();
    let starts = starts(&plant, 500);
    let radius = 0.1;
    let by_hand: Vec<bool> =
        starts.iter().map(|x| pieces_by_hand(&plant, x, radius) > 0.0).collect();
    let certified = |kind| {
        let certificate = Deterministic::new(&plant, spec(30), PairControl::Replay, kind).unwrap();
        certificate.certified(starts.view(), radius)
    };
    let [pieces, tube, lipschitz] = [Kind::Pieces, Kind::Tube, Kind::Lipschitz].map(certified);
    let count = |found: &[bool]| found.iter().filter(|certified| **certified).count();
    println!(
        "by hand {}, pieces {}, tube {}, Lipschitz {} of {}",
        count(&by_hand),
        count(&pieces),
        count(&tube),
        count(&lipschitz),
        starts.len()
    );
    assert_eq!(pieces, by_hand);
    assert!(count(&tube) as f64 >= 0.9 * count(&pieces) as f64);
    assert!(count(&lipschitz) < count(&pieces) && count(&pieces) > 35);
    let kept = |(one, other): (&bool, &bool)| !*one || *other;
    assert!(lipschitz.iter().zip(&pieces).all(kept));
}

/// At radius 0.03 in closed loop, at least nine tenths of the true set, and nothing beyond it.
#[test]
fn the_double_integrator_is_certified_nearly_everywhere() {
    let plant = bang_bang();
    let form = ClosedForm::of(&DoubleIntegrator::default());
    let loss = [0.0; 31];
    let certificate =
        Deterministic::new(&plant, spec(30), PairControl::ClosedLoop, Kind::Tube).unwrap();
    let side = 60;
    let node = |i: usize, half: f32| half * ((2 * i + 1) as f32 / side as f32 - 1.0);
    let grid = (0..side * side).map(|i| [node(i / side, 1.2), node(i % side, 1.5)]);
    let grid = StateList::new(2).with(grid);
    let certified = certificate.certified(grid.view(), 0.03);
    let inside = |[p, v]: [f64; 2]| form.contains([p, v], &loss);
    let center = |x: &[f32]| [f64::from(x[0]), f64::from(x[1])];
    let all = grid.iter().filter(|x| inside(center(x))).count();
    let mut found = 0;
    for (x, _) in grid.iter().zip(certified).filter(|(_, certified)| *certified) {
        found += 1;
        for k in 0..32 {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 32.0).sin_cos();
            let [p, v] = center(x);
            assert!(inside([p + 0.03 * cos, v + 0.03 * sin]), "{x:?}");
        }
    }
    println!("{found} of {all}");
    assert!(found as f64 >= 0.9 * all as f64, "{found} of {all}");
}

/// A number that grows by a factor in each step, with an affine target.
struct Line {
    growth: f32,
    slope: f32,
    offset: f32,
}

impl System<1, 1> for Line {
    fn name(&self) -> &str {
        "line"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], _: [R; 1]) -> [R; 1] {
        [R::lit(self.growth) * x]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        R::lit(self.slope) * x - R::lit(self.offset)
    }
    fn constraint<R: Real>(&self, _: [R; 1]) -> R {
        R::lit(1.0)
    }
}

/// No control.
struct Still;

impl reachcast::policy::Policy<1, 1> for Still {
    fn name(&self) -> String {
        "still".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 1]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// Radii at which the true margin is 0 or less by far less than a rounding error of f64: whoever rounds to nearest
/// certifies about half of them. All numbers are whole multiples of powers of two, so the margin is an integer.
#[test]
fn a_rounding_error_too_much_is_refused() {
    let mut random = StdRng::seed_from_u64(11);
    let (mut refused, mut certified) = (0, 0);
    for _ in 0..400 {
        // 24 bits each: the growth in [1, 2), slope and start in [0.5, 1).
        let mut bits = || i128::from(random.random_range(1_u32 << 23..1 << 24));
        let (growth, slope, x) = (bits(), bits(), bits());
        let slopes = growth * slope;
        // The largest multiple of 2^-23 below the target's value after a step: an f32.
        let offset = ((slopes * x) >> 48) << 1;
        let number = |bits: i128, places: i32| bits as f32 / 2.0_f32.powi(places);
        let system = Line {
            growth: number(growth, 23),
            slope: number(slope, 24),
            offset: number(offset, 24),
        };
        let plant = Plant::of(system, Still);
        let certificate =
            Deterministic::new(&plant, spec(1), PairControl::ClosedLoop, Kind::Tube).unwrap();
        // The margin after a step in units of 2^-121, for a radius in units of 2^-74.
        let value = slopes * x * (1 << 50) - offset * (1 << 97);
        let least = (value + slopes - 1) / slopes;
        let verdict = |radius: i128| {
            certificate.verdict(&[number(x, 24)], radius as f64 / 2.0_f64.powi(74)).certified
        };
        for radius in least..least + 3 {
            assert!(value - slopes * radius <= 0 && !verdict(radius), "{radius}");
            refused += 1;
        }
        certified += u32::from(verdict(least / 2));
    }
    assert!(refused == 1200 && certified > 390, "{refused} {certified}");
}

/// A target that is no number left of 0.
struct Root;

impl System<1, 1> for Root {
    fn name(&self) -> &str {
        "root"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, x: [R; 1], _: [R; 1]) -> [R; 1] {
        x
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        R::lit(1.0) + x.sqrt()
    }
    fn constraint<R: Real>(&self, _: [R; 1]) -> R {
        R::lit(1.0)
    }
}

#[test]
fn what_is_no_number_is_never_certified() {
    for (plant, kind) in [(race(), Kind::Pieces), (race(), Kind::Tube), (race(), Kind::Lipschitz)] {
        let certificate = Deterministic::new(&plant, spec(30), PairControl::Replay, kind).unwrap();
        let start = vec![0.0, 0.0, -0.1, 0.9, 0.0, 0.0, 0.5, 0.0, -3.0, 0.1, 0.0, 0.0];
        assert!(certificate.verdict(&start, 1e-4).certified);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for i in 0..12 {
                let mut start = start.clone();
                start[i] = bad;
                assert!(!certificate.verdict(&start, 1e-4).certified, "{kind:?} {bad} {i}");
                assert_eq!(certificate.radius(&start, 0.1), 0.0);
            }
        }
        for radius in [f64::NAN, f64::INFINITY, -1.0, f64::MAX] {
            assert!(!certificate.verdict(&start, radius).certified, "{kind:?} {radius}");
        }
    }
    let plant = Plant::of(Root, Still);
    let certificate =
        Deterministic::new(&plant, spec(1), PairControl::ClosedLoop, Kind::Tube).unwrap();
    assert!(certificate.verdict(&[0.5], 0.4).certified);
    assert!(!certificate.verdict(&[0.5], 0.6).certified);
    assert!(!certificate.verdict(&[-0.5], 0.0).certified);
}

#[test]
fn pieces_need_a_linear_plant_and_replay() {
    let refusal = |plant: &Plant, control| {
        let refused = Deterministic::new(plant, spec(30), control, Kind::Pieces);
        refused.map(drop).unwrap_err().to_string()
    };
    assert!(refusal(&dubins(), PairControl::Replay).contains("linear"));
    assert!(refusal(&race(), PairControl::ClosedLoop).contains("replay"));
}
