//! Failures of the device, injected at every submission: nothing is lost and nothing comes twice.

use std::time::Duration;

use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::{Gpu, Injection, NetworkKernels};
use reachcast::backend::{Action, Backend, Event};
use reachcast::cost::Quadratic;
use reachcast::model::Plant;
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::rollout::{
    CostQuery, DeviationTask, Farthest, MppiProblem, MppiResult, MppiSettings, MppiSpec, MppiTask,
    PairControl, PairMeasure, Pairs, Planning, Purpose, Query, ReachAvoidTask, RolloutSpec, Stream,
};
use reachcast::scenario::purpose;
use reachcast::system::{DoubleIntegrator, System};
use reachcast::{Error, Fault, Result};

use crate::{drawn, gpu, ramp, random_network, whole_box};

/// Starts or pairs of a batch: four of the smallest chunks.
const COUNT: u64 = 200;
/// Problems of MPPI.
const PROBLEMS: u32 = 5;
/// A submission after some results: of measures, that of the third of the four chunks, after the two
/// that cut the batch.
const LATE: u64 = 4;
/// Failures that a batch survives on the adapter.
const SURVIVED: [Fault; 3] = [Fault::OutOfMemory, Fault::Timeout, Fault::Lost];

/// A batch of each kind.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Work {
    Measures(NetworkKernels),
    Signs(NetworkKernels),
    Pairs,
    Plans,
}

const WORKS: [Work; 5] = [
    Work::Measures(NetworkKernels::Layered),
    Work::Measures(NetworkKernels::Fused),
    Work::Signs(NetworkKernels::Layered),
    Work::Pairs,
    Work::Plans,
];

/// What a batch came to, as far as it came.
#[derive(Clone, Debug, Default, PartialEq)]
struct Found {
    values: Vec<f32>,
    pairs: Vec<PairMeasure>,
    farthest: Vec<Farthest>,
    plans: Vec<MppiResult>,
}

impl Found {
    /// The batch with its first `index` results from `self` and the rest from `rest`.
    fn then(&self, rest: &Self, index: usize) -> Self {
        Self {
            values: join(&self.values, &rest.values, index),
            pairs: join(&self.pairs, &rest.pairs, index),
            farthest: Vec::new(),
            plans: join(&self.plans, &rest.plans, index),
        }
    }
}

fn join<T: Clone>(first: &[T], rest: &[T], index: usize) -> Vec<T> {
    let index = index.min(first.len());
    [&first[..index], &rest[index..]].concat()
}

/// Runs `work`; the sinks refuse a result that is missing or comes twice.
fn run(backend: &Backend, work: Work) -> (Found, Result<()>) {
    let mut found = Found::default();
    let result = match work {
        Work::Measures(_) => starts(backend, Query::Measure, &mut found),
        Work::Signs(_) => starts(backend, Query::Sign, &mut found),
        Work::Pairs => pairs(backend, &mut found),
        Work::Plans => plans(backend, &mut found),
    };
    (found, result)
}

fn starts(backend: &Backend, query: Query, found: &mut Found) -> Result<()> {
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 8, 3], Activation::Relu));
    let spec = RolloutSpec::new(20, 0.95).expect("a horizon");
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 61),
        range: 0..COUNT,
        spec,
        tightening: &ramp(&spec),
        query,
    };
    backend.prepare(&plant)?.reach_avoid(&task, &mut |first, values| {
        assert_eq!(first, found.values.len() as u64, "starts in order, each once");
        found.values.extend_from_slice(values);
        Ok(())
    })
}

fn pairs(backend: &Backend, found: &mut Found) -> Result<()> {
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 8, 3], Activation::Relu));
    let spec = RolloutSpec::new(20, 0.95).expect("a horizon");
    let task = DeviationTask {
        pairs: Pairs {
            nominal: drawn(whole_box(&system), 62),
            radius: 0.1,
            stream: Stream::new(62, purpose::DEVIATION_PERTURBATION, 0),
        },
        range: 0..COUNT,
        spec,
        tightening: &ramp(&spec),
        control: PairControl::ClosedLoop,
    };
    found.farthest = backend.prepare(&plant)?.deviation(&task, &mut |first, pairs| {
        assert_eq!(first, found.pairs.len() as u64, "pairs in order, each once");
        found.pairs.extend_from_slice(pairs);
        Ok(())
    })?;
    Ok(())
}

