//! Training: slopes against central differences in f64, networks against the engine, runs that are
//! interrupted, and policies that get better.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod common;
mod training;

use std::cell::Cell;
use std::path::Path;
use std::sync::Arc;

use burn_tensor::{Tensor, activation};
use common::activations::{activations, exact};
use common::{ClosedForm, cpu};
use reachcast::backend::Backend;
use reachcast::bench;
use reachcast::config::Config;
use reachcast::formula::{Graph, Node, record};
use reachcast::model::{Interface, Model, Plant};
use reachcast::policy::{Activation, Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{StateList, Stream, Tightening, reach_avoid};
use reachcast::scenario::record::Provenance;
use reachcast::scenario::{Unwatched, Watch};
use reachcast::system::{BangBang, DoubleIntegrator, System};
use reachcast::train::analytic::{Analytic, LAST, Task};
use reachcast::train::checkpoint::Checkpoint;
use reachcast::train::chosen::chosen_first;
use reachcast::train::device::{Device, floats};
use reachcast::train::layer::layer;
use reachcast::train::network::{Architecture, Network};
use reachcast::train::physics::apply;
use reachcast::train::purpose;
use reachcast::train::record::{Origin, TrainRecord};
use reachcast::train::run::{Learner, Run};
use reachcast::train::samples::Source;
use reachcast::train::settings::{AnalyticSettings, Method, TrainSettings};
use reachcast::train::tape::Tape;
use reachcast::train::value::{Lesson, Value};
use reachcast::{Error, Result};
use training::{config, losses, random, settings, task};

/// Names of the states.
fn order<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> Vec<String> {
    system.states().map(|axis| axis.name).to_vec()
}

/// A learner for `system`.
fn learner<
    'a,
    S: System<NX, NU> + Clone + Send + Sync + 'static,
    const NX: usize,
    const NU: usize,
>(
    system: &S,
    backend: &'a Backend,
    config: &Config,
    network: Network,
    losses: Option<Tightening>,
) -> Analytic<'a> {
    let task = Task { tightening: losses, ..task(system, backend, &Device::cpu(), config) };
    Analytic::new(task, network, settings(config).analytic)
}

/// `-tau ln(sum of exp(-x / tau))` in f64, from its definition.
fn soft_min(terms: &[f64], tau: f64) -> f64 {
    let least = terms.iter().copied().fold(f64::INFINITY, f64::min);
    let sum: f64 = terms.iter().map(|term| (-(term - least) / tau).exp()).sum();
    least - tau * sum.ln()
}

fn soft_max(terms: &[f64], tau: f64) -> f64 {
    -soft_min(&terms.iter().map(|term| -term).collect::<Vec<_>>(), tau)
}

/// What the margins of the race are minima of, worked out by hand.
fn race_terms(x: &[f64; 12]) -> [Vec<f64>; 2] {
    let gate = f64::from(DroneRace::GATE);
    let ahead = [x[2] - x[8], x[3] - x[9]];
    let within = [x[0] + gate, gate - x[0], x[4] + gate, gate - x[4]];
    let radius = f64::from(DroneRace::CONE) * (1.0 + (x[10] - x[4]).max(0.0));
    let cone = (x[0] - x[6]).hypot(x[2] - x[8]) - radius;
    let room = f64::from(0.05_f32) - x[2];
    let safe = [cone, room + x[0], room - x[0], room + x[4], room - x[4]];
    let ten = |terms: &[f64]| terms.iter().map(|term| 10.0 * term).collect();
    [ten(&[ahead, [within[0], within[1]], [within[2], within[3]]].concat()), ten(&safe)]
}

