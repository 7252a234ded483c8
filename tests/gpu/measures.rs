//! Measures of trajectories against f32 on the host and against the f64 oracle.

use reachcast::backend::gpu::Gpu;
use reachcast::model::Plant;
use reachcast::policy::{Activation, Policy};
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{
    Fold, Query, ReachAvoidTask, Region, RolloutSpec, Starts, Tightening, replay,
};
use reachcast::system::{Axis, BangBang, DoubleIntegrator, System};

use crate::systems::Idle;
use crate::{band, drawn, each_way, gpu, measures, race_policy, ramp, random_network, whole_box};

/// The target margin `a b + c`: 0 where the product is rounded before the sum, as the host does.
struct Squares;

impl System<3, 1> for Squares {
    fn name(&self) -> &str {
        "squares"
    }
    fn states(&self) -> [Axis; 3] {
        ["a", "b", "c"].map(|name| Axis::new(name, "", -2.0, 2.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, x: [R; 3], _: [R; 1]) -> [R; 3] {
        x
    }
    fn target<R: Real>(&self, [a, b, c]: [R; 3]) -> R {
        a * b + c
    }
    fn constraint<R: Real>(&self, _: [R; 3]) -> R {
        R::lit(1.0)
    }
}

/// Whether the adapter rounds a product before it is added: it is asked.
pub(crate) fn rounds_products(gpu: Gpu) -> (Gpu, bool) {
    let starts: Vec<[f32; 3]> = (1..400)
        .map(|i| 1.0 + i as f32 / 1024.0 + f32::EPSILON)
        .map(|a| [a, a, -(a * a)])
        .collect();
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let task = ReachAvoidTask {
        starts: Starts::listed(&starts),
        range: 0..starts.len() as u64,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let (gpu, found) = measures(gpu, &Plant::of(Squares, Idle), &task);
    (gpu, found.iter().all(|margin| *margin == 0.0))
}

/// The measure in f32 on the host, one state after the other.
fn measure_f32(plant: &Plant, start: &[f32], spec: &RolloutSpec, tightening: &Tightening) -> f32 {
    let mut fold = Fold::new();
    let states = replay::states::<f32>(plant, start, spec.horizon);
    for (step, x) in (0..).zip(states) {
        fold.add(
            plant.model.target_at(&x, step) - tightening.target[step as usize],
            plant.model.constraint_at(&x, step) - tightening.constraint[step as usize],
            spec.gamma,
        );
    }
    fold.measure()
}

/// The same of a system and a policy as Rust types, nothing recorded.
fn typed_measure_f32<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    (system, policy): (&S, &P),
    mut x: [f32; NX],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f32 {
    let mut fold = Fold::new();
    for (target, constraint) in tightening.target.iter().zip(&tightening.constraint) {
        let margins = (system.target(x) - target, system.constraint(x) - constraint);
        fold.add(margins.0, margins.1, spec.gamma);
        x = system.step(x, policy.control(x));
    }
    fold.measure()
}

/// Every GPU measure lies within [`band`].
pub(crate) fn assert_close_to_f64(plant: &Plant, task: &ReachAvoidTask<'_>, gpu: &[f32]) {
    let starts = task.range.clone().map(|index| task.starts.start(index));
    let both: Vec<(f64, f32)> = starts
        .map(|start| {
            let oracle = replay::measure(plant, &start, &task.spec, task.tightening);
            let host = measure_f32(plant, &start, &task.spec, task.tightening);
            (oracle, host)
        })
        .collect();
    let band = band(both.iter().map(|(oracle, host)| (*host, *oracle)));
    for (i, ((oracle, _), &gpu)) in both.iter().zip(gpu).enumerate() {
        let distance = (f64::from(gpu) - oracle).abs();
        assert!(distance <= band, "start {i}: gpu {gpu}, f64 {oracle}, band {band}");
    }
}

#[test]
fn formula_measures_have_the_host_bits_where_nothing_is_contracted() {
    let Some(gpu) = gpu() else { return };
    let (gpu, exact) = rounds_products(gpu);
    let system = DoubleIntegrator::default();
    let policy = BangBang { acceleration: 1.0 };
    let plant = Plant::of(system, policy);
    let spec = RolloutSpec::new(40, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 21),
        range: 0..1000,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, found) = measures(gpu, &plant, &task);
    assert_close_to_f64(&plant, &task, &found);
    let typed = (&system, &policy);
    let host = |i| typed_measure_f32(typed, task.starts.start_array(i), &spec, &tightening);
    let equal = (0..1000).filter(|&i| found[i as usize] == host(i)).count();
    println!("{equal} of 1000 measures equal the host's");
    // Where products are contracted the band alone holds.
    assert!(!exact || equal == 1000, "{equal} of 1000 measures equal the host's");
}

#[test]
fn race_measures_lie_within_a_band_around_f64() {
    each_way(race_measures);
}

fn race_measures(gpu: Gpu) {
    let system = DroneRace::default();
    let plant = Plant::of(system, race_policy());
    let spec = RolloutSpec::new(30, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 22),
        range: 0..300,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, found) = measures(gpu, &plant, &task);
    assert_close_to_f64(&plant, &task, &found);
}

#[test]
fn wide_networks_of_every_activation() {
    let Some(mut gpu) = gpu() else { return };
    let system = DroneRace::default();
    let spec = RolloutSpec::new(3, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let cases = [
        (vec![12, 512, 512, 512, 512, 3], Activation::Relu, 40),
        (vec![12, 67, 3], Activation::Tanh, 270),
        (vec![12, 5, 9, 3], Activation::Silu, 270),
        (vec![12, 3], Activation::Relu, 10),
    ];
    for (widths, activation, count) in cases {
        let plant = Plant::of(system, random_network(&widths, activation));
        let task = ReachAvoidTask {
            starts: drawn(whole_box(&system), 23),
            range: 0..count,
            spec,
            tightening: &tightening,
            query: Query::Measure,
        };
        let (back, found) = measures(gpu, &plant, &task);
        gpu = back;
        assert_close_to_f64(&plant, &task, &found);
    }
}

#[test]
fn sign_query_equals_the_sign_of_the_measure() {
    let race = DroneRace::default();
    let (plant, region) = (Plant::of(race, race_policy()), whole_box(&race));
    each_way(|gpu| assert_signs(gpu, (&plant, &region), 30, 700));
    let Some(gpu) = gpu() else { return };
    let integrator = DoubleIntegrator::default();
    let plant = Plant::of(integrator, BangBang { acceleration: 1.0 });
    assert_signs(gpu, (&plant, &whole_box(&integrator)), 100, 3000);
}

/// Holds signs of `count` starts in `region` against the measures.
fn assert_signs(gpu: Gpu, (plant, region): (&Plant, &Region), horizon: u32, count: u64) {
    let spec = RolloutSpec::new(horizon, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let mut task = ReachAvoidTask {
        starts: drawn(region.clone(), 24),
        range: 40..40 + count,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (gpu, dense) = measures(gpu, plant, &task);
    task.query = Query::Sign;
    let (_, signs) = measures(gpu, plant, &task);
    let expected: Vec<f32> = dense.iter().map(|g| if *g > 0.0 { 1.0 } else { -1.0 }).collect();
    assert_eq!(signs, expected);
    let passed = expected.iter().filter(|sign| **sign > 0.0).count();
    assert!(passed > 0 && passed < expected.len(), "{passed} of {count}: one sign only");
}