fn plans(backend: &Backend, found: &mut Found) -> Result<()> {
    let system = DoubleIntegrator::default();
    let cost = Quadratic { state: [2.0, 0.5], control: [0.1], last: [20.0, 5.0], obstacle: None };
    let settings = MppiSettings::new(&system.controls(), 100, 8);
    let planning =
        Planning::of::<_, _, 2, 1, 3>(&system, cost, MppiSpec::new(settings).expect("settings"));
    let problem = |number: u32| {
        let stream = Stream::new(63, Purpose::CONTROL_NOISE, number);
        MppiProblem::new([0.1 * number as f32, -0.2], &[[0.1]; 8], &[[0.0; 3]; 8], stream)
    };
    let problems: Vec<_> = (0..PROBLEMS).map(problem).collect();
    let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Each };
    found.plans = backend.prepare_plans(&planning)?.improve(&task)?;
    assert_eq!(found.plans.len(), problems.len(), "problems, each once");
    Ok(())
}

fn cpu() -> Cpu {
    Cpu::new(Some(2)).expect("two threads")
}

fn once(fault: Fault, submission: u64) -> Injection {
    Injection { fault, submission, repeats: false }
}

fn onwards(fault: Fault, submission: u64) -> Injection {
    Injection { repeats: true, ..once(fault, submission) }
}

/// Runs `work` on `gpu` with these failures: what it came to, what was noted, and the adapter back.
fn failing(gpu: Gpu, work: Work, asked: &[Injection]) -> (Gpu, Found, Result<()>, Vec<Event>) {
    let backend = Backend::Gpu(gpu.with_failures(asked.to_vec()));
    let (found, result) = run(&backend, work);
    let events = backend.events();
    let Backend::Gpu(gpu) = backend else { unreachable!("it was made a GPU above") };
    (gpu, found, result, events)
}

/// The adapter with the network kernels of `work`, a CPU behind it, and the results of both.
fn prepared(work: Work) -> Option<(Gpu, Found, Found)> {
    let networks = match work {
        Work::Measures(networks) | Work::Signs(networks) => networks,
        Work::Pairs | Work::Plans => NetworkKernels::Layered,
    };
    let gpu = gpu()?.with_networks(networks).with_fallback(cpu());
    let (gpu, plain, result, events) = failing(gpu, work, &[]);
    result.expect("a batch without failures");
    assert_eq!(events, []);
    let (host, result) = run(&Backend::Cpu(cpu()), work);
    result.expect("the host runs it");
    Some((gpu, plain, host))
}

/// What cuts a batch into several chunks.
fn small_chunks() -> Vec<Injection> {
    (0..2).map(|number| once(Fault::OutOfMemory, number)).collect()
}

#[test]
fn a_failure_at_any_submission_is_survived() {
    for work in WORKS {
        let Some((mut gpu, plain, host)) = prepared(work) else { return };
        let (back, found, ..) = failing(gpu, work, &small_chunks());
        assert_eq!(found, plain, "{work:?} in small chunks");
        gpu = back;
        let submissions = gpu.submissions();
        // Two that fail, and one for each chunk at least.
        assert!(submissions >= 5, "{work:?} has {submissions} submissions");
        for at in 2..submissions {
            for fault in SURVIVED {
                let asked = [small_chunks(), vec![once(fault, at)]].concat();
                let (back, found, result, events) = failing(gpu, work, &asked);
                result.expect("it goes on");
                let last = events.last().expect("an event");
                assert_eq!(last.fault, fault, "{work:?} at {at}");
                match last.action {
                    // A smallest chunk has no half.
                    Action::Cpu => assert_mixed(&found, (&plain, &host), last.index),
                    _ => assert_eq!(found, plain, "{work:?} after {fault} at {at}"),
                }
                gpu = back;
            }
            let asked = [small_chunks(), vec![once(Fault::Validation, at)]].concat();
            let (back, found, result, events) = failing(gpu, work, &asked);
            result.expect("the host goes on");
            let last = events.last().expect("an event");
            assert_eq!((last.fault, last.action), (Fault::Validation, Action::Cpu));
            assert_mixed(&found, (&plain, &host), last.index);
            gpu = back;
        }
    }
}