/// Softened measure of a rollout of the race from its definition, all in f64.
fn race_measure(states: &[[f64; 12]], gamma: f64, losses: &Tightening, tau: f64) -> f64 {
    let (mut safe, mut reached) = (Vec::new(), Vec::new());
    for (t, x) in states.iter().enumerate() {
        let discount = gamma.powi(t as i32);
        let [target, constraint] = race_terms(x);
        let less = |terms: Vec<f64>, loss: f32| -> Vec<f64> {
            terms.into_iter().map(|term| discount * (term - f64::from(loss))).collect()
        };
        safe.extend(less(constraint, losses.constraint[t]));
        let target = less(target, losses.target[t]);
        reached.push(soft_min(&[safe.clone(), target].concat(), tau));
    }
    soft_max(&reached, tau)
}

/// A network in f64, straight from parameters in the order of [`Network::parameters`].
fn control(parameters: &[f64], widths: &[usize], x: &[f64]) -> Vec<f64> {
    let axes = DroneRace::default().states();
    let scaled = |(x, axis): (&f64, &reachcast::system::Axis)| {
        let (low, high) = (f64::from(axis.low), f64::from(axis.high));
        (x - 0.5 * (low + high)) * 2.0 / (high - low)
    };
    let mut values: Vec<f64> = x.iter().zip(&axes).map(scaled).collect();
    let mut rest = parameters;
    for (layer, pair) in widths.windows(2).enumerate() {
        let (weights, after) = rest.split_at(pair[0] * pair[1]);
        let (biases, after) = after.split_at(pair[1]);
        rest = after;
        let sum = |j: usize| {
            let products = values.iter().enumerate().map(|(i, x)| x * weights[i * pair[1] + j]);
            biases[j] + products.sum::<f64>()
        };
        let last = layer + 2 == widths.len();
        let act = |x: f64| if last { x.tanh() } else { x.max(0.0) };
        values = (0..pair[1]).map(|j| act(sum(j))).collect();
    }
    values
}

/// The derivatives of the softened measures, plain and tightened, by the parameters of a network,
/// through thirty steps of the race, are central differences of an f64 program of the same from its
/// definition.
#[test]
fn slopes_of_the_softened_measure_are_central_differences_in_f64() {
    let (system, backend, config) =
        (DroneRace::default(), cpu(1), config("drone-race", "analytic", &[]));
    let (hidden, tau) = ([7, 5], 0.37_f32);
    let network = random(&system, &hidden, 1.0);
    let spec = config.spec().unwrap();
    let lost = losses(&spec);
    let learner = learner(&system, &backend, &config, network.clone(), Some(lost.clone()));
    let starts = config.mixture(&system.states()).unwrap().draw(9, purpose::START, 3, 6);
    let bound = network.bind(&Device::cpu());
    let measures = learner.measures(&bound, starts.view(), tau);
    let found = bound.gradient(&measures.clone().sum().backward());
    let values = floats(measures);

    let widths = [12, hidden[0], hidden[1], 3];
    let exact = |parameters: &[f64], start: &[f32], lost: &Tightening| {
        let mut x: [f64; 12] = std::array::from_fn(|i| f64::from(start[i]));
        let mut states = vec![x];
        for _ in 0..spec.horizon {
            let u = control(parameters, &widths, &x);
            x = system.step(x, [u[0], u[1], u[2]]);
            states.push(x);
        }
        race_measure(&states, f64::from(spec.gamma), lost, f64::from(tau))
    };
    let none = Tightening::none(&spec);
    let parameters: Vec<f64> = network.parameters.iter().map(|p| f64::from(*p)).collect();
    for (start, pair) in starts.iter().zip(values.chunks(2)) {
        for (lost, value) in [&none, &lost].into_iter().zip(pair) {
            let exact = exact(&parameters, start, lost);
            let error = (f64::from(*value) - exact).abs();
            assert!(error < 1e-4 * (1.0 + exact.abs()), "{value} {exact}");
        }
    }
    let sum = |parameters: &[f64]| -> f64 {
        let both =
            |start: &[f32]| exact(parameters, start, &none) + exact(parameters, start, &lost);
        starts.iter().map(both).sum()
    };
    let length = found.iter().map(|slope| f64::from(*slope).powi(2)).sum::<f64>().sqrt();
    let mut worst = 0.0_f64;
    for i in 0..parameters.len() {
        let moved = |step: f64| {
            let mut parameters = parameters.clone();
            parameters[i] += step;
            sum(&parameters)
        };
        let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
        worst = worst.max((f64::from(found[i]) - expected).abs() / length);
    }
    println!("largest error of a slope: {worst:.1e} of the gradient's length {length:.3}");
    assert!(length > 1.0 && worst < 2e-5, "{worst} of {length}");
}

