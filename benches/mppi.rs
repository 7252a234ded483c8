//! MPPI: plans per second with and without the value network, on one thread and on all, beside a
//! plain loop.

mod scalar;

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::config::{Config, Overrides, Profile};
use reachcast::model::Plant;
use reachcast::policy::Mlp;
use reachcast::race::bench::data::{self, PLAN};
use reachcast::race::{DroneRace, Fence, RaceCost, RecoveryCost, Safety};
use reachcast::rollout::{CostQuery, MppiProblem, MppiTask, Planning, Query, ValueTerm};
use reachcast::scenario::global::{check_margins, slice_through};
use reachcast::scenario::growth_batch::{Request, grow_each};
use reachcast::scenario::{Context, Unwatched, tightened};
use reachcast::system::System;

fn problems(count: u32) -> Vec<MppiProblem> {
    (0..count).map(|number| data::mppi_problem(1, number)).collect()
}

fn planning(samples: u32, cost: RaceCost, value: Option<ValueTerm>) -> Planning {
    let spec = data::mppi_spec(samples).expect("settings");
    Planning { value, ..Planning::of(&DroneRace::default(), cost, spec) }
}

fn task(problems: &[MppiProblem]) -> MppiTask<'_> {
    MppiTask { problems, iteration: 0, costs: CostQuery::Summary }
}

fn value_term(network: &Mlp) -> ValueTerm {
    ValueTerm { network: Arc::new(network.clone()), weight: 1e6, threshold: -0.02 }
}

fn recovery() -> RaceCost {
    RaceCost::Recovery(RecoveryCost {
        position: 5.0,
        velocity: 1.0,
        control: 0.1,
        safety: Safety { weight: 5.0, ..Safety::NONE },
        fence: Fence::NONE,
    })
}

fn plain(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("mppi");
    let system = DroneRace::default();
    for threads in [Some(1), None] {
        let backend = Backend::Cpu(Cpu::new(threads).expect("threads"));
        for samples in [500, 1024, 16_384] {
            let (planning, problems) = (planning(samples, data::lane(), None), problems(1));
            let program = backend.prepare_plans(&planning).expect("a program");
            let task = task(&problems);
            let name = threads.map_or("all threads".to_owned(), |count| format!("{count} thread"));
            group.throughput(Throughput::Elements(u64::from(samples * PLAN)));
            group.bench_with_input(BenchmarkId::new(name, samples), &task, |bencher, task| {
                bencher.iter(|| black_box(program.improve(task).expect("a plan")));
            });
            if samples == 1024 && threads.is_some() {
                group.bench_with_input("scalar loop/1024", &problems[0], |bencher, problem| {
                    let plan = || scalar::plan(&system, &data::lane(), &planning, problem);
                    bencher.iter(|| black_box(plan()));
                });
            }
        }
    }
    group.finish();
}

fn with_value(criterion: &mut Criterion) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let network =
        Mlp::load(&root.join("configs/policies/race_value.safetensors")).expect("network");
    let mut group = criterion.benchmark_group("mppi with value");
    for (threads, count) in [(Some(1), 1), (None, 1), (None, 64)] {
        let backend = Backend::Cpu(Cpu::new(threads).expect("threads"));
        let planning = planning(500, recovery(), Some(value_term(&network)));
        let program = backend.prepare_plans(&planning).expect("a program");
        let problems = problems(count);
        let task = task(&problems);
        let name = threads.map_or("all threads".to_owned(), |count| format!("{count} thread"));
        group.throughput(Throughput::Elements(u64::from(500 * PLAN * count)));
        group.bench_with_input(BenchmarkId::new(name, count), &task, |bencher, task| {
            bencher.iter(|| black_box(program.improve(task).expect("plans")));
        });
    }
    group.finish();
}

/// The work of a control step of one race at its worst in the profile `study`: the slice of 468
/// states, 5 rounds of 158 starts, and a plan with the value term.
fn hybrid_step(criterion: &mut Criterion) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let overrides = Overrides { profile: Some(Profile::Study), ..Overrides::default() };
    let config = Config::load(&root.join("configs/race.toml"), &overrides).expect("configuration");
    let system = DroneRace::default();
    let settings = config.settings(&system.states()).expect("settings");
    let load = |file: &str| Mlp::load(&root.join("configs/policies").join(file)).expect("network");
    let (policy, network) = (load("race_policy.safetensors"), load("race_value.safetensors"));
    let backend = Backend::Cpu(Cpu::new(None).expect("threads"));
    let program = backend.prepare(&Plant::of(system, policy)).expect("a program");
    let context = Context { program: &program, watch: &Unwatched };
    let tightening = tightened(context, &settings).expect("deviation bound").tightening;
    // A centre that fails at any radius, so that all rounds are flown.
    let mut center = settings.state.clone();
    (center[0], center[2], center[6], center[8]) = (0.0, -1.0, 0.1, -0.9);
    let request = [Request { center, seed: 1, call: 0 }];
    let planning = planning(500, recovery(), Some(value_term(&network)));
    let plans = backend.prepare_plans(&planning).expect("a program");
    let problems = problems(1);
    let cells = slice_through(&settings, &settings.state);
    let slice = || {
        check_margins(context, &settings.spec, &tightening, cells.view(), Query::Sign, 0.0)
            .expect("a slice")
    };
    let grow = || grow_each(context, &settings, &request, 0.0).expect("a ball");
    assert_eq!(grow()[0].rounds, settings.growth.rounds, "all rounds are flown");
    let mut group = criterion.benchmark_group("hybrid step");
    group.bench_function("slice", |bencher| bencher.iter(|| black_box(slice())));
    group.bench_function("growth", |bencher| bencher.iter(|| black_box(grow())));
    group.bench_function("all", |bencher| {
        bencher.iter(|| {
            let plan = plans.improve(&task(&problems)).expect("a plan");
            black_box((slice(), grow(), plan))
        });
    });
    group.finish();
}

criterion_group!(benches, plain, with_value, hybrid_step);
criterion_main!(benches);
