//! Rollouts per second of each backend, beside bare matrix products of the same layers.
//!
//! `gemm` runs the layers of as many rollouts through the crate of that name, without bias,
//! activation or physics, on the same number of threads: `reach_avoid` over `gemm` is the share
//! of a good library's speed that the whole rollout keeps.

use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::{Choice, Gpu};
use reachcast::policy::{Activation, Layer, Mlp, OutputActivation, Policy};
use reachcast::real::Real;
use reachcast::rollout::{
    DeviationTask, PairControl, Pairs, Plant, Purpose, Query, ReachAvoidTask, RolloutSpec, Starts,
    Stream, Tightening,
};
use reachcast::scenario::boundary::Boundary;
use reachcast::scenario::settings::{Settings, SliceAxis};
use reachcast::scenario::{Context, Unwatched, global, growth};
use reachcast::system::DroneRace;

/// Steps of each rollout.
const HORIZON: u32 = 30;
/// Trajectories that `gemm` gets at a time, where it is fast at every width.
const TILE: usize = 192;

/// Hidden layers, and the batches they run; 4x512 takes seconds for 65,536.
const NETWORKS: [(&str, &[usize], &[u64]); 3] = [
    ("3x64", &[12, 64, 64, 64, 3], &[158, 4096, 65_536]),
    ("3x128", &[12, 128, 128, 128, 3], &[158, 4096, 65_536]),
    ("4x512", &[12, 512, 512, 512, 512, 3], &[158, 4096, 65_536]),
];

fn backends() -> Vec<(&'static str, Backend)> {
    let cpu = Cpu::new(None).expect("threads can be started");
    let mut all = vec![("cpu", Backend::Cpu(cpu))];
    // A software adapter is for tests: it would take minutes and say nothing about a GPU.
    if let Ok(gpu) = Gpu::open(&Choice::Hardware) {
        all.push(("gpu", Backend::Gpu(gpu)));
    }
    all
}

/// A network with random weights that keep the size of its activations.
fn network(widths: &[usize]) -> Mlp {
    let mut rng = StdRng::seed_from_u64(1);
    let mut layer = |inputs: usize, outputs: usize| {
        let scale = (6.0 / inputs as f32).sqrt();
        Layer {
            weight: (0..inputs * outputs).map(|_| rng.random_range(-scale..scale)).collect(),
            bias: vec![0.1; outputs],
            inputs,
            outputs,
        }
    };
    let layers = widths.windows(2).map(|pair| layer(pair[0], pair[1])).collect();
    Mlp::new(layers, Activation::Relu, OutputActivation::Tanh).expect("a valid network")
}

/// 65,536 starts within 5 cm of the study's 500.
fn race_starts() -> Vec<[f32; 12]> {
    let text = include_str!("../configs/race_starts_500.csv");
    let rows = text.lines().filter(|line| !line.starts_with('#'));
    let number = |cell: &str| cell.parse::<f32>().expect("a number");
    let row = |line: &str| {
        let mut cells = line.split(',').map(number);
        std::array::from_fn(|_| cells.next().expect("12 states"))
    };
    let study: Vec<[f32; 12]> = rows.map(row).collect();
    let mut rng = StdRng::seed_from_u64(2);
    let near = |i: usize| study[i % study.len()].map(|x| x + rng.random_range(-0.05..0.05));
    (0..65_536).map(near).collect()
}

/// Damping of the ego's velocities: physics without a network.
struct Damping;

impl Policy<12, 3> for Damping {
    fn name(&self) -> String {
        "damping".to_owned()
    }

    #[inline(always)]
    fn control<R: Real>(&self, x: [R; 12]) -> [R; 3] {
        let gain = R::lit(-0.5);
        [gain * x[1], gain * x[3], gain * x[5]]
    }
}

/// What all benches share.
struct Bench {
    backends: Vec<(&'static str, Backend)>,
    starts: Vec<[f32; 12]>,
    spec: RolloutSpec,
    tightening: Tightening,
}

impl Bench {
    fn new() -> Self {
        let spec = RolloutSpec::new(HORIZON, 0.95).expect("a valid specification");
        Self {
            backends: backends(),
            starts: race_starts(),
            spec,
            tightening: Tightening::none(&spec),
        }
    }

    fn reach_avoid<P: Policy<12, 3>>(
        &self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        (name, policy): (&str, &P),
        count: u64,
        query: Query,
    ) {
        let system = DroneRace::default();
        let plant = Plant { system: &system, policy };
        let task = ReachAvoidTask {
            starts: Starts::Listed(&self.starts),
            range: 0..count,
            spec: self.spec,
            tightening: &self.tightening,
            query,
        };
        for (backend, device) in &self.backends {
            group.throughput(Throughput::Elements(count));
            group.bench_function(BenchmarkId::new(format!("{backend}/{name}"), count), |b| {
                b.iter(|| {
                    let sink = &mut |_, values: &[f32]| {
                        black_box(values);
                        Ok(())
                    };
                    device.reach_avoid(plant, &task, sink).expect("the batch runs");
                });
            });
        }
    }