/// What the engine measures with the exported network, and burn's forward pass at a temperature
/// where soft and hard choices agree.
#[test]
fn an_exported_network_measures_as_on_tensors() {
    let (system, backend, config) =
        (DroneRace::default(), cpu(1), config("drone-race", "analytic", &[]));
    let network = random(&system, &[64, 64], 1.0);
    let learner = learner(&system, &backend, &config, network.clone(), None);
    let starts = config.mixture(&system.states()).unwrap().draw(9, purpose::HELD_OUT, 0, 500);
    let told = floats(learner.measures(&network.bind(&Device::cpu()), starts.view(), 1e-7));
    let policy = network.export(order(&system)).unwrap();
    let plant = Plant::of(system, policy);
    let measured = measures(&backend, &plant, &starts, &config);
    let apart = told.iter().zip(&measured).map(|(told, measured)| (told - measured).abs());
    let worst = apart.fold(0.0, f32::max);
    println!("largest difference {worst:.1e}");
    assert!(worst < 1e-5, "{worst}");
    assert!(measured.iter().any(|m| *m > 0.0) && measured.iter().any(|m| *m < 0.0));
}

/// The engine's measures.
fn measures(backend: &Backend, plant: &Plant, starts: &StateList, config: &Config) -> Vec<f32> {
    let program = backend.prepare(plant).unwrap();
    program.measures(starts, &config.spec().unwrap()).unwrap()
}

/// Stops the work after so many updates.
struct Patience(Cell<u64>);

impl Watch for Patience {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, count: u64) -> Result<()> {
        let left = self.0.get().checked_sub(count).ok_or(Error::Interrupted)?;
        self.0.set(left);
        Ok(())
    }
}

/// A short training of the double integrator's policy in `folder`.
fn short(
    folder: &Path,
    threads: usize,
    watch: &dyn Watch,
    set: &[&str],
) -> Result<(TrainRecord, Mlp)> {
    let few = ["train.analytic.iterations=60", "train.interval=20", "train.held_out=512"];
    let config = config("double-integrator", "analytic", &[&few[..], set].concat());
    let (system, backend) = (DoubleIntegrator::default(), cpu(threads));
    let network = random(&system, &settings(&config).hidden, LAST);
    let provenance = Provenance {
        version: String::new(),
        seed: config.seed,
        generator: String::new(),
        config: config.to_train_json().unwrap(),
        policy: String::new(),
        policy_sha256: String::new(),
        physics_sha256: String::new(),
        backend: backend.name().to_owned(),
        device: backend.device(),
        networks: None,
    };
    let mut learner = learner(&system, &backend, &config, network, None);
    let TrainSettings { interval, patience, analytic, .. } = settings(&config);
    let run = Run {
        folder,
        origin: Origin { method: Method::Analytic, provenance },
        total: analytic.iterations,
        interval: *interval,
        patience: *patience,
    };
    let trained = run.train(&mut learner, watch)?;
    let (name, bytes) = &trained.files[0];
    assert_eq!(name, "policy.safetensors");
    Ok((trained.record, Mlp::from_bytes(bytes).unwrap()))
}

