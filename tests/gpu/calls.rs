//! What a call of a prepared plant costs the host: nothing that was done before, and as few writes,
//! submissions, waits and reads as there can be.

use std::sync::Arc;

use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::{Gpu, Injection, NetworkKernels, Traffic};
use reachcast::backend::{Backend, Program};
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::race::bench::data;
use reachcast::rollout::{
    CostQuery, DeviationTask, MppiProblem, MppiTask, PairControl, Pairs, Planning, Query,
    ReachAvoidTask, Region, RolloutSpec, Starts, States, Stream, ValueTerm,
};
use reachcast::scenario::purpose;
use reachcast::system::{BangBang, DoubleIntegrator};
use reachcast::{Error, Fault, Result};

use crate::models::{Driver, VALUES};
use crate::{drawn, gpu, ramp, random_network, whole_box};

/// Nothing.
const NONE: Traffic = Traffic {
    writes: 0,
    bytes_written: 0,
    submissions: 0,
    passes: 0,
    waits: 0,
    reads: 0,
    bytes_read: 0,
    texts: 0,
    pipelines: 0,
    packs: 0,
    programs: 0,
    buffers: 0,
    groups: 0,
};
/// One write, one submission of one pass, one wait, one read.
const ONE: Traffic = Traffic { writes: 1, submissions: 1, passes: 1, waits: 1, reads: 1, ..NONE };
/// Bytes of the parameters of a dispatch.
const DISPATCH_BYTES: u64 = 256;
/// Starts or pairs of a batch.
const STARTS: u64 = 158;
/// Steps of a rollout.
const HORIZON: u64 = 30;

/// The race under a network of three hidden layers.
fn race() -> Plant {
    Plant::of(DroneRace::default(), random_network(&[12, 64, 64, 64, 3], Activation::Relu))
}

fn integrator() -> Plant {
    Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 })
}

fn starts(plant: &Plant) -> Starts<'static> {
    if plant.model.states.len() == 2 {
        drawn(whole_box(&DoubleIntegrator::default()), 81)
    } else {
        drawn(whole_box(&DroneRace::default()), 81)
    }
}

/// A batch of 158 starts, the first of which has the index `first`.
fn roll_out_from(
    program: &Program<'_>,
    starts: &Starts<'_>,
    query: Query,
    first: u64,
) -> Result<Vec<f32>> {
    let spec = RolloutSpec::new(HORIZON as u32, 0.95).expect("a horizon");
    let task = ReachAvoidTask {
        starts: starts.clone(),
        range: first..first + STARTS,
        spec,
        tightening: &ramp(&spec),
        query,
    };
    let mut all = Vec::new();
    program.reach_avoid(&task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    })?;
    Ok(all)
}

/// A batch of 158 starts.
fn roll_out(program: &Program<'_>, starts: &Starts<'_>, query: Query) -> Result<Vec<f32>> {
    roll_out_from(program, starts, query, 0)
}

/// A batch of 158 pairs.
fn roll_out_pairs(program: &Program<'_>, control: PairControl, first: u64) -> Result<()> {
    let spec = RolloutSpec::new(HORIZON as u32, 0.95).expect("a horizon");
    let task = DeviationTask {
        pairs: Pairs {
            nominal: starts(program.plant()),
            radius: 0.1,
            stream: Stream::new(82, purpose::DEVIATION_PERTURBATION, 0),
        },
        range: first..first + STARTS,
        spec,
        tightening: &ramp(&spec),
        control,
    };
    program.deviation(&task, &mut |_, _| Ok(())).map(drop)
}

fn traffic(backend: &Backend) -> Traffic {
    match backend {
        Backend::Gpu(gpu) => gpu.traffic(),
        Backend::Cpu(_) => Traffic::default(),
    }
}

/// What `call` costs the second time: `call` is given 0 first, then 1.
fn second(backend: &Backend, call: impl Fn(u64) -> Result<()>) -> Traffic {
    call(0).expect("it runs");
    let before = traffic(backend);
    call(1).expect("it runs again");
    traffic(backend).since(before)
}

/// What the very same call costs the second time.
fn again(backend: &Backend, call: impl Fn(u64) -> Result<()>) -> Traffic {
    second(backend, |_| call(0))
}

