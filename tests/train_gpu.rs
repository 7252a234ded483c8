//! Training on an adapter: layers, slopes and updates against the CPU's and against f64, and the
//! command with `--backend gpu`.
//!
//! Without an adapter every test says so and passes, unless `REACHCAST_REQUIRE_GPU` is 1.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod command;
mod common;
mod training;

use std::ops::Range;

use burn_tensor::Tensor;
use command::{Folder, document, refused};
use common::activations::exact;
use common::{adapter, cpu};
use reachcast::backend::Backend;
use reachcast::bench;
use reachcast::model::{Model, Plant};
use reachcast::policy::Activation;
use reachcast::race::DroneRace;
use reachcast::rollout::Stream;
use reachcast::system::{BangBang, DoubleIntegrator, System};
use reachcast::train::analytic::{Analytic, LAST, Task};
use reachcast::train::ddpg::{Ddpg, Game};
use reachcast::train::device::{Device, floats};
use reachcast::train::layer::layer;
use reachcast::train::network::{Architecture, Network};
use reachcast::train::ppo::{self, Ppo};
use reachcast::train::purpose;
use reachcast::train::reward::Reward;
use reachcast::train::run::Learner;
use reachcast::train::samples::Source;
use reachcast::train::value::{self, Value};
use reachcast::{Error, Result};
use training::{config, intervals, losses, random, settings, task};

/// Most rows and neurons that settings take.
const MOST: usize = 1 << 15;

/// What follows the products of a layer.
const CURVES: [Activation; 16] = Activation::ALL;

/// The CPU and an adapter; `None`, said aloud, where no adapter opens.
fn devices() -> Option<[Device; 2]> {
    Some([Device::cpu(), Device::gpu(&adapter()?).unwrap()])
}

/// Random numbers within `-reach..reach`.
fn drawn(number: u32, count: usize, reach: f32) -> Vec<f32> {
    let stream = Stream::new(9, bench::PURPOSE, number);
    let lanes = stream.in_box::<1>(&vec![-reach; count], &vec![reach; count], 0);
    lanes.iter().map(|lane| lane.0[0]).collect()
}

/// A layer, and what its outputs are weighted with.
struct Case {
    rows: usize,
    inputs: usize,
    outputs: usize,
    x: Vec<f32>,
    weight: Vec<f32>,
    bias: Vec<f32>,
    seeds: Vec<f32>,
}

impl Case {
    /// Sums of a layer lie within about -2..2 whatever its width.
    fn new([rows, inputs, outputs]: [usize; 3]) -> Self {
        let reach = 2.0 / (inputs as f32).sqrt();
        Self {
            rows,
            inputs,
            outputs,
            x: drawn(0, rows * inputs, 1.5),
            weight: drawn(1, inputs * outputs, reach),
            bias: drawn(2, outputs, 1.0),
            seeds: drawn(3, rows * outputs, 1.0),
        }
    }

    /// Outputs, and slopes of their weighted sum by `x`, weights and biases.
    fn run(&self, device: &Device, curve: Activation) -> [Vec<f32>; 4] {
        let leaf = |values: &Vec<f32>, shape| device.tensor(values.clone(), shape).require_grad();
        let x = leaf(&self.x, [self.rows, self.inputs]);
        let weight = leaf(&self.weight, [self.inputs, self.outputs]);
        let bias = leaf(&self.bias, [1, self.outputs]);
        let outputs = layer(x.clone(), weight.clone(), bias.clone(), curve);
        let seeds = device.tensor(self.seeds.clone(), [self.rows, self.outputs]);
        let grads = (outputs.clone() * seeds).sum().backward();
        let slopes = |leaf: &Tensor<2>| floats(leaf.grad(&grads).unwrap());
        [floats(outputs), slopes(&x), slopes(&weight), slopes(&bias)]
    }

    /// What the curve of output `j` of row `i` bends, in f64.
    fn sum(&self, i: usize, j: usize) -> f64 {
        let products = (0..self.inputs).map(|k| {
            f64::from(self.x[i * self.inputs + k]) * f64::from(self.weight[k * self.outputs + j])
        });
        f64::from(self.bias[j]) + products.sum::<f64>()
    }
}

/// Its slope as a central difference.
fn slope(curve: Activation, x: f64) -> f64 {
    (exact(curve, x + 1e-6) - exact(curve, x - 1e-6)) / 2e-6
}

/// How far `found` lies from `expected`, of the length of what is expected.
fn apart(found: &[f32], expected: &[f32]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let length = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let pairs = found.iter().zip(expected);
    let error = length(&mut pairs.map(|(a, b)| f64::from(*a) - f64::from(*b)));
    error / length(&mut expected.iter().map(|x| f64::from(*x))).max(1e-12)
}