/// Interrupted anywhere and resumed, on any number of threads: the same record and network.
#[test]
fn a_run_that_was_interrupted_comes_to_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let whole = short(&folder.path().join("whole"), 1, &Unwatched, &[]).unwrap();
    let parts = folder.path().join("parts");
    for (updates, threads) in [(7, 1), (25, 2), (41, 1)] {
        let interrupted = short(&parts, threads, &Patience(Cell::new(updates)), &[]);
        assert!(matches!(interrupted, Err(Error::Interrupted)), "{interrupted:?}");
        // Nothing that was done is lost.
        let stored = Checkpoint::read(&parts).unwrap().unwrap();
        assert_eq!(stored.progress.iteration, updates + 1);
    }
    assert_eq!(short(&parts, 2, &Unwatched, &[]).unwrap(), whole);
    // A run that has ended is not run again.
    assert_eq!(short(&parts, 2, &Patience(Cell::new(60)), &[]).unwrap(), whole);
    let other = short(&folder.path().join("other"), 1, &Unwatched, &["seed=6"]).unwrap();
    assert_ne!(other.0.networks[0].sha256, whole.0.networks[0].sha256);
    let refused = short(&parts, 1, &Unwatched, &["train.analytic.batch=255"]).unwrap_err();
    assert!(refused.to_string().contains("another experiment"), "{refused}");
    let file = parts.join("checkpoint.safetensors");
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let damaged = short(&parts, 1, &Unwatched, &[]).unwrap_err().to_string();
    assert!(damaged.contains("damaged") && damaged.contains("remove it"), "{damaged}");
}

/// The share of the box from which full acceleration reaches is the largest there is; training
/// comes near it, keeps its best network, and ends once it gets no better.
#[test]
fn training_improves_and_ends_early() {
    let folder = tempfile::tempdir().unwrap();
    let longer = ["train.analytic.iterations=2000", "train.patience=3"];
    let (record, policy) = short(folder.path(), 2, &Unwatched, &longer).unwrap();
    let scores: Vec<f64> = record.curve.iter().map(|point| point.scores[0]).collect();
    let best = scores.iter().copied().fold(0.0, f64::max);
    let config = config("double-integrator", "analytic", &[]);
    let system = DoubleIntegrator::default();
    let held_out = config.mixture(&system.states()).unwrap().draw(5, purpose::HELD_OUT, 0, 512);
    let share = |measures: Vec<f32>| {
        measures.iter().filter(|m| **m > 0.0).count() as f64 / measures.len() as f64
    };
    let backend = cpu(1);
    let bang = BangBang { acceleration: 1.0 };
    let ceiling = share(measures(&backend, &Plant::of(system, bang), &held_out, &config));
    let kept = share(measures(&backend, &Plant::of(system, policy), &held_out, &config));
    println!("from {:.3} to {best:.3} of {ceiling:.3} in {} scores", scores[0], scores.len());
    assert_eq!(kept, best);
    assert!(best > scores[0] + 0.1 && best > 0.9 * ceiling && best <= ceiling);
    assert!(record.stopped_early);
    // Means over the updates between two scores, of gains that are hardly above 1.
    assert!(record.curve.iter().flat_map(|point| point.loss).all(|loss| loss.abs() < 1.2));
    let at = record.curve.iter().position(|point| point.iteration == record.best).unwrap();
    assert_eq!((scores[at], record.curve.len()), (best, at + 4));
}

/// The carried networks of the double integrator against its reach-avoid set in closed form: how
/// much of it the policy covers, and how often V(x) has the sign of the truth.
#[test]
fn carried_networks_know_the_set_in_closed_form() {
    let (system, config) =
        (DoubleIntegrator::default(), config("double-integrator", "analytic", &[]));
    let form = ClosedForm::of(&system);
    let loss = vec![0.0; config.spec().unwrap().horizon as usize + 1];
    let carried = |name: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/policies");
        Mlp::load(&folder.join(format!("double_integrator_{name}.safetensors"))).unwrap()
    };
    let (policy, value) = (carried("policy"), carried("value"));
    let starts = config.mixture(&system.states()).unwrap().draw(11, purpose::HELD_OUT, 0, 20_000);
    let plant = Plant::of(system, policy);
    let measured = measures(&cpu(2), &plant, &starts, &config);
    let (mut set, mut covered, mut right) = (0, 0, 0);
    for (start, measure) in starts.iter().zip(measured) {
        let inside = form.contains([start[0], start[1]].map(f64::from), &loss);
        set += u32::from(inside);
        covered += u32::from(inside && measure > 0.0);
        right += u32::from((value.forward(start)[0] > 0.0) == inside);
        assert!(inside || measure <= 0.0, "{start:?} reaches from outside of the set");
    }
    let [covered, right] =
        [(covered, set), (right, 20_000)].map(|(n, of)| f64::from(n) / f64::from(of));
    println!("covers {covered:.4} of the set; V has the right sign at {right:.4} of the states");
    assert!(covered >= 0.97 && right >= 0.99, "{covered} {right}");
}

