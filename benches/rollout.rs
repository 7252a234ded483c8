//! Rollouts per second of each backend, beside a plain loop and bare products of the same layers.
//!
//! `gemm` runs the layers of as many rollouts through the crate of that name, without bias,
//! activation or physics, on the same number of threads: `reach_avoid` over `gemm` is the share
//! of a good library's speed that the whole rollout keeps.

mod scalar;

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use rayon::prelude::*;
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::{Choice, Gpu};
use reachcast::bench::limits::multiply;
use reachcast::model::Plant;
use reachcast::policy::{Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::race::bench::data::{self, Data, HORIZON};
use reachcast::rollout::{
    DeviationTask, PairControl, Pairs, Purpose, Query, ReachAvoidTask, RolloutSpec, Starts, Stream,
    Tightening,
};
use reachcast::scenario::boundary::Boundary;
use reachcast::scenario::criterion::Criterion as Certifying;
use reachcast::scenario::settings::{Settings, SliceAxis};
use reachcast::scenario::{Context, Unwatched, global, growth};

use scalar::Damping;

/// Trajectories that `gemm` gets at a time, where it is fast at every width.
const TILE: usize = 192;

/// Batches; 4x512 takes seconds for 65,536.
const COUNTS: [u64; 3] = [158, 4096, 65_536];

fn backends() -> Vec<(&'static str, Backend)> {
    let cpu = Cpu::new(None).expect("threads can be started");
    let mut all = vec![("cpu", Backend::Cpu(cpu))];
    // A software adapter is for tests: it would take minutes and say nothing about a GPU.
    if let Ok(gpu) = Gpu::open(&Choice::Hardware) {
        all.push(("gpu", Backend::Gpu(gpu)));
    }
    all
}

/// The race under `policy`.
fn race<P: Policy<12, 3> + Send + Sync + 'static>(policy: P) -> Plant {
    Plant::of(DroneRace::default(), policy)
}

/// What all benches share.
struct Bench {
    backends: Vec<(&'static str, Backend)>,
    data: Data,
    spec: RolloutSpec,
    tightening: Tightening,
}

impl Bench {
    fn new() -> Self {
        let spec = data::rollout_spec().expect("a valid specification");
        Self {
            backends: backends(),
            data: Data::new(1).expect("the data are whole"),
            spec,
            tightening: Tightening::none(&spec),
        }
    }

    fn reach_avoid(
        &self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        (name, plant): (&str, &Plant),
        count: u64,
        query: Query,
    ) {
        let task = ReachAvoidTask {
            starts: Starts::listed(&*self.data.starts),
            range: 0..count,
            spec: self.spec,
            tightening: &self.tightening,
            query,
        };
        for (backend, device) in &self.backends {
            let program = device.prepare(plant).expect("it fits");
            group.throughput(Throughput::Elements(count));
            group.bench_function(BenchmarkId::new(format!("{backend}/{name}"), count), |b| {
                b.iter(|| {
                    let sink = &mut |_, values: &[f32]| {
                        black_box(values);
                        Ok(())
                    };
                    program.reach_avoid(&task, sink).expect("the batch runs");
                });
            });
        }
    }

    fn deviation(
        &self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        (name, plant): (&str, &Plant),
        count: u64,
        control: PairControl,
    ) {
        let task = DeviationTask {
            pairs: Pairs {
                nominal: Starts::listed(&*self.data.starts),
                radius: 0.1,
                stream: Stream::new(1, Purpose::USER, 0),
            },
            range: 0..count,
            spec: self.spec,
            tightening: &self.tightening,
            control,
        };
        for (backend, device) in &self.backends {
            let program = device.prepare(plant).expect("it fits");
            group.throughput(Throughput::Elements(count));
            let id = BenchmarkId::new(format!("{backend}/{name}/{control:?}"), count);
            group.bench_function(id, |b| {
                b.iter(|| {
                    let sink = &mut |_, values: &[_]| {
                        black_box(values);
                        Ok(())
                    };
                    program.deviation(&task, sink).expect("the batch runs")
                });
            });
        }
    }
}

fn reach_avoid(criterion: &mut Criterion) {
    let bench = Bench::new();
    let mut group = criterion.benchmark_group("reach_avoid");
    for (name, policy) in &bench.data.networks {
        let plant = race(Mlp::clone(policy));
        for count in COUNTS {
            bench.reach_avoid(&mut group, (name, &plant), count, Query::Measure);
        }
    }
    bench.reach_avoid(&mut group, ("formula", &race(Damping)), 65_536, Query::Measure);
}

fn sign(criterion: &mut Criterion) {
    let bench = Bench::new();
    let plant = race(Mlp::clone(&bench.data.policy));
    let mut group = criterion.benchmark_group("sign");
    for count in [158, 65_536] {
        bench.reach_avoid(&mut group, ("dense", &plant), count, Query::Measure);
        bench.reach_avoid(&mut group, ("sign", &plant), count, Query::Sign);
    }
}

fn deviation(criterion: &mut Criterion) {
    let bench = Bench::new();
    let (name, policy) = &bench.data.networks[0];
    let (dense, formula) = (race(Mlp::clone(policy)), race(Damping));
    let mut group = criterion.benchmark_group("deviation");
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        bench.deviation(&mut group, (name, &dense), 16_384, control);
        bench.deviation(&mut group, ("formula", &formula), 16_384, control);
    }
}

