//! Training of plants that are given as text: slopes against central differences in f64 through what stands
//! around a network, disturbances by name, and the command from a file without a policy to a certificate.
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod command;
mod common;
mod training;

use command::{Folder, document, done, refused};
use common::cpu;
use reachcast::config::{Config, Overrides};
use reachcast::rollout::{RolloutSpec, Stream};
use reachcast::train::analytic::{Analytic, Task};
use reachcast::train::backup::Margins;
use reachcast::train::device::{Device, floats};
use reachcast::train::network::{Architecture, Network};
use reachcast::train::purpose;
use reachcast::train::reward::{Reward, Visited};
use reachcast::{Error, policy};
use std::sync::Arc;
use training::settings;

/// A sledge with drag that must not leave a track.
const SLEDGE: &str = r#"
seed = 5
[model]
name = "sledge"
[model.states]
x = { unit = "m", box = [-1.0, 1.0] }
v = { unit = "m/s", box = [-0.5, 0.5] }
[model.controls]
force = { unit = "N", bounds = [-9.0, 9.0] }
[model.parameters]
drag = { value = 0.3 }
[model.let]
pull = "force - drag * v * abs(v)"
[model.next]
x = "x + 0.1 * v"
v = "v + 0.1 * pull"
[model.task]
kind = "avoid"
constraint = "1.3 - x^2"
[policy]
observe = ["x / 2", "sin(v)"]
act = { force = "1.5 * out[0] + 0.5 * out[1] * x" }
[rollout]
horizon = 12
[train.analytic]
unit = 0.5
"#;

/// A cart without a policy, whose force a push disturbs.
const CART: &str = r#"
[model]
name = "cart"
[model.states]
position = { unit = "m", box = [-1.0, 1.0] }
velocity = { unit = "m/s", box = [-1.0, 1.0] }
[model.controls]
force = { unit = "N", bounds = [-1.0, 3.0] }
[model.disturbances]
push = { unit = "N", bound = 0.3 }
[model.let]
sum = "force + push"
[model.flow]
position = "velocity"
velocity = "sum"
[model.time]
period = 0.1
integrator = "euler"
[model.task]
kind = "reach-avoid"
target = "0.2 - hypot(position, velocity)"
constraint = "1.5 - abs(position)"
"#;

fn config(text: &str, set: &[&str]) -> reachcast::Result<Config> {
    let set = set.iter().map(ToString::to_string).collect();
    let overrides = Overrides { set, ..Overrides::default() };
    Config::from_table(toml::from_str(text).unwrap(), "test", &overrides)
}

/// What is trained on a plant as text.
fn task<'a>(config: &Config, backend: &'a reachcast::backend::Backend, gamma: f32) -> Task<'a> {
    let model = Arc::new(config.plain_model().unwrap());
    Task {
        interface: config.interface(&model).unwrap(),
        backend,
        device: Device::cpu(),
        spec: RolloutSpec::new(config.rollout.horizon, gamma).unwrap(),
        tightening: None,
        mixture: config.mixture(&model.states).unwrap(),
        held_out: 64,
        seed: config.seed,
        model,
    }
}

/// What the network of the sledge says, from its parameters: two inputs, four neurons, two outputs.
fn says(parameters: &[f64], seen: [f64; 2]) -> [f64; 2] {
    let (first, second) = parameters.split_at(12);
    let hidden: Vec<f64> = (0..4)
        .map(|j| (first[8 + j] + seen[0] * first[j] + seen[1] * first[4 + j]).max(0.0))
        .collect();
    [0, 1].map(|k| {
        let sum: f64 = (0..4).map(|j| hidden[j] * second[2 * j + k]).sum();
        (second[8 + k] + sum).tanh()
    })
}

