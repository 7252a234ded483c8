//! The differential drive and its cost map: closed forms, edges of the map, f64, a drive to the goal.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use crate::drive;
use std::f64::consts::{PI, TAU};

use crate::common::{backends, cpu, literal};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::control::DriveBenchmark;
use reachcast::control::mppi::{Planner, shifted};
use reachcast::cost::{Cost, CostMap, GoalCost, Grid, Lookup, MAX_CELLS};
use reachcast::real::Real;
use reachcast::rollout::{
    CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, NoiseKind, Planning, Purpose, Stream,
};
use reachcast::system::{Axis, DiffDrive, Disc, System};

/// The states under constant controls, in f64.
fn held(system: &DiffDrive, start: [f64; 3], u: [f64; 2], steps: usize) -> Vec<[f64; 3]> {
    let mut states = vec![start];
    for t in 0..steps {
        states.push(system.step(states[t], u));
    }
    states
}

/// Steps of Euler turn the velocity by a constant angle: their sum is a geometric series.
#[test]
fn constant_controls_drive_the_polygon_of_an_arc() {
    let system = DiffDrive::default();
    let (dt, start, [v, w]) = (literal(0.02), [0.3, -0.2, 0.7], [0.4, 0.3]);
    let states = held(&system, start, [v, w], 400);
    let half = 0.5 * w * dt;
    for (n, [x, y, yaw]) in states.iter().enumerate() {
        let n = n as f64;
        let chord = v * dt * (n * half).sin() / half.sin();
        let middle = start[2] + (n - 1.0) * half;
        assert!((x - (start[0] + chord * middle.cos())).abs() < 1e-12);
        assert!((y - (start[1] + chord * middle.sin())).abs() < 1e-12);
        assert!((yaw - (start[2] + n * w * dt)).abs() < 1e-12);
        // And within a step of the circle of radius v / w that the drive itself would take.
        let center = [start[0] - v / w * start[2].sin(), start[1] + v / w * start[2].cos()];
        let radius = (x - center[0]).hypot(y - center[1]);
        assert!((radius - v / w).abs() <= v * dt, "{radius}");
    }
}

#[test]
fn straight_ahead_is_a_straight_line() {
    let system = DiffDrive::default();
    let mut x = [1.0_f32, 2.5, 0.0];
    let mut travelled = 1.0_f32;
    for _ in 0..300 {
        x = system.step(x, [0.5, 0.0]);
        travelled += 0.02 * 0.5;
        assert_eq!(x, [travelled, 2.5, 0.0]);
    }
}

#[test]
fn controls_are_clipped_and_wheels_roll_without_slip() {
    let system = DiffDrive { wheel_radius: 0.1, wheel_separation: 0.4, ..DiffDrive::default() };
    let x = [1.0_f32, 1.0, 0.4];
    assert_eq!(system.step(x, [9.0, 9.0]), system.step(x, [0.5, 0.5]));
    assert_eq!(system.step(x, [-9.0, -9.0]), system.step(x, [-0.35, -0.5]));
    assert_ne!(system.step(x, [-0.35, -0.5]), system.step(x, [-0.34, -0.49]));
    let [left, right] = system.wheel_speeds([0.3_f64, 0.5]);
    assert!((left - 2.0).abs() < 1e-6 && (right - 4.0).abs() < 1e-6, "{left} {right}");
}

#[test]
fn margins_are_distances() {
    let system = DiffDrive::default();
    let close =
        |margin: f64, truth: f64| assert!((margin - truth).abs() < 1e-6, "{margin} {truth}");
    close(system.target([10.0, 10.15, 1.0]), 0.1);
    close(system.target([7.0, 6.0, 1.0]), 0.25 - 5.0);
    close(system.constraint([0.5, 3.0, 0.0]), 0.5);
    close(system.constraint([3.0, 10.7, 0.0]), 0.3);
    close(system.constraint([11.5, 3.0, 0.0]), -0.5);
    close(system.constraint([8.2, 8.6, 0.0]), 0.2);
    close(system.constraint([4.25, 6.25, 0.0]), -0.25);
    close(system.constraint([6.45, 5.55, 0.0]), 0.35);
}

