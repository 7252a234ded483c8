//! Policies from text: formulas, and networks with what they see and what comes of it.

use std::path::Path;

use reachcast::model::text::{Description, read};
use reachcast::model::{Controller, Law, Plant};
use reachcast::policy::{Activation, Layer, Mlp};

use super::{cart_with, refusal};

/// A network of 3 inputs and 2 outputs whose numbers are all different.
fn network() -> Mlp {
    let numbers = |count: usize, from: f32| (0..count).map(|i| from - 0.13 * i as f32).collect();
    let layer = |inputs: usize, outputs: usize| {
        Layer::dense(numbers(inputs * outputs, 0.9), numbers(outputs, 0.2))
    };
    let layers = vec![layer(3, 4), layer(4, 2)];
    Mlp::new(layers, Activation::Tanh, Activation::Identity).expect("a network")
}

/// The cart with `policy` in place of its own, read where `net.safetensors` is `network`.
fn with_network(network: &Mlp, policy: &str) -> reachcast::Result<(Description, Controller)> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("net.safetensors"), network.to_bytes()).expect("a file");
    let text = cart_with("formula = { force = \"-2 * x - speed\" }", policy);
    let description = read(&text, "cart.toml", folder.path())?;
    let controller = description.controller()?;
    Ok((description, controller))
}

fn problem(network: &Mlp, policy: &str) -> String {
    with_network(network, policy).expect_err(policy).to_string()
}

/// Inputs of the model: `x`, `speed`, `force`, `mass`, `t`, `step`.
const INPUTS: [f64; 6] = [0.3, -0.8, f64::NAN, 2.0, 1.5, 4.0];

#[test]
fn a_formula_is_the_control() {
    let text = cart_with("-2 * x - speed", "-mass * x + drag - t * step");
    let controller = super::described(&text).expect("a description").controller().expect("one");
    let Law::Formula(graph) = controller.law else { panic!("a formula") };
    let expected = -2.0 * 0.3 + f64::from(0.1_f32) * -0.8 - 1.5 * 4.0;
    assert_eq!(graph.eval(&INPUTS), [expected]);
}

/// What the network sees, the network, and what comes of it, each against plain arithmetic.
#[test]
fn observe_and_act() {
    let policy = "observe = [\"x / 2.5\", \"sin(speed)\", \"drag + t\"]\nfile = \"net.safetensors\"\n\
                  act = { force = \"2 * out[1] - x * out[0]\" }";
    let (_, controller) = with_network(&network(), policy).expect("a controller");
    assert_eq!(controller.name, "mlp 3-4-2");
    let Law::Network { observe: Some(observe), network: read, act: Some(act) } = controller.law
    else {
        panic!("a network with formulas around it");
    };
    let seen = observe.eval(&INPUTS);
    let expected = [0.3 / 2.5, (-0.8_f64).sin(), f64::from(0.1_f32) * -0.8 + 1.5];
    for (seen, expected) in seen.iter().zip(expected) {
        assert!((seen - expected).abs() < 1e-6, "{seen}, not {expected}");
    }
    assert_eq!(*read, network());
    let out = read.forward(&seen);
    let control = act.eval(&[&INPUTS[..], &out].concat());
    assert_eq!(control, [2.0 * out[1] - 0.3 * out[0]]);
}

#[test]
fn a_bare_network_sees_the_states_and_is_the_control() {
    let layer = Layer::dense(vec![1.0, 2.0], vec![0.0]);
    let fits = Mlp::new(vec![layer], Activation::Relu, Activation::Tanh).expect("a network");
    let file = "file = \"net.safetensors\"";
    let (_, controller) = with_network(&fits, file).expect("a controller");
    assert!(matches!(controller.law, Law::Network { observe: None, act: None, .. }));
    let named = |names: [&str; 2]| {
        fits.clone().with_state_order(names.map(str::to_owned).to_vec()).expect("names")
    };
    with_network(&named(["x", "speed"]), file).expect("the states in order");
    let problem = problem(&named(["speed", "y"]), file);
    assert!(
        problem.contains("its input `y` is none of the states `x,speed`")
            && problem.contains("`observe`"),
        "{problem}"
    );
}

