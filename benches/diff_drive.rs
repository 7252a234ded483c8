//! The published benchmark of a differential drive with a cost map, on one thread and on all.

use std::hint::black_box;
use std::slice::from_ref;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::control::DriveBenchmark;
use reachcast::rollout::{CostQuery, MppiTask};

fn diff_drive(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("diff_drive");
    for threads in [Some(1), None] {
        let backend = Backend::Cpu(Cpu::new(threads).expect("threads"));
        for samples in [2048, 16_384] {
            let benchmark = DriveBenchmark::new(samples).expect("settings");
            let problems = from_ref(&benchmark.problem);
            let task = MppiTask { problems, iteration: 0, costs: CostQuery::Summary };
            let program = backend.prepare_plans(&benchmark.planning).expect("a program");
            let name = threads.map_or("all threads".to_owned(), |count| format!("{count} thread"));
            let steps = u64::from(samples) * benchmark.planning.spec.horizon() as u64;
            group.throughput(Throughput::Elements(steps));
            group.bench_with_input(BenchmarkId::new(name, samples), &task, |bencher, task| {
                bencher.iter(|| black_box(program.improve(task).expect("a plan")));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, diff_drive);
criterion_main!(benches);