    fn deviation<P: Policy<12, 3>>(
        &self,
        group: &mut BenchmarkGroup<'_, WallTime>,
        (name, policy): (&str, &P),
        count: u64,
        control: PairControl,
    ) {
        let system = DroneRace::default();
        let plant = Plant { system: &system, policy };
        let task = DeviationTask {
            pairs: Pairs {
                nominal: Starts::Listed(&self.starts),
                radius: 0.1,
                stream: Stream::new(1, Purpose::User, 0),
            },
            range: 0..count,
            spec: self.spec,
            tightening: &self.tightening,
            control,
        };
        for (backend, device) in &self.backends {
            group.throughput(Throughput::Elements(count));
            let id = BenchmarkId::new(format!("{backend}/{name}/{control:?}"), count);
            group.bench_function(id, |b| {
                b.iter(|| {
                    let sink = &mut |_, values: &[_]| {
                        black_box(values);
                        Ok(())
                    };
                    device.deviation(plant, &task, sink).expect("the batch runs")
                });
            });
        }
    }
}

fn reach_avoid(criterion: &mut Criterion) {
    let bench = Bench::new();
    let mut group = criterion.benchmark_group("reach_avoid");
    for (name, widths, counts) in NETWORKS {
        let policy = network(widths);
        for &count in counts {
            bench.reach_avoid(&mut group, (name, &policy), count, Query::Measure);
        }
    }
    bench.reach_avoid(&mut group, ("formula", &Damping), 65_536, Query::Measure);
}

fn sign(criterion: &mut Criterion) {
    let bench = Bench::new();
    let file = "configs/policies/race_policy.safetensors";
    let policy = Mlp::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file));
    let policy = policy.expect("the race policy is there");
    let mut group = criterion.benchmark_group("sign");
    for count in [158, 65_536] {
        bench.reach_avoid(&mut group, ("dense", &policy), count, Query::Measure);
        bench.reach_avoid(&mut group, ("sign", &policy), count, Query::Sign);
    }
}

fn deviation(criterion: &mut Criterion) {
    let bench = Bench::new();
    let policy = network(NETWORKS[0].1);
    let mut group = criterion.benchmark_group("deviation");
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        bench.deviation(&mut group, ("3x64", &policy), 16_384, control);
        bench.deviation(&mut group, ("formula", &Damping), 16_384, control);
    }
}

/// What a controller does between two steps: the slice of 468 states, and a growth whose five rounds
/// of 159 starts all have failures.
fn growth_round(criterion: &mut Criterion) {
    let bench = Bench::new();
    let system = DroneRace::default();
    let file = "configs/policies/race_policy.safetensors";
    let policy = Mlp::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file));
    let policy = policy.expect("the race policy is there");
    let plant = Plant { system: &system, policy: &policy };
    let mut settings = Settings::new(&system, bench.starts[0], bench.spec);
    let axis = |state, low: f32, cells: u8| SliceAxis {
        state,
        values: (0..cells).map(|i| low + 0.1 * f32::from(i)).collect(),
    };
    settings.slice = [axis(0, -0.9, 18), axis(2, -2.6, 26)];
    settings.growth.rounds = 5;
    // A start beside the fence, whose neighbourhood fails however small the ball.
    let mut point = bench.starts[0];
    (point[0], point[2]) = (0.6, -0.55);
    let boundary = Boundary { point, distance: 0.0 };
    let mut group = criterion.benchmark_group("growth");
    for (name, backend) in &bench.backends {
        let context = Context { backend, plant, watch: &Unwatched };
        group.bench_function(BenchmarkId::new(*name, "slice + 5 x 159"), |b| {
            b.iter(|| {
                let slice = global::slice(context, &settings, &bench.tightening, 0.0);
                black_box(slice.expect("a slice"));
                let (outcome, rounds, _) =
                    growth::grow(context, &settings, &boundary, 0.0, 0).expect("a growth");
                assert_eq!(rounds.len(), 5, "{outcome:?}: every round has a failure");
            });
        });
    }
}

/// The layers alone, by the `gemm` crate; one element is the layers of one rollout.
fn gemm(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("gemm");
    for (name, widths, counts) in NETWORKS {
        let policy = network(widths);
        for &count in counts {
            let count = count as usize;
            let tile = TILE.min(count.div_ceil(rayon::current_num_threads()));
            let starts = (0..count).step_by(tile);
            let tiles: Vec<usize> = starts.map(|first| tile.min(count - first)).collect();
            group.throughput(Throughput::Elements(count as u64));
            group.bench_function(BenchmarkId::new(name, count), |b| {
                b.iter(|| tiles.par_iter().for_each(|lanes| layers(&policy, *lanes)));
            });
        }
    }
}

/// The layers of `policy` for a tile of `lanes` trajectories, `HORIZON` times.
#[allow(unsafe_code, reason = "the crate's interface takes pointers")]
fn layers(policy: &Mlp, lanes: usize) {
    let widest = policy.widths().into_iter().max().unwrap_or(0);
    let mut x = vec![0.5_f32; widest * lanes];
    let mut y = x.clone();
    for _ in 0..HORIZON {
        for layer in policy.layers() {
            let (inputs, outputs) = (layer.inputs, layer.outputs);
            // SAFETY: x is `[inputs, lanes]` and y `[outputs, lanes]`, both of at least that
            // size; the weights are `[outputs, inputs]`.
            unsafe {
                gemm::gemm(
                    lanes,
                    outputs,
                    inputs,
                    y.as_mut_ptr(),
                    lanes as isize,
                    1,
                    false,
                    x.as_ptr(),
                    lanes as isize,
                    1,
                    layer.weight.as_ptr(),
                    inputs as isize,
                    1,
                    0.0,
                    1.0,
                    false,
                    false,
                    false,
                    gemm::Parallelism::None,
                );
            }
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
    targets = reach_avoid, sign, deviation, growth_round, gemm
}
criterion_main!(benches);