/// The softened measure of a rollout of the sledge and the mean over its steps, by hand.
fn sledge(parameters: &[f64], start: &[f32], tau: f64, gamma: f64) -> [f64; 2] {
    let [mut x, mut v] = [start[0], start[1]].map(f64::from);
    let (mut terms, mut mean) = (Vec::new(), 0.0);
    for t in 0..=12 {
        let margin = f64::from(1.3_f32) - x * x;
        terms.push(gamma.powi(t) * margin);
        mean += (margin / 0.5).tanh() / 13.0;
        let [a, b] = says(parameters, [x / 2.0, v.sin()]);
        let pull = 1.5 * a + 0.5 * b * x - f64::from(0.3_f32) * v * v.abs();
        let step = f64::from(0.1_f32);
        [x, v] = [x + step * v, v + step * pull];
    }
    let least = terms.iter().copied().fold(f64::INFINITY, f64::min);
    let sum: f64 = terms.iter().map(|term| (-(term - least) / tau).exp()).sum();
    [least - tau * sum.ln(), mean]
}

/// Through `let`, `observe`, `act` and the mean over the steps: values and derivatives by the parameters.
#[test]
fn slopes_through_what_stands_around_a_network_are_central_differences_in_f64() {
    let (config, backend) = (config(SLEDGE, &[]).unwrap(), cpu(1));
    let (tau, gamma) = (0.2_f32, 0.97_f32);
    let task = task(&config, &backend, gamma);
    assert_eq!((task.interface.outputs, task.interface.order(&task.model)), (2, None));
    let shape = Architecture {
        inputs: task.interface.intervals(&[[-1.0, 1.0], [-0.5, 0.5]]),
        hidden: vec![4],
        outputs: 2,
        activation: policy::Activation::Relu,
        output: policy::Activation::Tanh,
    };
    let network = Network::random(shape, Stream::new(5, purpose::WEIGHT, 0), 1.0);
    let starts = task.mixture.draw(9, purpose::START, 3, 20);
    let learner = Analytic::new(task, network.clone(), settings(&config).analytic);
    let bound = network.bind(&Device::cpu());
    let measures = learner.measures(&bound, starts.view(), tau);
    assert_eq!(measures.dims(), [20, 2]);
    let found = bound.gradient(&measures.clone().sum().backward());
    let parameters: Vec<f64> = network.parameters.iter().map(|p| f64::from(*p)).collect();
    let exact = |parameters: &[f64], start: &[f32]| {
        sledge(parameters, start, f64::from(tau), f64::from(gamma))
    };
    for (start, told) in starts.iter().zip(floats(measures).chunks(2)) {
        for (told, exact) in told.iter().zip(exact(&parameters, start)) {
            assert!((f64::from(*told) - exact).abs() < 1e-5, "{told}, not {exact}");
        }
    }
    let sum = |parameters: &[f64]| -> f64 {
        starts.iter().flat_map(|start| exact(parameters, start)).sum()
    };
    let length = found.iter().map(|slope| f64::from(*slope).powi(2)).sum::<f64>().sqrt();
    let worst = (0..parameters.len()).map(|i| {
        let moved = |step: f64| {
            let mut parameters = parameters.clone();
            parameters[i] += step;
            sum(&parameters)
        };
        (f64::from(found[i]) - (moved(1e-6) - moved(-1e-6)) / 2e-6).abs() / length
    });
    let worst = worst.fold(0.0, f64::max);
    println!("largest error of a slope: {worst:.1e} of the gradient's length {length:.3}");
    assert!(length > 0.1 && worst < 2e-5, "{worst} of {length}");
}

