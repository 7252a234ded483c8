//! Plants as data on the device: parameters, time, the number of the step, what a network sees and
//! says, against f64 written from the mathematics.

use reachcast::backend::Backend;
use reachcast::backend::gpu::{Gpu, NetworkKernels};
use reachcast::model::Plant;
use reachcast::rollout::{
    DeviationTask, PairControl, PairMeasure, Pairs, Query, ReachAvoidTask, Region, RolloutSpec,
    Starts, States, Stream, Tightening,
};
use reachcast::scenario::purpose;

use crate::models::{DRIVERS, Driver, Truth, VALUES};
use crate::{drawn, gpu, ramp};

/// Largest distance from f64: some hundred roundings of numbers of a few units.
const BAND: f64 = 3e-5;
/// Starts or pairs.
const COUNT: u64 = 150;
/// Steps.
const HORIZON: u32 = 25;

fn region() -> Region {
    Region::new_box([-1.5, -1.5, -2.0], [1.5, 1.5, 2.0]).expect("a box")
}

/// The values of `task` on `backend`.
fn values(backend: &Backend, plant: &Plant, task: &ReachAvoidTask<'_>) -> Vec<f32> {
    let program = backend.prepare(plant).expect("a plant that fits");
    let mut all = Vec::new();
    let ran = program.reach_avoid(task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    });
    ran.expect("it runs");
    all
}

/// The measures of the pairs of `task`.
fn pairs(backend: &Backend, plant: &Plant, task: &DeviationTask<'_>) -> Vec<PairMeasure> {
    let program = backend.prepare(plant).expect("a plant that fits");
    let mut all = Vec::new();
    let ran = program.deviation(task, &mut |_, pairs| {
        all.extend_from_slice(pairs);
        Ok(())
    });
    ran.expect("it runs");
    all
}

/// Runs `test` with each driver, its network, if any, in layers and fused.
fn each(test: impl Fn(Gpu, Driver)) {
    for driver in DRIVERS {
        for networks in [NetworkKernels::Layered, NetworkKernels::Fused] {
            let Some(gpu) = gpu() else { return };
            test(gpu.with_networks(networks), driver);
        }
    }
}

#[test]
fn measures_and_signs_follow_parameters_and_time() {
    each(|gpu, driver| {
        let backend = Backend::Gpu(gpu);
        for parameters in [VALUES, [-0.7, 1.3, 0.6, 4.0, 0.9]] {
            assert_measures(&backend, driver, parameters);
        }
    });
}

fn assert_measures(backend: &Backend, driver: Driver, parameters: [f32; 5]) {
    let (plant, truth) = (driver.plant(parameters), Truth::new(driver, parameters));
    let spec = RolloutSpec::new(HORIZON, 0.96).expect("a horizon");
    let tightening = ramp(&spec);
    let starts = drawn(region(), 71);
    let task = |query| ReachAvoidTask {
        starts: starts.clone(),
        range: 0..COUNT,
        spec,
        tightening: &tightening,
        query,
    };
    let measures = values(backend, &plant, &task(Query::Measure));
    let signs = values(backend, &plant, &task(Query::Sign));
    let mut passed = 0;
    for (i, (measure, sign)) in measures.iter().zip(&signs).enumerate() {
        let start = starts.start(i as u64);
        let replay = PairControl::Replay;
        let [truth, _] = truth.pair([&start, &start], &spec, &tightening, replay);
        let gap = (f64::from(*measure) - truth).abs();
        assert!(gap <= BAND, "{driver:?}, start {i}: {measure}, f64 {truth}");
        assert!(truth.abs() <= BAND || (*sign > 0.0) == (truth > 0.0), "{driver:?}, start {i}");
        passed += u64::from(truth > 0.0);
    }
    assert!(passed > 0 && passed < COUNT, "{passed} of {COUNT}: one sign only");
}

#[test]
fn pairs_follow_parameters_and_time() {
    each(|gpu, driver| {
        let backend = Backend::Gpu(gpu);
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            assert_pairs(&backend, driver, control);
        }
    });
}

fn assert_pairs(backend: &Backend, driver: Driver, control: PairControl) {
    let truth = Truth::new(driver, VALUES);
    let spec = RolloutSpec::new(HORIZON, 0.96).expect("a horizon");
    let task = DeviationTask {
        pairs: Pairs {
            nominal: drawn(region(), 72),
            radius: 0.2,
            stream: Stream::new(73, purpose::DEVIATION_PERTURBATION, 0),
        },
        range: 3..3 + COUNT,
        spec,
        tightening: &ramp(&spec),
        control,
    };
    let found = pairs(backend, &driver.plant(VALUES), &task);
    for (i, found) in (task.range.clone()).zip(&found) {
        let [nominal, perturbed] = task.pairs.pair(i);
        let starts = [&nominal[..], &perturbed];
        let [nominal, perturbed] = truth.pair(starts, &spec, task.tightening, control);
        let gaps = [f64::from(found.nominal) - nominal, f64::from(found.perturbed) - perturbed];
        let worst = gaps.map(f64::abs).into_iter().fold(0.0, f64::max);
        assert!(worst <= BAND, "{driver:?}, {control:?}, pair {i}: {found:?} is {worst} off");
    }
}

/// Starts that the host lists are those that the device would have drawn.
#[test]
fn listed_starts_of_a_model_are_those_of_the_list() {
    each(|gpu, driver| {
        let backend = Backend::Gpu(gpu);
        let plant = driver.plant(VALUES);
        let spec = RolloutSpec::new(7, 1.0).expect("a horizon");
        let tightening = Tightening::none(&spec);
        let starts = drawn(region(), 74);
        let list: Vec<f32> = (0..200).flat_map(|i| starts.start(i)).collect();
        let listed = Starts::Listed(States::new(&list, 3).unwrap());
        let task = |starts| ReachAvoidTask {
            starts,
            range: 10..200,
            spec,
            tightening: &tightening,
            query: Query::Measure,
        };
        let drawn = values(&backend, &plant, &task(starts));
        assert_eq!(values(&backend, &plant, &task(listed)), drawn, "{driver:?}");
    });
}

/// Starts that are no states are refused: kernels do not check.
#[test]
fn starts_of_another_size_are_refused() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let plant = Driver::Formula.plant(VALUES);
    let program = backend.prepare(&plant).expect("it fits");
    let spec = RolloutSpec::new(3, 1.0).expect("a horizon");
    let task = ReachAvoidTask {
        starts: drawn(Region::new_box([0.0; 2], [1.0; 2]).expect("a box"), 1),
        range: 0..10,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let refused = program.reach_avoid(&task, &mut |_, _| Ok(())).expect_err("two numbers");
    assert!(refused.to_string().contains("3 states"), "{refused}");
}
