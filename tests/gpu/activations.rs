//! Networks with every activation, with norms and with maps at their ends: the bits of the host, f64, and NaN.

use std::sync::Arc;

use reachcast::backend::Backend;
use reachcast::backend::gpu::NetworkKernels;
use reachcast::formula::{Expr, Scalar, record};
use reachcast::model::{Controller, Law, Model, Plant};
use reachcast::policy::{Activation, Layer, Mlp, Norm, Policy, Rescale};
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{NON_FINITE, Query, ReachAvoidTask, RolloutSpec, Tightening};
use reachcast::system::{Axis, System};

use crate::common::activations::activations;
use crate::common::cpu;
use crate::measures::{assert_close_to_f64, rounds_products};
use crate::{drawn, each_way, gpu, measures, random_network, whole_box};

/// The control of a state, a step later, is what counts.
#[derive(Clone)]
struct Shown;

impl System<2, 1> for Shown {
    fn name(&self) -> &str {
        "shown"
    }
    fn states(&self) -> [Axis; 2] {
        ["x", "shown"].map(|name| Axis::new(name, "", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x, _]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        [x, u]
    }
    fn target<R: Real>(&self, [_, shown]: [R; 2]) -> R {
        shown
    }
    fn constraint<R: Real>(&self, _: [R; 2]) -> R {
        R::lit(3.0e38)
    }
}

/// Numbers of all sizes that a rollout can show.
fn numbers() -> Vec<[f32; 2]> {
    let near = (-300..=300).map(|i| i as f32 * 0.037);
    let far = [20.0, 40.5, 87.0, 88.8, 105.0, 1e4, 1e30, 1e-30, 0.0, -0.0, 1e-38];
    near.chain(far.into_iter().flat_map(|x| [x, -x])).map(|x| [x, -1e37]).collect()
}

/// `activation` of the first state, by a hidden layer or by the last one.
fn alone(activation: Activation, hidden: bool) -> Mlp {
    let first = Layer::dense(vec![1.0, 0.0], vec![0.0]);
    let second = Layer::dense(vec![1.0], vec![0.0]);
    let [one, other] = if hidden {
        [activation, Activation::Identity]
    } else {
        [Activation::Identity, activation]
    };
    Mlp::from_layers(vec![first.activated(one), second.activated(other)]).expect("a network")
}

fn shown(backend: &Backend, mlp: Mlp, starts: &[[f32; 2]]) -> Vec<f32> {
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let program = backend.prepare(&Plant::of(Shown, mlp)).expect("it fits");
    program.measures(starts, &spec).expect("it runs")
}

#[test]
fn activations_have_the_bits_of_the_host_where_nothing_is_contracted() {
    each_way(|gpu| {
        let (gpu, exact) = rounds_products(gpu);
        let (device, host) = (Backend::Gpu(gpu), cpu(1));
        let mut apart = Vec::new();
        for (activation, hidden) in
            activations().into_iter().flat_map(|one| [(one, true), (one, false)])
        {
            let [found, expected] =
                [&device, &host].map(|on| shown(on, alone(activation, hidden), &numbers()));
            for ((x, found), expected) in numbers().into_iter().zip(found).zip(expected) {
                // What is subnormal is a device's own affair.
                let tiny = expected.abs() < f32::MIN_POSITIVE && found.abs() < f32::MIN_POSITIVE;
                let close = (found - expected).abs() <= 1e-6 * (1.0 + expected.abs());
                let same = if exact { found.to_bits() == expected.to_bits() } else { close };
                if !(same || tiny) {
                    apart.push(format!("{activation} at {}: {found}, host {expected}", x[0]));
                }
            }
        }
        assert!(apart.is_empty(), "{}: {apart:#?}", apart.len());
    });
}

/// A network from random layers: of different activations, with a norm behind some.
fn layered(widths: &[usize], hidden: &[Activation], normed: bool) -> Mlp {
    let mut layers = random_network(widths, Activation::Relu).layers().to_vec();
    for (i, layer) in layers.iter_mut().enumerate() {
        layer.activation = hidden.get(i).copied().unwrap_or(Activation::Tanh);
        let row = |from: f32| (0..layer.outputs).map(|k| from + 0.07 * (k % 5) as f32).collect();
        let norm = Norm { scale: row(0.8), shift: row(-0.1), epsilon: 1e-5 };
        layer.norm = (normed && i % 2 == 0).then_some(norm);
    }
    Mlp::from_layers(layers).expect("a network")
}

/// Maps at both ends of a network of the race.
fn mapped(mlp: Mlp) -> Mlp {
    let input = Rescale {
        low: vec![-1.5; 12],
        ..Rescale::affine(vec![0.7; 12], (0..12).map(|i| 0.1 * i as f32 - 0.5).collect())
    };
    let output = Rescale {
        high: vec![0.4, f32::INFINITY, 0.9],
        ..Rescale::affine(vec![1.3; 3], vec![0.1; 3])
    };
    mlp.with_input(input).and_then(|mlp| mlp.with_output(output)).expect("maps")
}

/// Networks of the race, and whether rollouts can run them themselves.
fn networks() -> Vec<(&'static str, Mlp)> {
    let mixed = [Activation::Elu { alpha: 0.5 }, Activation::Gelu, Activation::Softsign];
    let wide = random_network(&[12, 20, 3], Activation::Relu);
    vec![
        ("mixed", layered(&[12, 17, 24, 9, 3], &mixed, false)),
        ("equal widths", layered(&[12, 64, 64, 3], &mixed, false)),
        ("maps", mapped(wide.clone())),
        (
            "a map around a center",
            wide.clone()
                .with_input(Rescale {
                    center: (0..12).map(|i| 0.25 * i as f32 - 1.5).collect(),
                    high: vec![1.2; 12],
                    ..Rescale::affine(vec![0.9; 12], vec![0.05; 12])
                })
                .expect("a map"),
        ),
        (
            "moved maps",
            wide.with_input(Rescale::affine(vec![0.5; 12], vec![0.0; 12])).expect("a map"),
        ),
        ("mixed and maps", mapped(layered(&[12, 17, 24, 9, 3], &mixed, false))),
        ("norms", layered(&[12, 17, 24, 3], &mixed, true)),
        ("norms and maps", mapped(layered(&[12, 130, 6, 3], &mixed, true))),
        ("a norm behind the last layer", layered(&[12, 3], &[], true)),
    ]
}

/// The plant of a network that drives, and that of one which a formula calls.
fn plants(mlp: &Mlp) -> [Plant; 2] {
    let model = Model::of(DroneRace::default());
    let shared = Arc::new(mlp.clone());
    let called = record(model.inputs(), |x| Expr::call(&shared, &x[..12]));
    let law = Controller::new("called", Law::Formula(called));
    [Plant::of(DroneRace::default(), mlp.clone()), Plant::new(model, law)]
}

#[test]
fn mixed_layers_norms_and_maps_are_those_of_f64() {
    let spec = RolloutSpec::new(5, 1.0).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = |count| ReachAvoidTask {
        starts: drawn(whole_box(&DroneRace::default()), 41),
        range: 0..count,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    for (name, mlp) in networks() {
        for plant in plants(&mlp) {
            println!("{name}, {}", plant.controller.name);
            let host = cpu(1);
            let mut all = Vec::new();
            let program = host.prepare(&plant).expect("it fits");
            let ran = program.reach_avoid(&task(130), &mut |_, values| {
                all.extend_from_slice(values);
                Ok(())
            });
            ran.expect("it runs");
            assert_close_to_f64(&plant, &task(130), &all);
            let Some(gpu) = gpu() else { return };
            let (_, found) = measures(gpu, &plant, &task(130));
            assert_close_to_f64(&plant, &task(130), &found);
            if !mlp.has_norm() {
                let fusing = crate::networks::fusing().expect("an adapter opened before");
                let (_, found) = measures(fusing, &plant, &task(130));
                assert_close_to_f64(&plant, &task(130), &found);
            }
        }
    }
}

/// What rollouts cannot run themselves goes in layers where that is left open, and is refused where it is not.
#[test]
fn norms_go_in_layers() {
    let Some(fusing) = crate::networks::fusing() else { return };
    let plant = Plant::of(DroneRace::default(), layered(&[12, 17, 24, 3], &[], true));
    let refused = Backend::Gpu(fusing).prepare(&plant).err().expect("refused").to_string();
    assert!(refused.contains("norm") && refused.contains("in layers"), "{refused}");
}

/// A network whose second layer takes infinity from infinity for a first state of 4.
fn overflowing(hidden: Activation, last: Layer) -> Mlp {
    let first = Layer::dense(vec![1e38, 0.0, 1e38, 0.0], vec![0.0; 2]);
    let second = Layer::dense(vec![1.0, -1.0], vec![0.0]).activated(hidden);
    Mlp::from_layers(vec![first, second, last]).expect("a network")
}

/// Networks that come to a NaN for a first state of 4 and to a number for 0, by where that happens.
fn failing() -> Vec<(String, Mlp)> {
    let last = |activation| Layer::dense(vec![1.0], vec![0.0]).activated(activation);
    let mut cases: Vec<(String, Mlp)> = Vec::new();
    for activation in activations() {
        cases.push((
            format!("hidden {activation}"),
            overflowing(activation, last(Activation::Identity)),
        ));
        cases.push((
            format!("output {activation}"),
            overflowing(Activation::Relu, last(activation)),
        ));
    }
    let network = |layers| Mlp::from_layers(layers).expect("a network");
    let norm =
        |count: usize| Norm { scale: vec![1.0; count], shift: vec![0.0; count], epsilon: 1e-5 };
    let normed = |layer: Layer| Layer { norm: Some(norm(layer.outputs)), ..layer };
    let sum = || Layer::dense(vec![1.0, 1.0], vec![0.0]);
    let pair = normed(Layer::dense(vec![1.0, 0.0], vec![0.0; 2]));
    let nan = overflowing(Activation::Identity, pair);
    cases.push(("norm".to_owned(), network([nan.layers(), &[sum()]].concat())));
    // The squares of these leave f32, and nothing of the network itself does.
    let large = normed(Layer::dense(vec![1e25, 0.0, -1e25, 0.0], vec![0.0; 2]));
    cases.push(("norm of large numbers".to_owned(), network(vec![large, sum()])));
    let clip = |low, high| Rescale {
        low: vec![low],
        high: vec![high],
        ..Rescale::affine(vec![1.0], vec![0.0])
    };
    for (low, high) in LIMITS {
        let nan = overflowing(Activation::Identity, last(Activation::Identity));
        cases
            .push((format!("clip {low} {high}"), nan.with_output(clip(low, high)).expect("a map")));
    }
    let nan = overflowing(Activation::Identity, last(Activation::Identity));
    let map = Rescale { center: vec![0.5], ..Rescale::affine(vec![2.0], vec![0.25]) };
    cases.push(("output map".to_owned(), nan.with_output(map).expect("a map")));
    cases
}

/// Limits of maps, one of them open or none.
const LIMITS: [(f32, f32); 3] = [(-1.0, 1.0), (-1.0, f32::INFINITY), (f32::NEG_INFINITY, 1.0)];

/// What `mlp` makes of the two states.
fn outcome(backend: &Backend, mlp: &Mlp) -> Vec<f32> {
    shown(backend, mlp.clone(), &SEEN)
}

/// A first state that networks of [`failing`] come to a NaN for, and one for which they do not.
const SEEN: [[f32; 2]; 2] = [[4.0, -5.0], [0.0, -5.0]];

/// Plants whose network sees a NaN for the first of [`SEEN`], behind a map of the inputs.
fn blinded() -> Vec<(String, Plant)> {
    let model = Model::of(Shown);
    let observe = record(model.inputs(), |x| vec![(Expr::lit(1.0) - x[0]).sqrt()]);
    let plant = |(low, high)| {
        let input =
            Rescale { low: vec![low], high: vec![high], ..Rescale::affine(vec![1.0], vec![0.5]) };
        let layers = vec![Layer::dense(vec![1.0], vec![0.0])];
        let network = Mlp::from_layers(layers).and_then(|mlp| mlp.with_input(input));
        let (network, observe) = (Arc::new(network.expect("a network")), Some(observe.clone()));
        let law = Law::Network { observe, network, act: None };
        let controller = Controller::new("blinded", law);
        (format!("input {low} {high}"), Plant::new(model.clone(), controller))
    };
    let open = (f32::NEG_INFINITY, f32::INFINITY);
    LIMITS.into_iter().chain([open]).map(plant).collect()
}

#[test]
fn a_nan_that_a_network_is_shown_fails_the_rollout() {
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let backends =
        [Some(cpu(1)), gpu().map(Backend::Gpu), crate::networks::fusing().map(Backend::Gpu)];
    for backend in backends.iter().flatten() {
        for (name, plant) in blinded() {
            let program = backend.prepare(&plant).expect("it fits");
            let found = program.measures(&SEEN, &spec).expect("it runs");
            assert_eq!(found[0], NON_FINITE, "{name} on {}", backend.device());
            assert!(found[1].is_finite() && found[1] > -5.0, "{name}: {found:?}");
        }
    }
}

/// One state at a time, too: in f32, and in f64, which decides what is near 0.
#[test]
fn a_nan_goes_through_every_layer_and_map_of_the_reference() {
    for (name, mlp) in failing() {
        let [narrow] = mlp.control([f32::NAN, 0.0]);
        let [wide] = mlp.control([f64::NAN, 0.0]);
        assert!(narrow.is_nan() && wide.is_nan(), "{name}: {narrow}, {wide}");
    }
}

#[test]
fn a_nan_in_any_neuron_fails_the_rollout() {
    let backends =
        [Some(cpu(1)), gpu().map(Backend::Gpu), crate::networks::fusing().map(Backend::Gpu)];
    for (way, backend) in backends.iter().enumerate() {
        let Some(backend) = backend else { continue };
        for (name, mlp) in failing().iter().filter(|(_, mlp)| way < 2 || !mlp.has_norm()) {
            let found = outcome(backend, mlp);
            assert_eq!(found[0], NON_FINITE, "{name} on {}", backend.device());
            assert!(found[1].is_finite() && found[1] > -5.0, "{name}: {found:?}");
        }
    }
}

/// The text of a kernel in which activations, norms and clips take NaN for 0.
fn dropping(text: &str) -> String {
    let taken = "select(taken, 0.0, size_of(taken) > INFINITE)";
    let mut text = text.to_owned();
    for name in ["activation", "hidden_activation", "output_activation"] {
        let from = format!("fn {name}(x: f32) -> f32 {{");
        text =
            text.replace(&from, &format!("fn {name}(taken: f32) -> f32 {{\n    let x = {taken};"));
    }
    let from = "fn normaliser(variance: f32, epsilon: f32) -> f32 {";
    let finite = "fn normaliser(taken: f32, epsilon: f32) -> f32 {\n    \
                  let variance = select(taken, 1.0, size_of(taken) >= INFINITE);";
    text = text.replace(from, finite).replace("size_of(variance) >= INFINITE", "false");
    let from = "fn act(said: f32) -> f32 {";
    text.replace(from, &format!("fn act(taken: f32) -> f32 {{\n    let said = {taken};"))
}

/// The check above is one that each activation, norm and clip could fail.
#[test]
fn kernels_that_drop_a_nan_are_seen() {
    for networks in [NetworkKernels::Layered, NetworkKernels::Fused] {
        let Some(gpu) = gpu() else { return };
        let backend = Backend::Gpu(gpu.with_networks(networks).with_shader_edit(dropping));
        let fused = networks == NetworkKernels::Fused;
        for (name, mlp) in failing().iter().filter(|(_, mlp)| !fused || !mlp.has_norm()) {
            assert_ne!(outcome(&backend, mlp)[0], NON_FINITE, "{name}");
        }
    }
}