/// Each plant, its network in layers and fused, with the number of dispatches of a step under it: 1 where
/// the rollout kernel takes all steps in one.
fn each(test: impl Fn(&Backend, &Plant, bool)) {
    for networks in [NetworkKernels::Layered, NetworkKernels::Fused] {
        for plant in [race(), integrator()] {
            let Some(gpu) = gpu() else { return };
            let layered =
                networks == NetworkKernels::Layered && plant.controller.network().is_some();
            test(&Backend::Gpu(gpu.with_networks(networks)), &plant, layered);
        }
    }
}

/// Dispatches of rollouts from the start to the horizon: the draw, then layers and rollouts.
fn dispatches(layered: bool) -> u64 {
    // A network of three hidden layers.
    if layered { 1 + 4 * HORIZON + HORIZON + 1 } else { 2 }
}

/// What is read before the measures, which are numbers of 4 bytes.
const HEAD_BYTES: u64 = 8;

#[test]
fn a_call_is_one_write_one_submission_one_wait_and_one_read() {
    each(|backend, plant, layered| {
        let program = backend.prepare(plant).expect("it fits");
        let drawn = starts(plant);
        let measures = |first| roll_out_from(&program, &drawn, Query::Measure, first).map(drop);
        let read = Traffic { bytes_read: HEAD_BYTES + 4 * STARTS, ..ONE };
        let expected = Traffic { bytes_written: DISPATCH_BYTES * dispatches(layered), ..read };
        assert_eq!(second(backend, measures), expected, "measures of {}", plant.model.name);
        let sent = Traffic { writes: 0, ..read };
        assert_eq!(again(backend, measures), sent, "the same again of {}", plant.model.name);
    });
}

/// A list lies on the device for the next call, and is sent again where a number of it has changed.
#[test]
fn a_list_is_sent_once() {
    each(|backend, plant, _| {
        let program = backend.prepare(plant).expect("it fits");
        let drawn = starts(plant);
        let size = plant.model.states.len();
        let mut list: Vec<f32> = (0..STARTS).flat_map(|i| drawn.start(i)).collect();
        let roll = |list: &[f32]| {
            let listed = Starts::Listed(States::new(list, size).unwrap());
            let before = traffic(backend);
            let found = roll_out(&program, &listed, Query::Measure).expect("it runs");
            (found, traffic(backend).since(before))
        };
        let expected = roll_out(&program, &drawn, Query::Measure).expect("it runs");
        assert_eq!(roll(&list).0, expected);
        let read = Traffic { writes: 0, bytes_read: HEAD_BYTES + 4 * STARTS, ..ONE };
        assert_eq!(roll(&list), (expected.clone(), read), "{}", plant.model.name);
        list.swap(0, size);
        let (found, cost) = roll(&list);
        let bytes_written = 16 * size.div_ceil(4) as u64 * STARTS;
        let (writes, buffers) = (1, cost.buffers);
        assert_eq!(cost, Traffic { writes, bytes_written, buffers, ..read });
        assert_ne!(found[..2], expected[..2]);
        assert_eq!(found[2..], expected[2..]);
    });
}

#[test]
fn pairs_are_one_of_each() {
    each(|backend, plant, layered| {
        let program = backend.prepare(plant).expect("it fits");
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            let pairs = |first| roll_out_pairs(&program, control, first);
            let expected = Traffic {
                // The reduction of the distances comes on top.
                bytes_written: DISPATCH_BYTES * (dispatches(layered) + 1),
                bytes_read: HEAD_BYTES + 8 * STARTS + 8 * (HORIZON + 1),
                ..ONE
            };
            assert_eq!(second(backend, pairs), expected, "{control:?} of {}", plant.model.name);
        }
    });
}

/// Signs are compacted on the way, and no host is asked how many are left.
#[test]
fn signs_are_one_of_each() {
    each(|backend, plant, layered| {
        let program = backend.prepare(plant).expect("it fits");
        let signs = |first| roll_out_from(&program, &starts(plant), Query::Sign, first).map(drop);
        // 31 states: segments of 8 under a network, of 32 under a formula; compactions between.
        let compactions = if plant.controller.network().is_some() { 3 } else { 0 };
        let rollouts = if layered { dispatches(true) } else { 2 + compactions };
        let expected = Traffic {
            bytes_written: DISPATCH_BYTES * (rollouts + compactions),
            bytes_read: HEAD_BYTES + 4 * STARTS,
            ..ONE
        };
        assert_eq!(second(backend, signs), expected, "{}", plant.model.name);
    });
}