/// Outputs and slopes of a layer are those of f64, and the CPU's, for each activation.
#[test]
fn layers_are_those_of_f64() {
    let Some([host, remote]) = devices() else { return };
    let case = Case::new([37, 12, 9]);
    for curve in CURVES {
        let [outputs, by_x, by_weight, by_bias] = &case.run(&remote, curve);
        let (rows, inputs, columns) = (case.rows, case.inputs, case.outputs);
        let cells = || (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
        let (mut x, mut weight) = (vec![0.0; rows * inputs], vec![0.0; inputs * columns]);
        let mut bias = vec![0.0; columns];
        for (i, j) in cells() {
            let seed = f64::from(case.seeds[i * columns + j]) * slope(curve, case.sum(i, j));
            bias[j] += seed;
            for k in 0..inputs {
                x[i * inputs + k] += seed * f64::from(case.weight[k * columns + j]);
                weight[k * columns + j] += seed * f64::from(case.x[i * inputs + k]);
            }
        }
        let exact: Vec<f64> = cells().map(|(i, j)| exact(curve, case.sum(i, j))).collect();
        for (found, exact) in
            [outputs, by_x, by_weight, by_bias].into_iter().zip([exact, x, weight, bias])
        {
            for (found, exact) in found.iter().zip(&exact) {
                let error = (f64::from(*found) - exact).abs();
                assert!(error <= 1e-5 * (1.0 + exact.abs()), "{curve:?}: {found} {exact}");
            }
        }
        for (found, expected) in case.run(&remote, curve).iter().zip(case.run(&host, curve)) {
            assert!(apart(found, &expected) < 2e-6, "{curve:?}");
        }
    }
}

/// Products and sums of the largest sizes in use are whole: a software adapter cuts loops of 65,535
/// turns and more short.
#[test]
fn large_products_are_whole() {
    let Some([host, remote]) = devices() else { return };
    for shape in [[2048, 512, 512], [4096, 12, 64], [1, 512, 512], [MOST, 3, 2], [2, MOST, 3]] {
        let case = Case::new(shape);
        let curve = Activation::Identity;
        for (found, expected) in case.run(&remote, curve).iter().zip(case.run(&host, curve)) {
            let error = apart(found, &expected);
            println!("{shape:?}: {error:.1e}");
            assert!(error < 2e-5, "{shape:?}: {error}");
        }
    }
    let values: Vec<f32> = drawn(4, 2 * MOST, 1.0).iter().map(|x| x + 1.0).collect();
    let sums = |device: &Device| {
        let rows = device.tensor(values.clone(), [MOST, 2]);
        let parts = [rows.clone().sum_dim(0), rows.clone().mean_dim(0)].map(floats).concat();
        [parts, floats(rows.clone().sum()), floats(rows.mean())].concat()
    };
    let error = apart(&sums(&remote), &sums(&host));
    println!("sums: {error:.1e}");
    assert!(error < 1e-5, "{error}");
}

/// The slopes of both softened measures of the race by all parameters are the CPU's.
#[test]
fn slopes_of_the_softened_measure_are_the_cpus() {
    let Some(devices) = devices() else { return };
    let (system, backend, config) =
        (DroneRace::default(), cpu(1), config("drone-race", "analytic", &[]));
    let network = random(&system, &[64, 64], 1.0);
    let losses = Some(losses(&config.spec().unwrap()));
    let starts = config.mixture(&system.states()).unwrap().draw(9, purpose::START, 3, 100);
    let [expected, found] = devices.map(|device| {
        let task = Task { tightening: losses.clone(), ..task(&system, &backend, &device, &config) };
        let learner = Analytic::new(task, network.clone(), settings(&config).analytic);
        let bound = network.bind(&device);
        let measures = learner.measures(&bound, starts.view(), 0.4);
        (bound.gradient(&measures.clone().sum().backward()), floats(measures))
    });
    let errors = [apart(&found.0, &expected.0), apart(&found.1, &expected.1)];
    println!("slopes and measures differ by {errors:?} of their length");
    assert!(errors[0] < 1e-5 && errors[1] < 1e-5, "{errors:?}");
}

/// All that `learner` holds after these updates, by name.
fn updated(learner: &mut dyn Learner, updates: Range<u64>) -> Vec<(&'static str, Vec<f32>)> {
    for iteration in updates {
        assert!(learner.update(iteration).unwrap().is_finite(), "{iteration}");
    }
    learner.arrays().into_iter().map(|(name, values)| (name, values.clone())).collect()
}

/// One update on the CPU and on an adapter comes to the same; more leave everything finite, and
/// from what was stored between two of them they come to the same bits.
fn agree<L: Learner>(make: impl Fn(&Device) -> L) {
    let Some(devices) = devices() else { return };
    let [mut host, mut remote] = devices.each_ref().map(&make);
    let expected = updated(&mut host, 0..1);
    for ((name, found), (_, expected)) in updated(&mut remote, 0..1).iter().zip(&expected) {
        let error = apart(found, expected);
        println!("{name}: {error:.1e}");
        assert!(error < 1e-3, "{name}: {error}");
    }
    let mut resumed = make(&devices[1]);
    for ((_, to), (_, from)) in resumed.arrays().into_iter().zip(updated(&mut remote, 1..3)) {
        *to = from;
    }
    let whole = updated(&mut remote, 3..5);
    assert!(whole.iter().all(|(_, values)| values.iter().all(|x| x.is_finite())));
    assert!(updated(&mut resumed, 3..5) == whole, "resumed");
    assert!(remote.scores().unwrap().iter().all(|score| score.is_finite()));
}

#[test]
fn a_policy_through_the_dynamics_is_updated_as_on_the_cpu() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(1));
    let config = config("double-integrator", "analytic", &["train.held_out=256"]);
    agree(|device| {
        let network = random(&system, &[32, 32], LAST);
        let task = task(&system, &backend, device, &config);
        Analytic::new(task, network, settings(&config).analytic)
    });
}

