//! Forward passes, on 1,000 inputs, of the libraries that wrote the files.

use std::collections::BTreeMap;

use reachcast::files::{Array, read_npz};
use reachcast::policy::import::{Origin, Request};
use reachcast::policy::{Activation, Mlp};

use super::{imported, named, path};

/// Largest difference, as a part of the output's scale.
const TOLERANCE: f32 = 1e-5;
const COUNT: u64 = 1000;

/// The inputs of `make_imports.py`, made again.
fn inputs(width: u64) -> impl Iterator<Item = Vec<f32>> {
    let number = |i: u64| {
        let hashed = (i * 2_654_435_761 + 12_345) % (1 << 32);
        (hashed as f64 / f64::from(1 << 30) - 2.0) as f32
    };
    (0..COUNT).map(move |row| (0..width).map(|column| number(row * width + column)).collect())
}

/// Largest difference of one output for each input, to those that the library gives, as a part of their scale.
fn difference(network: &Mlp, passes: &BTreeMap<String, Array>, name: &str) -> f32 {
    let expected = passes[name].data.as_f32().unwrap();
    assert_eq!(expected.len() as u64, COUNT);
    let scale = expected.iter().fold(1.0_f32, |scale, value| scale.max(value.abs()));
    let found = inputs(4).enumerate().map(|(i, input)| network.forward(&input)[i % 2]);
    found.zip(expected).map(|(found, value)| (found - value).abs() / scale).fold(0.0, f32::max)
}

fn stated(activation: Activation, output: Activation) -> Request {
    Request { activation: Some(activation), output: Some(output), ..Request::default() }
}

#[test]
fn outputs_are_those_of_the_libraries() {
    let passes = read_npz(&path("forward.npz")).unwrap();
    let mut seen = Vec::new();
    let mut close = |name: &str, request: &Request| {
        let worst = difference(&imported(name, request).network, &passes, name);
        println!("{name}: {worst:e}");
        assert!(worst <= TOLERANCE, "{name}: {worst:e}");
        seen.push(name.to_owned());
    };
    let plain = Request::default();
    // In one step, with what each library does by default.
    for name in [
        "sb3_ppo.zip",
        "sb3_sac.zip",
        "sb3_sac_sde.zip",
        "sb3_td3.zip",
        "rsl_rl.pt",
        "rl_games.pth",
        "cleanrl_ppo.pt",
        "cleanrl_sac.pt",
        "cleanrl_td3.pt",
        "omnisafe.pt",
        "safe_control_gym.pt",
        "tianshou_prob.pth",
        "pytorch_sac.pt",
        "brax.pkl",
        "brax_numpy.pkl",
        "acas.nnet",
        "polar.txt",
        "sherlock.txt",
        "units.onnx",
        "smooth.onnx",
        "written_out.onnx",
        "limited.onnx",
        "layer_norm.onnx",
        "batch_norm.onnx",
        "affine.onnx",
        "halves.onnx",
        "image.onnx",
        "plain.onnx",
    ] {
        close(name, &plain);
    }
    for name in ["lightning.ckpt", "legacy.pth"] {
        close(name, &stated(Activation::Relu, Activation::Tanh));
    }
    close("heads.onnx", &named(&["action"]));
    close("flax.pkl", &stated(Activation::Tanh, Activation::Tanh));
    close("foreign.safetensors", &stated(Activation::Silu, Activation::Identity));
    assert_eq!(seen.len(), passes.len(), "a pass that no file is compared with");
    // The comparison can fail: another activation, and statistics that are left out.
    let far = |name: &str, request: &Request| {
        let worst = difference(&imported(name, request).network, &passes, name);
        assert!(worst > 1e-2, "{name}: {worst:e}");
    };
    far("flax.pkl", &stated(Activation::Relu, Activation::Tanh));
    far("rsl_rl.pt", &named(&["model_state_dict.actor"]));
    far("omnisafe.pt", &named(&["pi.mean"]));
    far("cleanrl_sac.pt", &named(&["fc1", "fc2", "fc_mean"]));
}

#[test]
fn both_ways_of_exporting_give_the_same() {
    let passes = read_npz(&path("forward.npz")).unwrap();
    for name in ["units", "smooth", "limited", "layer_norm", "plain"] {
        let [plain, dynamo] = [format!("{name}.onnx"), format!("{name}_dynamo.onnx")]
            .map(|file| imported(&file, &Request::default()).network);
        let worst = difference(&dynamo, &passes, &format!("{name}.onnx"));
        assert!(worst <= TOLERANCE, "{name}: {worst:e}");
        assert_eq!(dynamo, plain, "{name}");
    }
}

#[test]
fn what_was_recognised_is_said() {
    let told = |name: &str| {
        let found = imported(name, &Request::default());
        (found.layout.unwrap_or_default(), found.notes.join("; "), found.activation_from)
    };
    let (layout, notes, from) = told("sb3_ppo.zip");
    assert_eq!((layout.as_str(), from), ("stable-baselines3 (PPO, A2C)", Origin::File));
    assert!(notes.contains("kept within the limits of the actions"), "{notes}");
    let (layout, notes, _) = told("sb3_sac.zip");
    assert_eq!(layout, "stable-baselines3 (SAC)");
    assert!(notes.contains("scaled to the limits of the actions"), "{notes}");
    let (layout, notes, from) = told("rsl_rl.pt");
    assert_eq!((layout.as_str(), from), ("rsl_rl", Origin::Layout));
    assert!(notes.contains("`model_state_dict.actor_obs_normalizer`"), "{notes}");
    let (layout, notes, _) = told("brax.pkl");
    assert_eq!(layout, "Brax");
    assert!(notes.contains("2 means and 2 deviations"), "{notes}");
    assert!(told("tianshou_prob.pth").1.contains("largest action"));
    assert_eq!(told("polar.txt").0, "POLAR text");
    assert!(told("sherlock.txt").1.contains("ReLU"));
}

#[test]
fn layers_are_ordered_by_their_numbers() {
    let names = |name: &str| imported(name, &stated(Activation::Tanh, Activation::Tanh)).layers;
    assert_eq!(
        names("foreign.safetensors")[1..],
        (2..=11).map(|i| format!("pi.fc{i}")).collect::<Vec<_>>()
    );
    assert_eq!(
        names("flax.pkl"),
        (0..=11).map(|i| format!("params.Dense_{i}")).collect::<Vec<_>>()
    );
}