/// Samples of Q against whole f64 rollouts whose first control is the sample's, samples of V
/// against plain ones; and states that were met on the way among them.
#[test]
fn samples_are_measures_in_f64() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(2));
    // Few steps, so that the last one matters.
    let config = config("double-integrator", "analytic", &["rollout.horizon=6"]);
    let policy = BangBang { acceleration: 1.0 };
    let plant = Plant::of(system, policy);
    let source = Source {
        program: &backend.prepare(&plant).unwrap(),
        spec: config.spec().unwrap(),
        mixture: &config.mixture(&system.states()).unwrap(),
        visited: 0.5,
        seed: 5,
    };
    let measure = |start: &[f32], first: Option<f32>| {
        let mut x = [f64::from(start[0]), f64::from(start[1])];
        let mut u = first.map(f64::from);
        let mut margins = vec![(system.target(x), system.constraint(x))];
        for _ in 0..source.spec.horizon {
            let [planned] = policy.control(x);
            x = system.step(x, [u.take().unwrap_or(planned)]);
            margins.push((system.target(x), system.constraint(x)));
        }
        reach_avoid(margins, f64::from(source.spec.gamma))
    };
    let values = source.values(purpose::START, 300).unwrap();
    let chosen = backend.prepare(&chosen_first(&plant)).unwrap();
    let actions = source.action_values(&chosen, purpose::START, 300).unwrap();
    assert_eq!((values.len(), values.columns, actions.len(), actions.columns), (300, 2, 300, 3));
    let mut outside = 0;
    for i in 0..300 {
        let (state, row) = (values.row(i), actions.row(i));
        assert_eq!(state, &row[..2]);
        // Full acceleration toward the origin switches at it: f32 and f64 may part there.
        if state[0].abs() > 1e-4 {
            assert!((f64::from(values.measures[i]) - measure(state, None)).abs() < 1e-4, "{i}");
            let exact = measure(&row[..2], Some(row[2]));
            assert!((f64::from(actions.measures[i]) - exact).abs() < 1e-4, "{i} {row:?} {exact}");
        }
        outside += u32::from(state[0].abs() > 1.2 || state[1].abs() > 1.5);
    }
    assert!((5..150).contains(&outside), "{outside} states that no box holds");
}

/// A value network tells most signs after a few seconds.
#[test]
fn a_value_network_learns_the_measure() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(2));
    let config = config("double-integrator", "analytic", &["train.value.iterations=400"]);
    let plant = Plant::of(system, BangBang { acceleration: 1.0 });
    let source = Source {
        program: &backend.prepare(&plant).unwrap(),
        spec: config.spec().unwrap(),
        mixture: &config.mixture(&system.states()).unwrap(),
        visited: 0.3,
        seed: 5,
    };
    let lesson = Lesson {
        name: "value",
        order: order(&system),
        samples: source.values(purpose::START, 20_000).unwrap(),
        held_out: source.values(purpose::HELD_OUT, 2000).unwrap(),
        device: Device::cpu(),
        seed: 5,
    };
    let inputs = system.states().iter().map(|axis| [axis.low, axis.high]).collect();
    let (activation, output) = (Activation::Relu, Activation::Identity);
    let shape = Architecture { inputs, hidden: vec![32; 2], outputs: 1, activation, output };
    let network = Network::random(shape, Stream::new(5, purpose::WEIGHT, 0), 1.0);
    let mut settings = settings(&config).value;
    settings.batch = 256;
    let mut learner = Value::new(lesson, network, settings).unwrap();
    let before = learner.scores().unwrap();
    let losses: Vec<f64> = (0..400).map(|i| learner.update(i).unwrap()).collect();
    let after = learner.scores().unwrap();
    println!("{before:?} {after:?}, loss {:.4} to {:.4}", losses[0], losses[399]);
    assert!(before[1] < 0.5 && after[0] > 0.93 && after[1] > 0.97, "{before:?} {after:?}");
    assert!(losses[399] < 0.1 * losses[0]);
}