/// Costs 1 to 6 in three columns and two rows, from (1, -2) on, and 9 outside.
fn small_map() -> CostMap {
    let grid = Grid { origin: [1.0, -2.0], resolution: 0.5, size: [3, 2] };
    CostMap::new(grid, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 9.0).unwrap()
}

fn charge(map: &CostMap, place: [f32; 2]) -> f32 {
    map.cells()[map.cell(place) as usize]
}

#[test]
fn a_place_is_charged_the_cell_it_is_in() {
    let map = small_map();
    let row = |y: f32| [0.99, 1.0, 1.49, 1.5, 2.0, 2.49, 2.5, 1e30].map(|x| charge(&map, [x, y]));
    assert_eq!(row(-2.0), [9.0, 1.0, 1.0, 2.0, 3.0, 3.0, 9.0, 9.0]);
    assert_eq!(row(-1.51), [9.0, 1.0, 1.0, 2.0, 3.0, 3.0, 9.0, 9.0]);
    assert_eq!(row(-1.5), [9.0, 4.0, 4.0, 5.0, 6.0, 6.0, 9.0, 9.0]);
    for y in [-2.01, -1.0, f32::INFINITY, f32::NEG_INFINITY, -1e30] {
        assert_eq!(row(y), [9.0; 8], "{y}");
    }
    assert!(map.cell([f32::NAN, -1.7]).is_nan() && map.cell([1.2, f32::NAN]).is_nan());
}

/// Any bits at all are a place: a cell, or not a number.
#[test]
fn every_place_has_a_cell() {
    let map = small_map();
    let mut random = StdRng::seed_from_u64(5);
    for _ in 0..200_000 {
        let place = [0; 2].map(|_| f32::from_bits(random.random()));
        let cell = map.cell(place);
        if place.iter().any(|place| place.is_nan()) {
            assert!(cell.is_nan(), "{place:?}: {cell}");
        } else {
            assert!(cell >= 0.0 && (cell as usize) < map.cells().len() && cell.fract() == 0.0);
        }
    }
}

#[test]
fn obstacles_fall_off_over_their_inflation() {
    let grid = Grid { origin: [0.0, 0.0], resolution: 0.1, size: [50, 40] };
    let obstacles = [Disc { center: [2.05, 1.55], radius: 0.4 }];
    let map = CostMap::around(grid, &obstacles, 0.2, 20.0).unwrap();
    // Centres of cells to the right of the centre: 0.3, 0.5, 0.55 and 0.7 from it.
    let along = [2.35, 2.55, 2.75].map(|x| charge(&map, [x, 1.55]));
    assert!((along[0], along[2]) == (20.0, 0.0) && (along[1] - 10.0).abs() < 1e-3, "{along:?}");
    // A 3-4-5 triangle: 0.5 from the centre again.
    assert!((charge(&map, [1.65, 1.25]) - 10.0).abs() < 1e-3);
    assert_eq!(charge(&map, [1.65, 3.25]), 0.0);
    assert_eq!(charge(&map, [-0.1, 1.0]), 20.0);
    let hard = CostMap::around(grid, &obstacles, 0.0, 20.0).unwrap();
    assert!(hard.cells().iter().all(|cost| *cost == 0.0 || *cost == 20.0));
}

