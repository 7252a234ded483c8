//! The published benchmark of a differential drive with a cost map, on one thread and on all.

use std::hint::black_box;
use std::slice::from_ref;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::control::DriveBenchmark;

fn diff_drive(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("diff_drive");
    for threads in [Some(1), None] {
        let backend = Backend::Cpu(Cpu::new(threads).expect("threads"));
        for samples in [2048, 16_384] {
            let benchmark = DriveBenchmark::new(samples).expect("settings");
            let task = benchmark.planner.task(from_ref(&benchmark.problem), 0);
            let (system, cost) = (&benchmark.system, &benchmark.planner.cost);
            let name = threads.map_or("all threads".to_owned(), |count| format!("{count} thread"));
            let steps = u64::from(samples) * benchmark.problem.plan.len() as u64;
            group.throughput(Throughput::Elements(steps));
            group.bench_with_input(BenchmarkId::new(name, samples), &task, |bencher, task| {
                bencher.iter(|| black_box(backend.mppi(system, cost, task).expect("a plan")));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, diff_drive);
criterion_main!(benches);