/// Numbers out of range are refused by key.
#[test]
fn wrong_settings_name_their_key() {
    for (set, words) in [
        ("train.analytic.batch=0", "train.analytic.batch: 0 is not within"),
        ("train.analytic.temperature=[1, 0]", "train.analytic.temperature: 0 is not a positive"),
        ("train.analytic.optimiser.rate=-1", "train.analytic.optimiser.rate: -1"),
        ("train.analytic.optimiser.decays=[1, 0.9]", "train.analytic.optimiser.decays"),
        ("train.value.visited=1.5", "train.value.visited: 1.5 is not within 0 to 1"),
        ("train.hidden=[64, 0]", "train.hidden: 0 is not within"),
        ("train.starts=[]", "train.starts: empty"),
        ("train.starts=[{ share = 0 }]", "train.starts.share: 0"),
        ("train.interval=0", "train.interval"),
        (
            "train.starts=[{ share = 1, box = { positon = [0, 1] } }]",
            "train.starts[0].box: no state `positon`; the nearest is `position`",
        ),
        (
            "train.starts=[{ share = 1, box = { position = [1, 0] } }]",
            "train.starts[0].box.position: empty interval",
        ),
    ] {
        let config = config("double-integrator", "analytic", &[set]);
        let states = DoubleIntegrator::default().states();
        let refused = config.mixture(&states).map(|_| ()).unwrap_err();
        assert_eq!(refused.exit_code(), 2);
        let text = refused.to_string();
        // Where the whole key was set, the option that set it stands for it.
        assert!(words.split(": ").all(|part| text.contains(part)), "{set}: {text}");
    }
}

/// Gains are weighted as the settings say: with no weight on the certified measure, the loss is that
/// of G alone.
#[test]
fn the_loss_is_the_mean_gain() {
    let (system, backend) = (DoubleIntegrator::default(), cpu(1));
    let config = config("double-integrator", "analytic", &["train.analytic.certified=0.25"]);
    let network = random(&system, &[8], 1.0);
    let spec = config.spec().unwrap();
    let mut learner = learner(&system, &backend, &config, network.clone(), Some(losses(&spec)));
    let batch = settings(&config).analytic.batch;
    let starts = config.mixture(&system.states()).unwrap().draw(5, purpose::START, 0, batch);
    let next = config.mixture(&system.states()).unwrap().draw(5, purpose::START, 1, batch);
    assert!(starts.iter().all(|start| next.iter().all(|other| other != start)), "fresh starts");
    let AnalyticSettings { scale, slope, temperature, .. } = settings(&config).analytic;
    let bound = network.bind(&Device::cpu());
    let measures = floats(learner.measures(&bound, starts.view(), temperature[0] as f32));
    let gain = |g: f32| (f64::from(g) / scale).tanh() + slope * f64::from(g) / scale;
    let gains = measures.chunks(2).map(|pair| gain(pair[0]) + 0.25 * gain(pair[1]));
    let expected = -gains.sum::<f64>() / batch as f64;
    let loss = learner.update(0).unwrap();
    assert!((loss - expected).abs() < 1e-5, "{loss} {expected}");
}

