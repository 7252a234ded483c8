//! One suite for every evaluator: each formula as f32, lanes, recorded graph, f64, on the CPU
//! backend and on an adapter.
//!
//! f32, lanes, the recorded graph and the CPU backend give equal bits. The adapter lies within a
//! multiple of the worst distance of f32 from f64, and its sign is right outside that band.

mod common;
#[path = "oracle/functions.rs"]
mod functions;

use std::array::from_fn;
use std::sync::LazyLock;

use common::backends;
use functions::{Case, disagreement};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::backend::Backend;
use reachcast::cost::{Cost, CostMap, GoalCost, Grid};
use reachcast::formula::{Function, record};
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::race::{Cone, DroneRace};
use reachcast::real::{Lanes, Real};
use reachcast::rollout::{Query, ReachAvoidTask, RolloutSpec, Starts, Tightening, normal_pair};
use reachcast::system::{Axis, DiffDrive, DoubleIntegrator, System};

/// Inputs of every formula: twelve states and three controls of the race; others use the first.
const INPUTS: usize = 15;
/// Batch of inputs.
const BATCH: usize = 4096;
/// Margin that ends a rollout of [`Probe`] after its first state.
const FAR: f32 = 1.0e9;
/// What an adapter may be farther from f64 than the host's own f32.
const FACTOR: f64 = 8.0;

static DRIVE: LazyLock<DiffDrive> = LazyLock::new(DiffDrive::default);
static GOAL: LazyLock<GoalCost> = LazyLock::new(|| {
    // Sides of cells at numbers that `inputs` favours.
    let grid = Grid { origin: [-1.5, -1.25], resolution: 0.25, size: [11, 9] };
    let map = CostMap::new(grid, &[0.0; 99], 1.0).expect("a map");
    GoalCost { distance: 1.5, angle: 2.5, map }
});

/// A pose between the obstacles of the drive.
fn among_obstacles<R: Real>(x: [R; INPUTS]) -> [R; 3] {
    [R::lit(6.0) + R::lit(2.0) * x[0], R::lit(6.5) + R::lit(1.5) * x[1], x[2]]
}

/// A formula under test, the same source for every evaluator.
#[derive(Clone, Copy, Debug)]
enum Formula {
    RaceStep(usize),
    RaceTarget,
    RaceConstraint(Cone),
    IntegratorStep(usize),
    DriveStep(usize),
    DriveTarget,
    DriveConstraint,
    GoalStage,
    MapCell,
    Sine,
    Cosine,
    Tangent,
    Logarithm,
    Normal(usize),
    Branches,
    Arithmetic,
}

impl Formula {
    fn eval<R: Real>(self, x: [R; INPUTS]) -> R {
        let race = |cone| DroneRace { cone, speed_limit: true, ..DroneRace::default() };
        let state: [R; 12] = from_fn(|i| x[i]);
        let unit = |x: R| (x.abs() + R::lit(1e-6)).min(R::lit(1.0));
        match self {
            Self::RaceStep(i) => race(Cone::Distance).step(state, from_fn(|i| x[12 + i]))[i],
            Self::RaceTarget => race(Cone::Distance).target(state),
            Self::RaceConstraint(cone) => race(cone).constraint(state),
            Self::IntegratorStep(i) => DoubleIntegrator::default().step([x[0], x[1]], [x[2]])[i],
            Self::DriveStep(i) => DRIVE.step([x[0], x[1], R::lit(2.0) * x[2]], [x[3], x[4]])[i],
            Self::DriveTarget => DRIVE.target(among_obstacles(x)),
            Self::DriveConstraint => DRIVE.constraint(among_obstacles(x)),
            Self::GoalStage => {
                let (pose, goal) = ([x[0], x[1], R::lit(5.0) * x[2]], [x[3], x[4], x[5]]);
                <GoalCost as Cost<3, 2, 3>>::stage(&GOAL, pose, [x[6], x[7]], goal)
            }
            Self::MapCell => GOAL.map.cell([x[0], x[1]]),
            Self::Sine => (R::lit(4.0) * x[0]).sin(),
            Self::Cosine => (R::lit(4.0) * x[0]).cos(),
            Self::Tangent => (R::lit(5.0) * x[0]).tanh(),
            Self::Logarithm => unit(x[0]).ln_unit(),
            Self::Normal(i) => normal_pair(unit(x[0]), unit(x[1]))[i],
            Self::Branches => {
                let [a, b, c] = [x[0], x[1], x[2]];
                let low = a.min(b);
                let high = a.max(b);
                c.clamp(low, high) + a.if_lt(b, c, -c) + (R::lit(7.0) * c).floor()
            }
            Self::Arithmetic => {
                let [a, b, c] = [x[0], x[1], x[2]];
                (a * b - c) / (c * c + R::lit(0.5)) + a.hypot(b) - (-c).abs().sqrt()
            }
        }
    }
}