#[test]
fn maps_that_cannot_be_are_refused() {
    let good = Grid { origin: [0.0; 2], resolution: 0.5, size: [2, 2] };
    let refused = |grid: Grid, costs: &[f32], outside: f32, words: &str| {
        let text = CostMap::new(grid, costs, outside).expect_err(words).to_string();
        assert!(text.contains(words), "{text}");
    };
    refused(Grid { size: [0, 2], ..good }, &[], 0.0, "0 x 2 cells");
    refused(Grid { size: [usize::MAX, 2], ..good }, &[], 0.0, "more than 4194304");
    refused(Grid { size: [MAX_CELLS / 4, 2], ..good }, &[], 0.0, "more than 4194304");
    refused(Grid { resolution: 0.0, ..good }, &[0.0; 4], 0.0, "resolution 0");
    refused(Grid { resolution: f32::NAN, ..good }, &[0.0; 4], 0.0, "resolution NaN");
    refused(Grid { resolution: 1e-40, ..good }, &[0.0; 4], 0.0, "resolution");
    refused(Grid { origin: [f32::INFINITY, 0.0], ..good }, &[0.0; 4], 0.0, "origin [inf");
    refused(good, &[0.0; 3], 0.0, "3 for 2 x 2 cells");
    refused(good, &[0.0, 1.0, f32::NAN, 0.0], 0.0, "not finite");
    refused(good, &[0.0; 4], f32::INFINITY, "not finite");
    let around = |radius, inflation| {
        let obstacle = Disc { center: [0.5; 2], radius };
        CostMap::around(good, &[obstacle], inflation, 1.0).map_err(|e| e.to_string())
    };
    assert!(around(0.2, 0.1).is_ok());
    for text in [around(-0.1, 0.1), around(0.1, -0.1), around(f32::NAN, 0.1)] {
        assert!(text.unwrap_err().contains("not negative"));
    }
}

#[test]
fn angles_are_wrapped_to_half_a_turn() {
    let cost = GoalCost { distance: 0.0, angle: 1.0, map: small_map() };
    for i in -2000..2000 {
        let (yaw, goal) = (0.01 * f64::from(i), 0.37);
        let stage =
            <GoalCost as Cost<3, 2, 3>>::stage(&cost, [0.0, 0.0, yaw], [0.0; 2], [0.0, 0.0, goal]);
        let error = (yaw - goal).sin().atan2((yaw - goal).cos()).abs();
        // The turn is an f32: three of them are off by 5e-7.
        assert!((stage - error).abs() < 1e-6 && (0.0..=PI + 1e-6).contains(&stage), "{yaw}");
    }
    let far = GoalCost { distance: 2.0, angle: 3.0, map: small_map() };
    let stage =
        <GoalCost as Cost<3, 2, 3>>::stage(&far, [3.0, 4.0, 1.0], [0.0; 2], [0.0, 0.0, 1.0 - TAU]);
    assert!((stage - 10.0).abs() < 1e-5, "{stage}");
}

#[test]
fn plans_across_the_map_agree_with_f64() {
    let host = cpu(1);
    for backend in backends() {
        drive::disagreement(&backend, &host).unwrap();
    }
}

/// A system whose second state is not a number.
#[derive(Clone)]
struct Lost;