/// A graph on tensors, one operation of burn per node of its expansion: what one operation per graph
/// stands for.
fn node_by_node(graph: &Graph, inputs: &Tensor<2>) -> Tensor<2> {
    let graph = graph.expanded();
    let chosen =
        |a: Tensor<2>, b: Tensor<2>, [yes, no]: [Tensor<2>; 2]| no.mask_where(a.lower(b), yes);
    let rows = inputs.dims()[0];
    let mut values: Vec<Tensor<2>> = Vec::new();
    for node in &graph.nodes {
        let at = |i: u32| values[i as usize].clone();
        let value = match *node {
            Node::Input(i) => inputs.clone().narrow(1, i as usize, 1),
            Node::Literal(bits) => Tensor::full([rows, 1], f32::from_bits(bits), &inputs.device()),
            Node::Add(a, b) => at(a) + at(b),
            Node::Sub(a, b) => at(a) - at(b),
            Node::Mul(a, b) => at(a) * at(b),
            Node::Div(a, b) => at(a) / at(b),
            Node::Neg(a) => -at(a),
            Node::Abs(a) => at(a).abs(),
            Node::Sqrt(a) => at(a).sqrt(),
            Node::Floor(a) => at(a).floor(),
            Node::Min(a, b) => chosen(at(a), at(b), [at(a), at(b)]),
            Node::Max(a, b) => chosen(at(b), at(a), [at(a), at(b)]),
            Node::Clamp(a, low, high) => {
                let floored = chosen(at(a), at(low), [at(low), at(a)]);
                chosen(at(high), floored.clone(), [at(high), floored])
            }
            Node::IfLt(a, b, yes, no) | Node::SelectLt(a, b, yes, no) => {
                chosen(at(a), at(b), [at(yes), at(no)])
            }
            other => panic!("no operation of burn for {other:?}"),
        };
        values.push(value);
    }
    Tensor::cat(graph.outputs.iter().map(|&i| values[i as usize].clone()).collect(), 1)
}

/// A whole graph as one operation has the values and slopes of its nodes one by one: equal values,
/// and slopes that differ by the order of their sums.
#[test]
fn one_operation_per_graph_is_one_per_node() {
    let system = DroneRace::default();
    let graph = record(15, |inputs| {
        let x = std::array::from_fn(|i| inputs[i]);
        let next = system.step(x, std::array::from_fn(|i| inputs[12 + i]));
        let margins = [system.target(next), system.constraint(next)];
        next.into_iter().chain(margins).collect()
    });
    let config = config("drone-race", "analytic", &[]);
    let states = config.mixture(&system.states()).unwrap().draw(9, purpose::START, 0, 37);
    let controls = Stream::new(9, purpose::CONTROL, 0);
    let row = |i: usize| -> Vec<f32> {
        let u = controls.in_box::<1>(&[-1.2; 3], &[1.2; 3], i as u64);
        states.row(i).iter().copied().chain(u.into_iter().map(|lane| lane.0[0])).collect()
    };
    let rows: Vec<f32> = (0..37).flat_map(row).collect();
    let tape = Arc::new(Tape::hard(&graph));
    let device = Device::cpu();
    let weights = device.tensor((0..14).map(|i| 1.0 + 0.1 * i as f32).collect(), [1, 14]);
    let run = |of: &dyn Fn(Tensor<2>) -> Tensor<2>| {
        let inputs = device.tensor(rows.clone(), [37, 15]).require_grad();
        let outputs = of(inputs.clone());
        let grads = (outputs.clone() * weights.clone()).sum().backward();
        (floats(outputs), floats(inputs.grad(&grads).unwrap()))
    };
    let (values, slopes) = run(&|inputs| apply(&tape, 1.0, [inputs]));
    let (expected, steeps) = run(&|inputs| node_by_node(&graph, &inputs));
    assert_eq!(values, expected);
    for (slope, expected) in slopes.iter().zip(&steeps) {
        assert!((slope - expected).abs() <= 1e-5 * (1.0 + expected.abs()), "{slope} {expected}");
    }
}

