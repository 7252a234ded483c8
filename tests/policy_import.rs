//! Policies imported from files that PyTorch and ONNX wrote, against PyTorch's own forward pass.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod checkpoint;
mod imports;

use std::collections::BTreeMap;
use std::path::Path;

use checkpoint::{bytes, import, path, refused, stated};
use reachcast::files::{Array, read_npz};
use reachcast::policy::import::{Cast, Imported, Origin, Request, read};
use reachcast::policy::{Activation, Mlp};

/// Largest difference to PyTorch's forward pass in f32; the outputs are of the order of 1.
const TOLERANCE: f32 = 1e-5;

fn request(network: &str) -> Request {
    let networks = network.split(',').filter(|name| !name.is_empty());
    Request { networks: networks.map(str::to_owned).collect(), ..Request::default() }
}

/// The same, with what a plain checkpoint does not say.
fn plain(network: &str) -> Request {
    Request { networks: request(network).networks, ..stated() }
}

fn silu(network: &str) -> Request {
    Request {
        activation: Some(Activation::Silu),
        output: Some(Activation::Identity),
        ..request(network)
    }
}

fn cast(request: Request) -> Request {
    Request { cast: Cast::ToF32, ..request }
}

fn network(name: &str, request: Request) -> Mlp {
    read(&path(name), &request).unwrap_or_else(|error| panic!("{error}")).network
}

/// The 1,000 inputs and PyTorch's outputs.
fn forward_passes() -> BTreeMap<String, Array> {
    read_npz(&path("forward.npz")).unwrap()
}

/// Largest difference of the outputs of `network` to those that PyTorch calls `name`.
fn distance(network: &Mlp, passes: &BTreeMap<String, Array>, name: &str) -> f32 {
    let rows = |name: &str| {
        let Array { shape, data } = &passes[name];
        assert_eq!(shape[0], 1000);
        data.as_f32().unwrap().chunks_exact(shape[1])
    };
    let width = network.widths()[0];
    let mut worst: f32 = 0.0;
    for (input, expected) in rows("inputs").zip(rows(name)) {
        let found = network.forward(&input[..width]);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            worst = worst.max((found - expected).abs());
        }
    }
    worst
}

#[test]
fn outputs_are_those_of_pytorch() {
    let passes = forward_passes();
    let close = |file: &str, request: Request, name: &str| {
        let worst = distance(&network(file, request.clone()), &passes, name);
        println!("{file} {:?} against {name}: {worst:e}", request.networks);
        assert!(worst <= TOLERANCE, "{file} {:?}: {worst:e}", request.networks);
    };
    for name in ["actor1", "actor1_old", "actor2", "actor2_old", "critic", "critic_old"] {
        close("tianshou.pth", request(name), name);
    }
    for file in [
        "sequential.pth",
        "strided.pth",
        "parameters.pth",
        "training.pt",
        "legacy.pth",
        "script.pt",
    ] {
        close(file, plain(""), "sequential");
    }
    close("ambiguous.pth", request("student"), "sequential");
    close("ambiguous.pth", silu("teacher"), "silu");
    close("silu.pth", silu(""), "silu");
    close("double.pth", cast(plain("")), "sequential");
    for file in ["relu.onnx", "relu_dynamo.onnx", "products.onnx"] {
        close(file, request(""), "sequential");
    }
    close("double.onnx", cast(plain("")), "sequential");
    close("silu.onnx", request(""), "silu");
    // The comparison can fail: another network, another activation, another output.
    let far = |file: &str, request: Request, name: &str| {
        assert!(distance(&network(file, request), &passes, name) > 1e-2, "{file} against {name}");
    };
    far("tianshou.pth", request("actor1"), "actor1_old");
    far("silu.pth", plain(""), "silu");
    far("silu.pth", Request { activation: Some(Activation::Silu), ..request("") }, "silu");
}

#[test]
fn the_same_weights_in_other_layouts_are_the_same_network() {
    let expected = network("sequential.pth", plain(""));
    for file in ["strided.pth", "parameters.pth", "training.pt", "relu.onnx", "products.onnx"] {
        assert_eq!(network(file, plain("")), expected, "{file}");
    }
    assert_eq!(network("double.pth", cast(plain(""))), expected);
    let worst = |file: &str| {
        let other = network(file, cast(plain("")));
        let numbers = |network: &Mlp| -> Vec<f32> {
            network
                .layers()
                .iter()
                .flat_map(|layer| [&layer.weight[..], &layer.bias].concat())
                .collect()
        };
        let pairs = numbers(&other).into_iter().zip(numbers(&expected));
        pairs.map(|(other, weight)| ((other - weight) / weight).abs()).fold(0.0, f32::max)
    };
    // Rounded to 11 and 8 bits; the smallest weights of float16 have no fewer.
    assert!((1e-5..=1.0 / 2048.0).contains(&worst("half.pth")), "{}", worst("half.pth"));
    assert!((1e-4..=1.0 / 256.0).contains(&worst("bfloat16.pth")), "{}", worst("bfloat16.pth"));
}

