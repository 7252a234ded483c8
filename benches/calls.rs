//! What the host's part of a call costs on an adapter: one step of one trajectory, so that little is
//! left but the call itself. A plant prepared once, and what preparing it anew would add: its texts
//! printed and its kernels composed.
//!
//! `cargo bench --bench calls`

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use reachcast::backend::Backend;
use reachcast::backend::gpu::compose::{Kernel, PlantText};
use reachcast::backend::gpu::{Choice, Gpu, NetworkKernels};
use reachcast::bench;
use reachcast::model::{Controller, Model, Plant};
use reachcast::policy::{Activation, Layer, Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::rollout::{Query, ReachAvoidTask, Region, RolloutSpec, Starts, Stream, Tightening};
use reachcast::system::{BangBang, DoubleIntegrator, System};

/// A network from 12 states to 3 controls.
fn network(width: usize, depth: usize) -> Mlp {
    let widths = [&[12][..], &vec![width; depth], &[3]].concat();
    let layer = |pair: &[usize]| Layer::dense(vec![0.01; pair[0] * pair[1]], vec![0.0; pair[1]]);
    let layers = widths.windows(2).map(layer).collect();
    Mlp::new(layers, Activation::Relu, Activation::Tanh).expect("a whole network")
}

/// Calls of one plant on one adapter.
fn calls<S, P, const NX: usize, const NU: usize>(
    criterion: &mut Criterion,
    name: &str,
    backend: &Backend,
    (system, policy): (S, P),
) where
    S: System<NX, NU> + Clone + Send + Sync + 'static,
    P: Policy<NX, NU> + Clone + Send + Sync + 'static,
{
    let axes = system.states();
    let (low, high) = (axes.each_ref().map(|a| a.low), axes.each_ref().map(|a| a.high));
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let task = ReachAvoidTask {
        starts: Starts::Drawn {
            region: Region::new_box(low, high).expect("a box"),
            stream: Stream::new(1, bench::PURPOSE, 0),
        },
        range: 0..1,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let mut group = criterion.benchmark_group("calls");
    let plant = Plant::of(system.clone(), policy.clone());
    let program = backend.prepare(&plant).expect("it fits");
    let id = |what: &str| BenchmarkId::new(what, name);
    group.bench_function(id("prepared"), |bench| {
        bench.iter(|| program.reach_avoid(&task, &mut |_, _| Ok(())).expect("it runs"));
    });
    group.bench_function(id("prepare_again"), |bench| {
        bench.iter(|| backend.prepare(&plant).expect("it fits"));
    });
    group.bench_function(id("texts"), |bench| {
        bench.iter(|| {
            let controller = Controller::of(&system, policy.clone());
            let text = PlantText::new(&Model::of(system.clone()), &controller).expect("it fits");
            [Kernel::Sample, Kernel::ReachAvoid].map(|kernel| text.compose(kernel).len())
        });
    });
    group.finish();
}

fn all(criterion: &mut Criterion) {
    let networks = [
        ("3x64 fused", NetworkKernels::Fused, network(64, 3)),
        ("3x64 layers", NetworkKernels::Layered, network(64, 3)),
        ("4x512 layers", NetworkKernels::Layered, network(512, 4)),
    ];
    for (name, kernels, mlp) in networks {
        let Ok(gpu) = Gpu::open(&Choice::Any) else { return };
        let backend = Backend::Gpu(gpu.with_networks(kernels));
        calls(criterion, name, &backend, (DroneRace::default(), mlp));
    }
    let Ok(gpu) = Gpu::open(&Choice::Any) else { return };
    let plant = (DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    calls(criterion, "double integrator", &Backend::Gpu(gpu), plant);
}

criterion_group!(benches, all);
criterion_main!(benches);