#[test]
fn a_value_is_updated_as_on_the_cpu() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(1));
    let config = config("double-integrator", "analytic", &[]);
    let plant = Plant::of(system, BangBang { acceleration: 1.0 });
    let source = Source {
        program: &backend.prepare(&plant).unwrap(),
        spec: config.spec().unwrap(),
        mixture: &config.mixture(&system.states()).unwrap(),
        visited: 0.3,
        seed: 5,
    };
    let samples = |purpose| source.values(purpose, 1000).unwrap();
    agree(|device| {
        let lesson = value::Lesson {
            name: "value",
            order: system.states().map(|axis| axis.name).to_vec(),
            samples: samples(purpose::START),
            held_out: samples(purpose::HELD_OUT),
            device: device.clone(),
            seed: 5,
        };
        let (activation, output) = (Activation::Relu, Activation::Identity);
        let (inputs, hidden) = (intervals(&system), vec![32; 2]);
        let shape = Architecture { inputs, hidden, outputs: 1, activation, output };
        let network = Network::random(shape, Stream::new(5, purpose::WEIGHT, 0), 1.0);
        Value::new(lesson, network, settings(&config).value).unwrap()
    });
}

#[test]
fn the_players_of_a_game_are_updated_as_on_the_cpu() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(1));
    let set = ["train.ddpg.batch=64", "train.ddpg.replay=300", "train.held_out=256"];
    let config = config("double-integrator", "analytic", &set);
    agree(|device| {
        let game = Game {
            contest: config.contest(&Model::of(system)).unwrap(),
            states: intervals(&system),
            hidden: vec![32, 32],
        };
        let settings = settings(&config).ddpg.clone();
        Ddpg::new(task(&system, &backend, device, &config), game, settings).unwrap()
    });
}

#[test]
fn a_policy_on_a_reward_is_updated_as_on_the_cpu() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(1));
    let set = [
        "train.ppo.environments=8",
        "train.ppo.steps=25",
        "train.ppo.epochs=1",
        "train.ppo.batch=200",
        "train.held_out=256",
    ];
    let config = config("double-integrator", "analytic", &set);
    agree(|device| {
        let ppo = settings(&config).ppo.clone();
        let goal = config.goal(&system.states()).unwrap();
        let reward =
            Reward { task: reachcast::model::Task::default(), goal, weights: ppo.reward.clone() };
        let lesson = ppo::Lesson { reward, states: intervals(&system), hidden: vec![32, 32] };
        Ppo::new(task(&system, &backend, device, &config), lesson, ppo)
    });
}

/// Where the library gives up an adapter, the program ends with an error; elsewhere a panic is one.
#[test]
fn a_failing_adapter_is_an_error() {
    let Some([host, remote]) = devices() else { return };
    let lost = || -> Result<()> { panic!("the adapter is gone") };
    let failed = remote.contained(lost).unwrap_err();
    assert!(matches!(failed, Error::DeviceFailed { .. }), "{failed}");
    assert!(failed.to_string().contains("the adapter is gone"), "{failed}");
    assert!(std::panic::catch_unwind(|| host.contained(lost)).is_err());
}

/// The command on an adapter: the record names it, a second run goes on where the first ended, and
/// the folder of one device is not taken over by another.
#[test]
fn the_command_trains_on_an_adapter() {
    let Some(gpu) = adapter() else { return };
    let device = Backend::Gpu(gpu).device();
    let folder = Folder::new();
    for (method, config) in [("analytic", "double_integrator"), ("ddpg", "race_ddpg")] {
        let out = folder.path(method);
        let config = format!("configs/train/{config}.toml");
        let set = [
            "train.hidden=[16]",
            "train.analytic.iterations=4",
            "train.ddpg.iterations=4",
            "train.ddpg.environments=4",
            "train.ddpg.batch=16",
            "train.held_out=64",
        ];
        let set = set.iter().flat_map(|set| ["--set", set]);
        let run: Vec<&str> = ["train", &config, "--out", &out].into_iter().chain(set).collect();
        let on = |backend: &'static str| [&run[..], &["--backend", backend]].concat();
        let record = document(&on("gpu"));
        let provenance = &record["origin"]["provenance"];
        assert_eq!(provenance["backend"], "gpu");
        assert_eq!(provenance["device"], device.as_str());
        let page = std::fs::read_to_string(format!("{out}/report.html")).unwrap();
        assert!(page.contains(&device), "{method}");
        assert_eq!(document(&on("gpu")), record);
        refused(&on("cpu"), &["another experiment"]);
    }
}