/// A system whose measure is the formula at the start: the next state is far outside the target.
struct Probe(Formula);

impl System<16, 1> for Probe {
    fn name(&self) -> &str {
        "probe"
    }
    fn states(&self) -> [Axis; 16] {
        from_fn(|i| Axis::new(&format!("x{i}"), "", -2.0, 2.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, mut x: [R; 16], [u]: [R; 1]) -> [R; 16] {
        x[15] = u;
        x
    }
    fn target<R: Real>(&self, x: [R; 16]) -> R {
        let value = self.0.eval(from_fn(|i| x[i]));
        R::lit(0.5).if_lt(x[15], R::lit(-FAR), value)
    }
    fn constraint<R: Real>(&self, _: [R; 16]) -> R {
        R::lit(FAR)
    }
}

/// The control that marks the second state.
struct Mark;

impl Policy<16, 1> for Mark {
    fn name(&self) -> String {
        "mark".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 16]) -> [R; 1] {
        [R::lit(1.0)]
    }
}

/// Inputs over the race's scale, some of them exactly at switching points.
fn inputs() -> Vec<[f32; 16]> {
    let mut random = StdRng::seed_from_u64(7);
    let mut number = |i: usize| match (i, random.random_range(0..12)) {
        (15, _) => 0.0,
        (_, 0) => 0.0,
        (_, 1) => 1.0,
        (_, 2) => -0.25,
        _ => random.random_range(-2.0_f32..2.0),
    };
    (0..BATCH).map(|_| from_fn(&mut number)).collect()
}

/// The formula at each input in f32.
fn plain(formula: Formula, inputs: &[[f32; 16]]) -> Vec<f32> {
    inputs.iter().map(|x| formula.eval::<f32>(from_fn(|i| x[i]))).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// The formula as lanes, in groups of 16.
fn lanes(formula: Formula, inputs: &[[f32; 16]]) -> Vec<f32> {
    let group =
        |x: &[[f32; 16]]| formula.eval::<Lanes<16>>(from_fn(|k| Lanes(from_fn(|i| x[i][k])))).0;
    inputs.chunks(16).flat_map(group).collect()
}

/// The formula as a recorded graph, evaluated in f32.
fn recorded(formula: Formula, inputs: &[[f32; 16]]) -> Vec<f32> {
    let graph = record(INPUTS, |x| vec![formula.eval(from_fn(|i| x[i]))]);
    inputs.iter().map(|x| graph.eval::<f32>(&x[..INPUTS])[0]).collect()
}

/// The formula as the measure of a batch.
fn on_backend(backend: &Backend, formula: Formula, inputs: &[[f32; 16]]) -> Vec<f32> {
    let spec = RolloutSpec::new(1, 1.0).expect("spec");
    let task = ReachAvoidTask {
        starts: Starts::listed(inputs),
        range: 0..inputs.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let program = backend.prepare(&Plant::of(Probe(formula), Mark)).expect("it fits");
    let mut measures = Vec::new();
    let sink = &mut |_: u64, values: &[f32]| {
        measures.extend_from_slice(values);
        Ok(())
    };
    program.reach_avoid(&task, sink).expect("batch runs");
    measures
}

/// Everything that holds for one formula on every evaluator of this machine.
fn check(formula: Formula) {
    let inputs = inputs();
    let host = plain(formula, &inputs);
    assert_eq!(bits(&lanes(formula, &inputs)), bits(&host), "{formula:?} as lanes");
    assert_eq!(bits(&recorded(formula, &inputs)), bits(&host), "{formula:?} as a graph");
    let wide = |x: &[f32; 16]| formula.eval::<f64>(from_fn(|i| f64::from(x[i])));
    let truth: Vec<f64> = inputs.iter().map(wide).collect();
    let distance = |values: &[f32]| {
        let each =
            values.iter().zip(&truth).map(|(value, truth)| (f64::from(*value) - truth).abs());
        each.fold(0.0, f64::max)
    };
    let band = FACTOR * distance(&host) + 1e-6;
    for backend in backends() {
        let values = on_backend(&backend, formula, &inputs);
        if matches!(backend, Backend::Cpu(_)) {
            // `-0.0` and `0.0` are one margin: compared as numbers.
            assert_eq!(values, host, "{formula:?} on the CPU backend");
        }
        let worst = distance(&values);
        assert!(worst <= band, "{formula:?} on {}: {worst:e} from f64", backend.device());
        let outside = truth.iter().zip(&values).filter(|(truth, _)| truth.abs() > band);
        let wrong = outside.filter(|(truth, value)| (**truth > 0.0) != (**value > 0.0)).count();
        assert_eq!(wrong, 0, "{formula:?}: signs outside the band");
        let inside = truth.iter().filter(|truth| truth.abs() <= band).count();
        let unequal = values.iter().zip(&host).filter(|(a, b)| a != b).count();
        println!(
            "{formula:?} on {}: {unequal} of {BATCH} differ from f32, {worst:.1e} from f64, \
             {inside} within the band {band:.1e}",
            backend.name()
        );
    }
}

macro_rules! suite {
    ($($name:ident: $($formula:expr),+;)*) => {
        $(
            #[test]
            fn $name() {
                $(check($formula);)+
            }
        )*
    };
}

suite! {
    race_positions: Formula::RaceStep(0), Formula::RaceStep(2), Formula::RaceStep(10);
    race_velocities: Formula::RaceStep(1), Formula::RaceStep(7), Formula::RaceStep(9);
    race_target: Formula::RaceTarget;
    race_distance_cone: Formula::RaceConstraint(Cone::Distance);
    race_squared_cone: Formula::RaceConstraint(Cone::Squared);
    race_root_cone: Formula::RaceConstraint(Cone::Root);
    double_integrator: Formula::IntegratorStep(0), Formula::IntegratorStep(1);
    drive_steps: Formula::DriveStep(0), Formula::DriveStep(1), Formula::DriveStep(2);
    drive_margins: Formula::DriveTarget, Formula::DriveConstraint;
    goal_cost: Formula::GoalStage;
    map_cells: Formula::MapCell;
    sine_and_cosine: Formula::Sine, Formula::Cosine;
    hyperbolic_tangent: Formula::Tangent;
    logarithm_and_normals: Formula::Logarithm, Formula::Normal(0), Formula::Normal(1);
    branches: Formula::Branches;
    arithmetic: Formula::Arithmetic;
}

/// Everything that holds for a function over special numbers on every evaluator of this machine.
fn check_special(cases: &[Case]) {
    for backend in backends() {
        for case in cases {
            disagreement(&backend, *case).unwrap_or_else(|error| panic!("{error}"));
        }
    }
}

macro_rules! special {
    ($($name:ident: $($case:expr),+;)*) => {
        $(
            #[test]
            fn $name() {
                check_special(&[$($case),+]);
            }
        )*
    };
}

special! {
    special_sines: Case::Of(Function::Sin), Case::Of(Function::Cos), Case::Of(Function::Tan);
    special_arcs: Case::Of(Function::Asin), Case::Of(Function::Acos), Case::Of(Function::Atan);
    special_angles: Case::Angle, Case::AngleBehind, Case::Of(Function::Wrap);
    special_exponentials: Case::Of(Function::Exp), Case::Of(Function::Sigmoid), Case::Of(Function::Tanh);
    special_logarithms: Case::Of(Function::Ln);
    special_powers: Case::Whole(3), Case::Whole(-2), Case::Whole(0), Case::Power(0.5), Case::Power(1.5), Case::Power(-0.3);
    special_signs: Case::Sign, Case::Floor, Case::Length;
    special_choices: Case::Smaller, Case::SmallerBehind, Case::Larger, Case::LargerBehind, Case::Held, Case::HeldBelow;
    special_comparisons: Case::Less, Case::LessBehind, Case::NotMore, Case::Equal;
}