impl System<2, 1> for Lost {
    fn name(&self) -> &str {
        "lost"
    }
    fn states(&self) -> [Axis; 2] {
        ["x", "y"].map(|name| Axis::new(name, "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x, y]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        [x + u, (R::lit(-1.0) - y * y).sqrt()]
    }
    fn target<R: Real>(&self, [x, _]: [R; 2]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [x, _]: [R; 2]) -> R {
        x
    }
}

/// Nothing but the map.
#[derive(Clone)]
struct Charged(CostMap);

impl Cost<2, 1, 1> for Charged {
    fn stage<R: Real>(&self, _: [R; 2], _: [R; 1], _: [R; 1]) -> R {
        R::lit(0.0)
    }
    fn map<R: Real>(&self, x: [R; 2]) -> Option<Lookup<'_, R>> {
        Some(Lookup { map: &self.0, place: x })
    }
}

/// A place that is not a number costs what some cell does, on the host the outside.
#[test]
fn a_lost_state_is_charged_a_cell() {
    let spec = MppiSpec::new(MppiSettings::new(&Lost.controls(), 130, 3)).unwrap();
    let planning = Planning::of(&Lost, Charged(small_map()), spec);
    let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
    let problems = [MppiProblem::new([1.2, -1.7], &[[0.0]; 3], &[[0.0]; 3], stream)];
    let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Each };
    for backend in backends() {
        let result = backend.prepare_plans(&planning).unwrap().improve(&task).unwrap().remove(0);
        let in_bounds = |cost: &f32| (1.0 + 2.0..=1.0 + 18.0).contains(cost);
        assert!(result.costs.iter().all(in_bounds), "{}", backend.name());
        if backend.name() == "cpu" {
            assert_eq!(result.costs, [19.0; 130]);
        }
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let benchmark = DriveBenchmark::new(3000).unwrap();
    let problems = std::slice::from_ref(&benchmark.problem);
    let task = MppiTask { problems, iteration: 0, costs: CostQuery::Summary };
    let run =
        |threads| cpu(threads).prepare_plans(&benchmark.planning).unwrap().improve(&task).unwrap();
    let one = run(1);
    assert!(one == run(2) && one == run(5));
}

/// The least clearance from the obstacles on a way of 30 s at most, m, and whether it ends at the
/// goal. The yaw to keep is the direction to the goal, as a route would give it.
fn drive_to_goal(benchmark: &DriveBenchmark, start: [f32; 3], seed: u64) -> (f32, bool) {
    let (backend, system) = (cpu(2), &benchmark.system);
    let planner = Planner::new(&backend, &benchmark.planning, 1).unwrap();
    let mut problems = [MppiProblem { start: start.to_vec(), ..benchmark.problem.clone() }];
    let [goal_x, goal_y] = system.goal.center;
    let mut least = f32::INFINITY;
    for step in 0..1500 {
        let [problem] = &mut problems;
        let (x, y) = (problem.start[0], problem.start[1]);
        let goal = [goal_x, goal_y, (goal_y - y).atan2(goal_x - x)];
        problem.context.chunks_mut(3).for_each(|context| context.copy_from_slice(&goal));
        problem.stream = Stream::new(seed, Purpose::CONTROL_NOISE, step);
        planner.improve(&mut problems).unwrap();
        let [problem] = &mut problems;
        let before = [problem.start[0], problem.start[1], problem.start[2]];
        let after = system.step(before, [problem.plan[0], problem.plan[1]]);
        problem.start = after.to_vec();
        problem.plan = shifted(&problem.plan, 2);
        let [x, y, _] = after;
        let clearances = system.obstacles.iter().map(|obstacle| obstacle.clearance(x, y));
        least = clearances.fold(least, f32::min);
        if system.target(after) > 0.0 {
            return (least, true);
        }
    }
    (least, false)
}

/// The benchmark with 512 samples, noise that turns the drive for longer than a step, and a weight
/// on the yaw below what two seconds of another direction can win.
fn agile() -> DriveBenchmark {
    let mut benchmark = DriveBenchmark::new(512).unwrap();
    let noise = NoiseKind::Colored { time: 10.0 };
    let settings = MppiSettings { noise, ..benchmark.planning.spec.settings().clone() };
    benchmark.cost.angle = 1.0;
    let spec = MppiSpec::new(settings).unwrap();
    benchmark.planning = Planning::of(&benchmark.system, benchmark.cost.clone(), spec);
    benchmark
}

/// With the map the drive goes around the obstacle on its way; without, through it.
#[test]
fn the_drive_goes_around_an_obstacle_to_its_goal() {
    for (start, seed) in [([1.0, 1.0, 0.0], 1), ([1.0, 2.0, 0.0], 1), ([1.0, 2.0, 0.0], 2)] {
        let (clearance, arrived) = drive_to_goal(&agile(), start, seed);
        assert!(arrived && clearance > 0.05, "{start:?}: {arrived}, {clearance} m");
    }
    let mut blind = agile();
    let free = Grid { origin: [0.0; 2], resolution: 11.0, size: [1; 2] };
    blind.cost.map = CostMap::new(free, &[0.0], 0.0).unwrap();
    let spec = MppiSpec::clone(&blind.planning.spec);
    blind.planning = Planning::of(&blind.system, blind.cost.clone(), spec);
    let (clearance, arrived) = drive_to_goal(&blind, [1.0, 2.0, 0.0], 1);
    assert!(arrived && clearance < 0.0, "the obstacle is not on the way: {clearance} m");
}

/// As published, a turn away from the goal costs more than two seconds win: the drive stops short
/// of the obstacle.
#[test]
fn the_benchmark_as_published_stops_short_of_an_obstacle() {
    let benchmark = DriveBenchmark::new(512).unwrap();
    let (clearance, arrived) = drive_to_goal(&benchmark, [1.0, 1.0, 0.0], 1);
    assert!(!arrived && (0.05..0.3).contains(&clearance), "{arrived}, {clearance} m");
}