#[test]
fn what_a_file_does_not_say_is_said_to_be_a_default() {
    let found = |file: &str, request: Request| {
        let Imported { network, layers, activation_from, output_from, .. } =
            read(&path(file), &request).unwrap();
        ((network.activation().unwrap(), activation_from), (network.output(), output_from), layers)
    };
    let (activation, output, layers) = found("tianshou.pth", request("actor1_old"));
    assert_eq!(activation, (Activation::Relu, Origin::Default));
    assert_eq!(output, (Activation::Tanh, Origin::Default));
    let body = [0, 2, 4, 6].map(|i| format!("actor1_old.preprocess.model.model.{i}"));
    assert_eq!(layers[..4], body);
    assert_eq!(layers[4..], ["actor1_old.last.model.0"]);
    let (_, output, _) = found("tianshou.pth", request("critic"));
    assert_eq!(output, (Activation::Identity, Origin::Default));
    let tanh = Request { output: Some(Activation::Tanh), ..request("critic") };
    assert_eq!(found("tianshou.pth", tanh).1, (Activation::Tanh, Origin::Stated));
    let (activation, output, layers) = found("silu.onnx", request(""));
    assert_eq!(activation, (Activation::Silu, Origin::File));
    assert_eq!(output, (Activation::Identity, Origin::File));
    assert_eq!(layers, ["0.weight", "2.weight", "4.weight"]);
    assert_eq!(found("ambiguous.pth", silu("teacher")).0, (Activation::Silu, Origin::Stated));
}

#[test]
fn prefixes_name_one_network() {
    let everything = [
        "6 networks",
        "--network",
        "actor1  12-8-8-8-8-3",
        "actor1_old  12-8-8-8-8-3",
        "actor2  12-",
        "critic  18-8-8-8-8-1",
        "critic_old",
    ];
    refused("tianshou.pth", &request(""), &everything);
    refused("ambiguous.pth", &request(""), &["2 networks", "student  12-8-8-3", "teacher"]);
    refused("tianshou.pth", &request("actor"), &["no dense layer under `actor`", "actor1  12-"]);
    // Some keys on the way, if no name begins with them; the whole way, part by part.
    refused("tianshou.pth", &request("preprocess"), &["`preprocess` may be one of", "actor2_old"]);
    let whole = network("tianshou.pth", request("critic"));
    let parts = request("critic.preprocess,critic.last");
    let tail = Activation::Identity;
    assert_eq!(network("tianshou.pth", parts), whole);
    assert_eq!(whole.output(), tail);
    assert_eq!(network("training.pt", plain("model")), network("sequential.pth", plain("")));
    refused("tianshou.pth", &request("critic.last,critic.preprocess"), &["takes 18 numbers"]);
    refused("sequential.pth", &request("2,0"), &["`0.weight` takes 12 numbers", "gives 8"]);
    refused("relu.onnx", &request("0"), &["one network", "leave --network out"]);
    let other = Request { activation: Some(Activation::Tanh), ..request("") };
    refused("relu.onnx", &other, &["activation", "tanh is stated, the file has relu"]);
    let other = Request { output: Some(Activation::Identity), ..request("") };
    refused("relu.onnx", &other, &["output", "identity is stated, the file has tanh"]);
}

#[test]
fn other_floats_are_converted_only_if_that_is_stated() {
    refused("double.pth", &request(""), &["`0.", "float64", "--cast"]);
    refused("half.pth", &request(""), &["float16", "--cast"]);
    refused("bfloat16.pth", &request(""), &["bfloat16", "--cast"]);
    refused("double.onnx", &request(""), &["`0.weight`", "float64", "--cast"]);
    for request in [request(""), cast(request(""))] {
        refused("integer.pth", &request, &["`0.", "no floats"]);
    }
}

#[test]
fn files_that_hold_something_else() {
    let plain = request("");
    let module = ["torch.nn.modules.container.Sequential", "nothing was executed", "state_dict()"];
    refused("module.pth", &plain, &module);
    refused("normalised.pth", &plain, &["`1` is a LayerNorm", "`1.weight` of shape [8]", "ONNX"]);
    refused("softmax.onnx", &plain, &["`Softmax`", "Gemm"]);
    refused("residual.onnx", &plain, &["branches into"]);
    // Each layer may have an activation of its own, and what leads nowhere is not looked at.
    assert_eq!(network("mixed.onnx", request("")).hidden_words(), "relu, tanh");
    assert_eq!(network("gated.onnx", request("")).widths(), [12, 8, 3]);
    refused("external.onnx", &plain, &["another file", "external_data=False"]);
    let at = |name: &str, content: &[u8], words: &[&str]| {
        let error = import(Path::new(name), content, &plain).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    at("nothing.pth", b"", &["an empty file"]);
    at("nothing.onnx", b"", &["no graph"]);
    at("binary.pth", b"\x01\x02\x03", &["neither a checkpoint", ".onnx"]);
    at("text.onnx", b"layers: 3\n", &["no ONNX file"]);
    at("policy.pth", &bytes("relu.onnx"), &["neither a checkpoint"]);
    at("forward.pth", &bytes("forward.npz"), &["NumPy arrays", "safetensors.numpy.save_file"]);
    assert!(
        read(Path::new("nowhere.pth"), &plain).unwrap_err().to_string().contains("nowhere.pth")
    );
}