/// Nothing pushes in a rollout; in training the push is its bound times what the player says.
#[test]
fn a_disturbance_by_name_acts_in_training_alone() {
    let config = config(CART, &[]).unwrap();
    let model = config.plain_model().unwrap();
    let contest = config.contest(&model).unwrap();
    assert_eq!(contest.names, ["push"]);
    let next = |push: f64| contest.step.eval(&[0.5, -0.25, 2.0, 0.0, 0.0, push]);
    let [h, bound] = [0.1_f32, 0.3_f32].map(f64::from);
    for push in [-1.0, 0.0, 0.5, 1.0] {
        let expected = [0.5 + h * -0.25, -0.25 + h * (2.0 + bound * push)];
        for (next, expected) in next(push).into_iter().zip(expected) {
            assert!((next - expected).abs() < 1e-7, "{next}, not {expected}, at {push}");
        }
    }
    assert_eq!(model.next(&[0.5, -0.25], &[2.0], 0), next(0.0));
    let plain = CART.replace("[model.disturbances]\npush = { unit = \"N\", bound = 0.3 }\n", "");
    let plain = self::config(&plain.replace("force + push", "force + 0"), &[]).unwrap();
    assert!(plain.contest(&model).unwrap_err().to_string().contains("[model.disturbances]"));
    // Pushes on states stand beside it.
    let both = ["train.ddpg.disturbance.position=0.01"];
    let both = self::config(CART, &both).unwrap().contest(&model).unwrap();
    assert_eq!(both.names, ["push", "push_position"]);
    let moved = both.step.eval(&[0.5, -0.25, 2.0, 0.0, 0.0, 0.0, 1.0]);
    assert!((moved[0] - next(0.0)[0] - 0.01).abs() < 1e-7, "{moved:?}");
}

#[test]
fn what_cannot_be_trained_is_refused_by_name() {
    let problem = |text: &str, set: &[&str]| -> String {
        let trained = config(text, set).and_then(|config| {
            let model = config.plain_model()?;
            config.interface(&model)?;
            config.train_settings()?.method.check_task(&model.task)?;
            Err::<(), Error>(Error::invalid("nothing", "refused"))
        });
        trained.unwrap_err().to_string()
    };
    let open = CART.replace("[-1.0, 3.0]", "[-inf, 3.0]");
    let found = problem(&open, &[]);
    for part in ["model.controls.force.bounds", "act = { force", "out[0]"] {
        assert!(found.contains(part), "no `{part}` in: {found}");
    }
    let told = open + "[policy]\nact = { force = \"5 * out[0]\" }\n";
    assert!(problem(&told, &[]).contains("nothing"), "an open bound with `act`");
    let timed = SLEDGE.replace("\"avoid\"", "\"at-end\"\ntarget = \"0.5 - x^2\"");
    let found = problem(&timed, &["train.method=ddpg"]);
    assert!(found.contains("`ddpg`") && found.contains("`ppo`"), "{found}");
    for method in ["train.method=ppo", "train.method=action-value"] {
        assert!(problem(&timed, &[method]).contains("nothing"));
    }
    assert!(problem(SLEDGE, &["train.method=ddpg"]).contains("nothing"));
    for (key, value) in [("unit", "0"), ("gamma", "1.5"), ("stepwise", "-1")] {
        let found = problem(CART, &[&format!("train.analytic.{key}={value}")]);
        assert!(found.contains(&format!("train.analytic.{key}")), "{found}");
    }
    let misplaced = CART.replace("0.2 - hypot", "push - hypot");
    assert!(problem(&misplaced, &[]).contains("`push` is a disturbance"));
    let hidden = CART.replace("0.2 - hypot", "sum - hypot");
    assert!(problem(&hidden, &[]).contains("uses the control `force`"));
    for (wrong, part) in [
        ("bound = 0", "above 0"),
        ("draw = \"normal\"", "drawn do not work yet"),
        ("bound = 1, hold = 3", "drawn do not work yet"),
        ("unit = \"N\"", "model.disturbances.push.bound: missing"),
    ] {
        let found = problem(&CART.replace("unit = \"N\", bound = 0.3", wrong), &[]);
        assert!(found.contains(part), "no `{part}` in: {found}");
    }
}