/// A file that names other states than all in order sees those that it names.
#[test]
fn a_network_sees_the_states_that_its_file_names() {
    let layer = |weight: Vec<f32>| {
        let layer = Layer::dense(weight, vec![0.0]);
        Mlp::new(vec![layer], Activation::Relu, Activation::Identity).expect("a network")
    };
    let file = "file = \"net.safetensors\"";
    for (weight, names, expected) in [
        (vec![1.0, 2.0], &["speed", "x"][..], INPUTS[1] + 2.0 * INPUTS[0]),
        (vec![3.0], &["speed"][..], 3.0 * INPUTS[1]),
        (vec![3.0], &["x"][..], 3.0 * INPUTS[0]),
    ] {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let network = layer(weight).with_state_order(names).expect("names");
        let (description, controller) = with_network(&network, file).expect("a controller");
        let plant = Plant::new(description.model().expect("a model"), controller);
        assert_eq!(plant.control(&INPUTS[..2], 0), [expected]);
    }
}

#[test]
fn networks_that_do_not_fit_are_refused() {
    let file = "file = \"net.safetensors\"";
    for (policy, parts) in [
        (file.to_owned(), ["net.safetensors", "takes 3 inputs, the model has 2 states"]),
        (format!("{file}\nobserve = [\"x\"]"), ["net.safetensors", "1 formulas in `observe`"]),
        (
            format!("{file}\nobserve = [\"x\", \"x\", \"x\"]"),
            ["net.safetensors", "2 outputs, the model has 1 controls"],
        ),
        (
            format!("{file}\nobserve = [\"x\", \"x\", \"x\"]\nact = {{ force = \"x + out[2]\" }}"),
            ["policy.act.force, column 5", "`out[2]` is none of the network's outputs, 0 to 1"],
        ),
        ("file = \"none.safetensors\"".to_owned(), ["none.safetensors", "o such file"]),
    ] {
        let problem = problem(&network(), &policy);
        for part in parts {
            assert!(problem.contains(part), "no `{part}` in: {problem}");
        }
    }
}

#[test]
fn sections_that_make_no_policy_are_refused() {
    let policy =
        |policy: &str| refusal(&cart_with("formula = { force = \"-2 * x - speed\" }", policy));
    for (text, part) in [
        ("formula = \"bang-bang\"", "policy.formula: expected a section"),
        ("formula = { force = \"x\" }\nobserve = [\"x\"]", "policy.observe: belongs to a network"),
        (
            "formula = { force = \"x\" }\nact = { force = \"x\" }",
            "policy.act: belongs to a network",
        ),
        ("observe = [\"x\"]", "no policy; expected `file`"),
        ("file = 3", "policy.file: expected a text"),
        ("file = \"a\"\nobserve = \"x\"", "policy.observe: expected a list of formulas"),
        ("file = \"a\"\nobserve = []", "found none"),
        ("file = \"a\"\nobserve = [\"x\", \"y\"]", "policy.observe[1], column 1: unknown name `y`"),
        ("file = \"a\"\nobserve = [\"force\"]", "makes the controls"),
        ("file = \"a\"\nact = { fource = \"out[0]\" }", "unknown control `fource`"),
        ("file = \"a\"\nact = {}", "no formula for the control `force`"),
    ] {
        let problem = policy(text);
        assert!(problem.contains(part), "no `{part}` in: {problem}");
    }
}

/// Paths are relative to the folder that is given.
#[test]
fn files_are_looked_for_beside_the_text() {
    let text = std::fs::read_to_string("configs/models/drone_race.toml").expect("a file");
    let elsewhere = read(&text, "race", Path::new("configs")).expect("a description");
    assert!(elsewhere.controller().is_err());
}