/// A layer as one operation has the values and slopes of burn's own operations.
#[test]
fn a_layer_is_burns_own_operations() {
    let drawn = |number: u32, [rows, columns]: [usize; 2]| {
        let count = rows * columns;
        let lanes = Stream::new(9, bench::PURPOSE, number).in_box::<1>(
            &vec![-2.0; count],
            &vec![2.0; count],
            0,
        );
        let values: Vec<f32> = lanes.iter().map(|lane| lane.0[0]).collect();
        Device::cpu().tensor(values, [rows, columns])
    };
    for curve in [Activation::Relu, Activation::Tanh, Activation::Silu, Activation::Identity] {
        let run = |fused: bool| {
            let shapes = [[5, 4], [4, 3], [1, 3]];
            let [x, w, b] = std::array::from_fn(|i| drawn(i as u32, shapes[i]).require_grad());
            let outputs = match (fused, curve) {
                (true, _) => layer(x.clone(), w.clone(), b.clone(), curve),
                (false, curve) => {
                    let sums = x.clone().matmul(w.clone()) + b.clone();
                    match curve {
                        Activation::Relu => activation::relu(sums),
                        Activation::Silu => activation::silu(sums),
                        Activation::Identity => sums,
                        _ => sums.tanh(),
                    }
                }
            };
            let grads = (outputs.clone() * drawn(7, [5, 3])).sum().backward();
            let slopes = [x, w, b].map(|t| t.grad(&grads).unwrap());
            [vec![outputs], slopes.to_vec()]
                .concat()
                .into_iter()
                .flat_map(floats)
                .collect::<Vec<f32>>()
        };
        for (found, expected) in run(true).into_iter().zip(run(false)) {
            let error = (found - expected).abs();
            assert!(error <= 3e-6 * (1.0 + expected.abs()), "{curve:?}: {found} {expected}");
        }
    }
}

/// Values and slopes of a layer with each activation, against definitions in f64 and their central differences.
#[test]
fn layers_of_every_activation_have_their_slopes() {
    let sums: Vec<f32> = (-40..40).map(|i| 0.173 * i as f32 + 0.0117).collect();
    for activation in activations() {
        let one = |value: f32| Device::cpu().tensor(vec![value], [1, 1]);
        let x = Device::cpu().tensor(sums.clone(), [sums.len(), 1]).require_grad();
        let outputs = layer(x.clone(), one(1.0), one(0.0), activation);
        let grads = outputs.clone().sum().backward();
        let (values, slopes) = (floats(outputs), floats(x.grad(&grads).unwrap()));
        for ((x, value), slope) in sums.iter().zip(values).zip(slopes) {
            let at = |step: f64| exact(activation, f64::from(*x) + step);
            let expected = (at(1e-6) - at(-1e-6)) / 2e-6;
            let error = (f64::from(value) - at(0.0)).abs();
            assert!(error < 3e-6, "{activation} at {x}: {value}");
            let error = (f64::from(slope) - expected).abs();
            assert!(error < 5e-6, "{activation} at {x}: {slope}, {expected}");
        }
    }
}

/// A control beyond its bounds moves nothing.
#[test]
fn the_clip_of_a_control_stops_its_slope() {
    let tape = {
        let model = Model::of(DoubleIntegrator::default());
        reachcast::train::soft::step_tape(&model, &Interface::plain(&model))
    };
    for (u, slope) in [(0.5_f64, f64::from(0.1_f32)), (1.5, 0.0), (-1.5, 0.0)] {
        let (mut values, mut adjoints, mut slopes) = (Vec::new(), Vec::new(), [f64::lit(0.0); 4]);
        tape.forward(&[0.3, -0.2, u, 0.0], 1.0, &mut values);
        tape.backward(&values, &[0.0, 1.0], 1.0, &mut adjoints, &mut slopes);
        assert!((slopes[2] - slope).abs() < 1e-12, "{u}: {slopes:?}");
    }
}
