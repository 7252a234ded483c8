//! Policies that are exported, and imported again.

use reachcast::policy::import::{Request, from_bytes};
use reachcast::policy::{Activation, Layer, Mlp, Norm, Rescale, onnx_bytes};

use super::imported;

/// Writes a policy as a graph and reads it.
fn again(network: &Mlp) -> Mlp {
    let bytes = onnx_bytes(network);
    let found = from_bytes("again.onnx".as_ref(), &bytes, &Request::default());
    found.unwrap_or_else(|error| panic!("{error}")).network
}

/// Numbers that are all different.
fn numbers(count: usize, first: usize) -> Vec<f32> {
    (first..first + count).map(|i| ((i * 7919 % 1009) as f32 - 500.0) / 333.0).collect()
}

fn layer(inputs: usize, outputs: usize, activation: Activation) -> Layer {
    let (weight, bias) = (numbers(inputs * outputs, 1), numbers(outputs, 17));
    Layer { activation, ..Layer::dense(weight, bias) }
}

#[test]
fn every_activation_comes_back() {
    let others = [
        Activation::LeakyRelu { slope: 0.25 },
        Activation::Elu { alpha: 0.3 },
        Activation::Celu { alpha: 1.7 },
        Activation::Softplus { beta: 3.0 },
        Activation::Hardtanh { low: -0.3, high: 2.0 },
    ];
    for activation in Activation::ALL.into_iter().chain(others) {
        for last in [activation, Activation::Identity, Activation::Tanh] {
            let layers = vec![layer(3, 4, activation), layer(4, 4, activation), layer(4, 2, last)];
            let network = Mlp::from_layers(layers).unwrap();
            assert_eq!(again(&network).digest(), network.digest(), "{activation} {last}");
            // The digest tells them apart.
            let other = Mlp::from_layers(vec![layer(3, 4, activation), layer(4, 2, last)]).unwrap();
            assert_ne!(again(&other).digest(), network.digest());
        }
    }
}

#[test]
fn maps_norms_and_names_come_back() {
    let limit = |value: f32, count: usize| vec![value; count];
    let input = Rescale {
        low: limit(-1.5, 3),
        high: numbers(3, 400),
        ..Rescale::affine(numbers(3, 5), numbers(3, 9))
    };
    let output = Rescale { high: limit(2.5, 2), ..Rescale::affine(limit(2.0, 2), limit(0.5, 2)) };
    let norm = Norm { scale: numbers(4, 3), shift: numbers(4, 8), epsilon: 1e-3 };
    let normed = Layer { norm: Some(norm), ..layer(3, 4, Activation::Silu) };
    let network = Mlp::from_layers(vec![normed, layer(4, 2, Activation::Identity)]).unwrap();
    let whole = network.with_input(input).unwrap().with_output(output.clone()).unwrap();
    let names = ["x", "y", "z"].map(str::to_owned).to_vec();
    let whole = whole.with_state_order(names).unwrap();
    assert_eq!(again(&whole), whole);
    // A factor that could be folded, layers without an activation between them, a single layer.
    let doubled = Rescale::affine(limit(2.0, 3), limit(0.0, 3));
    let layers = vec![layer(3, 4, Activation::Identity), layer(4, 2, Activation::Identity)];
    let linear =
        Mlp::from_layers(layers).unwrap().with_input(doubled).unwrap().with_output(output).unwrap();
    assert_eq!(again(&linear), linear);
    let single =
        Mlp::new(vec![layer(3, 2, Activation::Tanh)], Activation::Mish, Activation::Tanh).unwrap();
    assert_eq!(again(&single), single);
}

#[test]
fn signs_of_zero_and_many_layers_come_back() {
    for activation in [Activation::LeakyRelu { slope: -0.0 }, Activation::Elu { alpha: -0.0 }] {
        let layers = vec![layer(3, 4, activation), layer(4, 2, Activation::Identity)];
        let network = Mlp::from_layers(layers).unwrap();
        assert_eq!(again(&network).digest(), network.digest(), "{activation}");
    }
    let layers = (0..300).map(|_| layer(3, 3, Activation::Tanh)).collect();
    let deep = Mlp::from_layers(layers).unwrap();
    assert_eq!(again(&deep).digest(), deep.digest());
}

#[test]
fn what_does_not_come_back_gives_the_same() {
    let plain = Rescale::affine(vec![1.0; 3], vec![0.0; 3]);
    let clip = Activation::Hardtanh { low: 0.0, high: 6.0 };
    let layers = vec![layer(3, 4, clip), layer(4, 2, Activation::Identity)];
    let network = Mlp::from_layers(layers).unwrap().with_input(plain).unwrap();
    let back = again(&network);
    assert_eq!(back.layers()[0].activation, Activation::Relu6);
    assert!(back.input_map().is_none() && network.input_map().is_some());
    let x = numbers(3, 40);
    assert_eq!(back.forward(&x), network.forward(&x));
}

#[test]
fn what_was_imported_comes_back() {
    for name in
        ["sb3_ppo.zip", "omnisafe.pt", "affine.onnx", "layer_norm.onnx", "smooth.onnx", "acas.nnet"]
    {
        let network = imported(name, &Request::default()).network;
        assert_eq!(again(&network), network, "{name}");
    }
}