#[test]
fn preparing_again_is_a_look_up() {
    for plant in [race(), integrator(), Driver::Wrapped.plant(VALUES)] {
        let Some(gpu) = gpu() else { return };
        let (backend, plant) = (&Backend::Gpu(gpu), &plant);
        let program = backend.prepare(plant).expect("it fits");
        let before = traffic(backend);
        let again = backend.prepare(plant).expect("it fits");
        assert_eq!(traffic(backend).since(before), Traffic::default(), "the very same");
        drop((program, again));
        // Other values of parameters: printed, and found to be what is there already.
        let mut model = (*plant.model).clone();
        model.parameters.iter_mut().for_each(|parameter| parameter.value += 0.5);
        let other = Plant { model: model.into(), controller: plant.controller.clone() };
        backend.prepare(&other).expect("it fits");
        let printed = Traffic { texts: 1, ..Traffic::default() };
        assert_eq!(traffic(backend).since(before), printed, "{}", plant.model.name);
    }
}

/// Other values of parameters are other numbers, and compile and upload nothing anew.
#[test]
fn a_parameter_is_sent_with_the_call() {
    for networks in [NetworkKernels::Layered, NetworkKernels::Fused] {
        let Some(gpu) = gpu() else { return };
        let backend = Backend::Gpu(gpu.with_networks(networks));
        let region = Region::new_box([-1.0; 3], [1.0; 3]).expect("a box");
        let starts = drawn(region, 83);
        let of = |values: [f32; 5]| {
            let plant = Driver::Wrapped.plant(values);
            let program = backend.prepare(&plant).expect("it fits");
            roll_out(&program, &starts, Query::Measure).expect("it runs")
        };
        let first = of(VALUES);
        let before = traffic(&backend);
        let other = of([1.0, -0.5, 0.9, 3.0, 0.1]);
        let cost = traffic(&backend).since(before);
        // Printed, and found to be the same plant with the same network.
        let (bytes_written, bytes_read) = (cost.bytes_written, HEAD_BYTES + 4 * STARTS);
        assert_eq!(cost, Traffic { texts: 1, bytes_written, bytes_read, ..ONE });
        assert_ne!(first, other);
        assert_eq!(of(VALUES), first, "and back");
    }
}

/// A device that is opened again has the plant again, and gives the same bits.
#[test]
fn a_prepared_plant_outlives_its_device() {
    let Some(first) = gpu() else { return };
    let plant = race();
    let plain = Backend::Gpu(first);
    let drawn = starts(&plant);
    let expected = roll_out(&plain.prepare(&plant).expect("it fits"), &drawn, Query::Measure);
    let Some(second) = gpu() else { return };
    let lost = Injection { fault: Fault::Lost, submission: 1, repeats: false };
    let backend = Backend::Gpu(second.with_failures(vec![lost]));
    let program = backend.prepare(&plant).expect("it fits");
    for _ in 0..3 {
        let found = roll_out(&program, &drawn, Query::Measure);
        assert_eq!(found.expect("it goes on"), *expected.as_ref().expect("it runs"));
    }
    assert_eq!(backend.events().len(), 1);
    // Uploaded to the first device and to the second.
    assert_eq!(traffic(&backend).packs, 2);
}

/// The CPU takes a prepared plant over.
#[test]
fn a_cpu_takes_a_prepared_plant_over() {
    let Some(gpu) = gpu() else { return };
    let refused = Injection { fault: Fault::Validation, submission: 0, repeats: true };
    let host = || Cpu::new(Some(2)).expect("two threads");
    let backend = Backend::Gpu(gpu.with_failures(vec![refused]).with_fallback(host()));
    let plant = race();
    let program = backend.prepare(&plant).expect("it fits");
    let found = roll_out(&program, &starts(&plant), Query::Measure).expect("the CPU runs it");
    let cpu = Backend::Cpu(host());
    let expected =
        roll_out(&cpu.prepare(&plant).expect("it fits"), &starts(&plant), Query::Measure);
    assert_eq!(found, expected.expect("it runs"));
    roll_out_pairs(&program, PairControl::ClosedLoop, 0).expect("and pairs");
}