/// The results before `index` are the adapter's to the bit, the others the host's.
fn assert_mixed(found: &Found, (plain, host): (&Found, &Found), index: u64) {
    let expected = plain.then(host, index as usize);
    assert_eq!(found.values, expected.values);
    assert_eq!(found.pairs, expected.pairs);
    assert_eq!(found.plans, expected.plans);
    let near = |a: &Farthest, b: &Farthest| (a.distance - b.distance).abs() <= 1e-5;
    assert_eq!(found.farthest.len(), plain.farthest.len());
    assert!(found.farthest.iter().zip(&plain.farthest).all(|(a, b)| near(a, b)), "{found:?}");
}

#[test]
fn an_adapter_that_goes_on_failing_is_left() {
    for work in WORKS {
        for fault in [SURVIVED.as_slice(), &[Fault::Validation]].concat() {
            let Some((gpu, plain, host)) = prepared(work) else { return };
            let asked = [small_chunks(), vec![onwards(fault, LATE)]].concat();
            let (gpu, found, result, events) = failing(gpu, work, &asked);
            result.expect("the host goes on");
            let last = events.last().expect("an event");
            assert_eq!((last.fault, last.action), (fault, Action::Cpu), "{work:?}");
            assert_mixed(&found, (&plain, &host), last.index);
            let reopened = events.iter().filter(|event| event.action == Action::Reopened).count();
            assert_eq!(reopened, usize::from(fault == Fault::Lost), "{events:?}");
            let before = gpu.submissions();
            let backend = Backend::Gpu(gpu);
            let (again, result) = run(&backend, work);
            result.expect("the host");
            assert_eq!((again, backend.events()), (host, events), "later calls run on the host");
            let Backend::Gpu(gpu) = backend else { unreachable!("it was made a GPU above") };
            assert_eq!(gpu.submissions(), before);
        }
    }
}

/// Who is named is who computed: the CPU alone where the adapter gave nothing, both where it gave a part.
#[test]
fn results_are_of_the_devices_that_computed_them() {
    let work = Work::Measures(NetworkKernels::Layered);
    let at_once = vec![onwards(Fault::Validation, 0)];
    let late = [small_chunks(), vec![onwards(Fault::Validation, LATE)]].concat();
    for (asked, name) in [(at_once, "cpu"), (late, "gpu")] {
        let Some((gpu, ..)) = prepared(work) else { return };
        let (gpu, _, result, _) = failing(gpu, work, &asked);
        result.expect("the host goes on");
        let backend = Backend::Gpu(gpu);
        assert_eq!(backend.name(), name);
        assert!(backend.device().ends_with(&cpu().device()), "{}", backend.device());
        assert_eq!(backend.device() == cpu().device(), name == "cpu");
    }
}

#[test]
fn without_a_fallback_the_error_names_the_fault() {
    let work = Work::Measures(NetworkKernels::Layered);
    let Some((_, plain, _)) = prepared(work) else { return };
    for fault in [SURVIVED.as_slice(), &[Fault::Validation]].concat() {
        let Some(gpu) = gpu() else { return };
        let gpu = gpu.with_networks(NetworkKernels::Layered);
        let asked = [small_chunks(), vec![onwards(fault, LATE)]].concat();
        let (_, found, result, events) = failing(gpu, work, &asked);
        let error = result.expect_err("nobody to go on");
        assert!(matches!(error, Error::DeviceFailed { fault: found, .. } if found == fault));
        assert_eq!(error.exit_code(), 1);
        let text = error.to_string();
        assert!(text.contains(&fault.to_string()), "{text}");
        assert!(events.iter().all(|event| event.action != Action::Cpu));
        let delivered = found.values.len();
        assert!(0 < delivered && delivered < COUNT as usize, "{delivered}");
        assert_eq!(found.values, plain.values[..delivered]);
    }
}