/// A plain loop on one thread over the first starts, the rival of `reach_avoid`.
fn scalar_loop(criterion: &mut Criterion) {
    let bench = Bench::new();
    let system = DroneRace::default();
    let starts = &bench.data.starts[..158];
    let (name, policy) = &bench.data.networks[0];
    let mut group = criterion.benchmark_group("scalar loop");
    group.throughput(Throughput::Elements(starts.len() as u64));
    group.bench_function("formula", |b| {
        b.iter(|| black_box(scalar::measures(&system, &Damping, starts, bench.spec)));
    });
    group.bench_function(*name, |b| {
        b.iter(|| black_box(scalar::measures(&system, &**policy, starts, bench.spec)));
    });
    group.finish();
}

/// What a controller does between two steps: the slice of 468 states, and a growth whose five rounds
/// of 159 starts all have failures.
fn growth_round(criterion: &mut Criterion) {
    let bench = Bench::new();
    let plant = race(Mlp::clone(&bench.data.policy));
    let settings = Settings::new(&plant.model, bench.data.starts[0], bench.spec);
    let mut settings = settings.expect("a start of the race");
    let axis = |state, low: f32, cells: u8| SliceAxis {
        state,
        values: (0..cells).map(|i| low + 0.1 * f32::from(i)).collect(),
    };
    settings.slice = Some([axis(0, -0.9, 18), axis(2, -2.6, 26)]);
    settings.growth.rounds = 5;
    // A start beside the fence, whose neighbourhood fails however small the ball.
    let mut point = bench.data.starts[0];
    (point[0], point[2]) = (0.6, -0.55);
    let boundary = Boundary { point: point.to_vec(), distance: 0.0 };
    let tightened = Certifying::Margins(bench.tightening.clone());
    let mut group = criterion.benchmark_group("growth");
    for (name, backend) in &bench.backends {
        let program = backend.prepare(&plant).expect("a program");
        let context = Context { program: &program, watch: &Unwatched };
        group.bench_function(BenchmarkId::new(*name, "slice + 5 x 159"), |b| {
            b.iter(|| {
                let slice = global::slice(context, &settings, &tightened, 0.0);
                black_box(slice.expect("a slice"));
                let run = growth::grow(context, &settings, &boundary, 0.0, 0).expect("a growth");
                let outcome = run.outcome;
                assert_eq!(run.rounds.len(), 5, "{outcome:?}: every round has a failure");
            });
        });
    }
}

/// The layers alone, by the `gemm` crate; one element is the layers of one rollout.
fn gemm(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("gemm");
    let data = Data::new(1).expect("the data are whole");
    for (name, policy) in &data.networks {
        for count in COUNTS {
            let count = count as usize;
            let tile = TILE.min(count.div_ceil(rayon::current_num_threads()));
            let starts = (0..count).step_by(tile);
            let tiles: Vec<usize> = starts.map(|first| tile.min(count - first)).collect();
            group.throughput(Throughput::Elements(count as u64));
            group.bench_function(BenchmarkId::new(*name, count), |b| {
                b.iter(|| tiles.par_iter().for_each(|lanes| layers(policy, *lanes)));
            });
        }
    }
}

/// The layers of `policy` for a tile of `lanes` trajectories, `HORIZON` times.
fn layers(policy: &Mlp, lanes: usize) {
    let widest = policy.widths().into_iter().max().unwrap_or(0);
    let mut x = vec![0.5_f32; widest * lanes];
    let mut y = x.clone();
    for _ in 0..HORIZON {
        for layer in policy.layers() {
            let (inputs, outputs) = (layer.inputs, layer.outputs);
            multiply(&mut y, &layer.weight, &x, [outputs, inputs, lanes]);
        }
    }
    black_box((&mut x, &mut y));
}

fn short() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2))
}

criterion_group! {
    name = benches;
    config = short();
    targets = reach_avoid, scalar_loop, sign, deviation, growth_round, gemm
}
criterion_main!(benches);