/// Without a goal larger target margins are nearer; a violation out of the target costs nothing only where a
/// rollout is over in the target.
#[test]
fn a_reward_follows_from_margins_and_task() {
    let weights = || settings(&config(CART, &[]).unwrap()).ppo.reward.clone();
    let visited = |target: f32, constraint: f32| Visited {
        state: &[0.0, 0.0],
        margins: Margins { target, constraint },
    };
    let reward = |task: reachcast::model::Task, from: [f32; 2], to: [f32; 2]| {
        let reward = Reward { task, goal: Vec::new(), weights: weights() };
        reward.of(visited(from[0], from[1]), visited(to[0], to[1]))
    };
    let plain = reachcast::model::Task::default();
    assert!((reward(plain, [-1.0, 1.0], [-0.375, 1.0]) - 0.625).abs() < 1e-6);
    assert_eq!(reward(plain, [-1.0, 1.0], [-1.0, -0.5]), -2.0);
    assert_eq!(reward(plain, [0.5, 1.0], [0.5, -0.5]), 0.0);
    let avoid = reachcast::model::Task::Avoid;
    assert_eq!(reward(avoid, [0.5, 1.0], [0.5, -0.5]), -2.0);
    assert_eq!(reward(avoid, [-1.0, 1.0], [-1.0, 1.0]), 0.0);
    // A margin that is infinite gets no larger.
    assert_eq!(reward(plain, [f32::NEG_INFINITY, 1.0], [f32::NEG_INFINITY, 1.0]), 0.0);
}

/// From a file without a policy to a certificate: the last words of `train` are the section that is missing.
#[test]
fn a_model_without_a_policy_is_trained_and_certified() {
    let folder = Folder::new();
    let (model, out) = (folder.path("cart.toml"), folder.path("trained"));
    std::fs::write(&model, CART).unwrap();
    refused(&["certify", &model], &["cart.toml", "no policy", "reachcast train"]);
    let few = ["--set", "train.analytic.iterations=150", "--set", "train.held_out=512"];
    let told = done(&[&["train", &model, "--out", &out][..], &few].concat());
    let (_, section) = told.split_once("[policy]").unwrap();
    // A range of -1 to 3 is its middle and half of its width.
    assert!(section.contains("force = \"1 + 2 * out[0]\""), "{section}");
    let record = std::fs::read_to_string(format!("{out}/train.json")).unwrap();
    let record: serde_json::Value = serde_json::from_str(&record).unwrap();
    let score = |point: &serde_json::Value| point["scores"][0].as_f64().unwrap();
    let curve = record["curve"].as_array().unwrap();
    let best = curve.iter().map(score).fold(0.0, f64::max);
    assert!(best > 0.9 && score(&curve[0]) < 0.5, "from {} to {best}", score(&curve[0]));
    assert!(record["policy"].as_str().unwrap().contains("file = \"policy.safetensors\""));
    let page = std::fs::read_to_string(format!("{out}/report.html")).unwrap();
    assert!(page.contains("1 + 2 * out[0]"), "the page says how the policy is used");
    std::fs::write(&model, format!("{CART}[policy]{section}")).unwrap();
    let certificate = folder.path("certificate");
    let quick = ["global.draws=2000", "global.share_draws=2000", "slice.x.step=0.5"];
    let quick = quick.iter().flat_map(|set| ["--set", set]);
    let run = ["certify", &model, "--out", &certificate, "--backend", "cpu", "--json"];
    let (_, output, message) =
        command::reachcast(&run.into_iter().chain(quick).collect::<Vec<_>>());
    let record: serde_json::Value = serde_json::from_str(&output).expect(&message);
    let accepted = record["global"]["accepted"].as_u64().unwrap();
    assert!(accepted > 0, "{}", record["global"]);
}

/// The players of a contest by name, and their files.
#[test]
fn a_policy_is_trained_against_a_disturbance_by_name() {
    let folder = Folder::new();
    let (model, out) = (folder.path("cart.toml"), folder.path("trained"));
    std::fs::write(&model, CART).unwrap();
    let few = ["train.ddpg.iterations=40", "train.interval=20", "train.hidden=[8]"];
    let few = few.iter().flat_map(|set| ["--set", set]);
    let run = ["train", &model, "--method", "ddpg", "--out", &out];
    let record = document(&run.into_iter().chain(few).collect::<Vec<_>>());
    let widths = |i: usize| record["networks"][i]["widths"].to_string();
    assert_eq!([widths(0), widths(1), widths(2)], ["[4,8,1]", "[2,8,1]", "[2,8,1]"]);
    assert!(record["policy"].as_str().unwrap().contains("1 + 2 * out[0]"), "{record}");
}