/// Without one, the error says what failed.
#[test]
fn without_a_cpu_a_prepared_plant_fails() {
    let Some(gpu) = gpu() else { return };
    let refused = Injection { fault: Fault::Validation, submission: 0, repeats: true };
    let backend = Backend::Gpu(gpu.with_failures(vec![refused]));
    let plant = integrator();
    let program = backend.prepare(&plant).expect("it fits");
    let failed = roll_out(&program, &starts(&plant), Query::Measure);
    assert!(matches!(failed, Err(Error::DeviceFailed { fault: Fault::Validation, .. })));
}

/// Threads that share a prepared plant have workspaces of their own.
#[test]
fn threads_share_a_prepared_plant() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let plant = integrator();
    let program = backend.prepare(&plant).expect("it fits");
    let drawn = starts(&plant);
    let expected = roll_out(&program, &drawn, Query::Measure).expect("it runs");
    std::thread::scope(|scope| {
        let run = || {
            for _ in 0..20 {
                let found = roll_out(&program, &drawn, Query::Measure).expect("it runs");
                assert_eq!(found, expected);
            }
        };
        for _ in 0..4 {
            scope.spawn(run);
        }
    });
}

/// Failures at any submission leave the same results.
#[test]
fn a_prepared_plant_survives_failures() {
    let plain = |gpu: Gpu| {
        let backend = Backend::Gpu(gpu);
        let plant = race();
        let program = backend.prepare(&plant).expect("it fits");
        roll_out(&program, &starts(&plant), Query::Sign).expect("it runs")
    };
    let Some(first) = gpu() else { return };
    let expected = plain(first);
    for fault in [Fault::OutOfMemory, Fault::Timeout, Fault::Lost] {
        for submission in 0..3 {
            let Some(gpu) = gpu() else { return };
            let asked = vec![Injection { fault, submission, repeats: false }];
            assert_eq!(plain(gpu.with_failures(asked)), expected, "{fault} at {submission}");
        }
    }
}

/// Plans of the race with a value network, in one chunk.
fn plans() -> (Planning, MppiProblem) {
    let (spec, problem) = (data::mppi_spec(500).expect("settings"), data::mppi_problem(1, 0));
    let network = Arc::new(random_network(&[12, 20, 1], Activation::Tanh));
    let value = Some(ValueTerm { network, weight: 4.0, threshold: 0.3 });
    (Planning { value, ..Planning::of(&DroneRace::default(), data::lane(), spec) }, problem)
}

#[test]
fn a_plan_is_one_write_one_submission_one_wait_and_one_read() {
    let (networked, problem) = plans();
    for planning in [Planning { value: None, ..networked.clone() }, networked] {
        let Some(gpu) = gpu() else { return };
        let backend = Backend::Gpu(gpu);
        let program = backend.prepare_plans(&planning).expect("it fits");
        for costs in [CostQuery::Summary, CostQuery::Each] {
            let problems = [problem.clone(), problem.clone(), problem.clone()];
            let task = |iteration| MppiTask { problems: &problems, iteration, costs };
            let plan = |iteration| program.improve(&task(iteration as u32)).map(drop);
            let cost = second(&backend, plan);
            let Traffic { bytes_written, bytes_read, .. } = cost;
            assert_eq!(cost, Traffic { bytes_written, bytes_read, ..ONE }, "{costs:?}");
            // Streams and plans of the problems are there from the call before.
            assert!(bytes_written.is_multiple_of(DISPATCH_BYTES), "{cost:?}");
            assert!(bytes_read > 0, "{cost:?}");
            // Another iteration, other problems, fewer of them in the same room.
            let before = traffic(&backend);
            let fewer = MppiTask { problems: &problems[1..], ..task(2) };
            program.improve(&fewer).expect("it runs");
            let after = traffic(&backend).since(before);
            assert_eq!((after.texts, after.pipelines, after.packs), (0, 0, 0));
        }
    }
}