#[test]
fn chunks_are_halved_down_to_a_smallest() {
    let work = Work::Measures(NetworkKernels::Layered);
    let Some((gpu, plain, _)) = prepared(work) else { return };
    for fault in [Fault::OutOfMemory, Fault::Timeout] {
        let asked = [once(fault, 0), once(fault, 1)];
        let Some(gpu) = crate::gpu() else { return };
        let (_, found, result, events) =
            failing(gpu.with_networks(NetworkKernels::Layered), work, &asked);
        result.expect("it goes on");
        assert_eq!(found, plain);
        let actions: Vec<Action> = events.iter().map(|event| event.action).collect();
        assert_eq!(actions, [Action::SmallerChunks(128), Action::SmallerChunks(64)]);
    }
    drop(gpu);
}

/// A failure that comes from the sink is the caller's, whatever it looks like.
#[test]
fn an_error_of_the_sink_is_not_survived() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu.with_fallback(cpu()));
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 8, 3], Activation::Relu));
    let spec = RolloutSpec::new(2, 0.95).expect("a horizon");
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 61),
        range: 0..COUNT,
        spec,
        tightening: &ramp(&spec),
        query: Query::Measure,
    };
    let mut calls = 0;
    let program = backend.prepare(&plant).expect("it fits");
    let result = program.reach_avoid(&task, &mut |_, _| {
        calls += 1;
        Err(Error::DeviceFailed { fault: Fault::Lost, problem: "another".to_owned() })
    });
    assert!(matches!(result, Err(Error::DeviceFailed { fault: Fault::Lost, .. })), "{result:?}");
    assert_eq!((calls, backend.events()), (1, Vec::new()));
}

/// The driver itself says that the time is over, unless it is done when it is asked: software
/// adapters may compute within the submission.
#[test]
fn work_that_takes_too_long_is_left() {
    let work = Work::Measures(NetworkKernels::Layered);
    let Some((gpu, adapter, host)) = prepared(work) else { return };
    let backend = Backend::Gpu(gpu.with_patience(Duration::from_nanos(1)));
    let (found, result) = run(&backend, work);
    result.expect("the host goes on");
    let events = backend.events();
    assert!(events.iter().all(|event| event.fault == Fault::Timeout), "{events:?}");
    let left = events.iter().find(|event| event.action == Action::Cpu);
    let left = left.map_or(COUNT, |event| event.index);
    assert_eq!(found, adapter.then(&host, left as usize));
}

#[test]
fn work_beyond_the_limits_goes_to_the_host() {
    let Some(gpu) = gpu() else { return };
    let gpu = gpu.with_networks(NetworkKernels::Fused);
    // No adapter fuses a network of this width.
    let system = DroneRace::default();
    let plant = Plant::of(system, random_network(&[12, 200, 3], Activation::Relu));
    let spec = RolloutSpec::new(2, 0.95).expect("a horizon");
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 61),
        range: 0..10,
        spec,
        tightening: &ramp(&spec),
        query: Query::Measure,
    };
    let refused = Backend::Gpu(gpu).prepare(&plant).err();
    assert!(matches!(refused, Some(Error::Device(_))), "{refused:?}");
    let Some(gpu) = crate::gpu() else { return };
    let backend = Backend::Gpu(gpu.with_networks(NetworkKernels::Fused).with_fallback(cpu()));
    let mut count = 0;
    let program = backend.prepare(&plant).expect("the host may run it");
    let result = program.reach_avoid(&task, &mut |_, values| {
        count += values.len();
        Ok(())
    });
    result.expect("the host runs it");
    let events = backend.events();
    assert_eq!((count, events.len(), events[0].fault), (10, 1, Fault::Unfit));
    assert!(events[0].to_string().contains("went on on the CPU"), "{}", events[0]);
}
