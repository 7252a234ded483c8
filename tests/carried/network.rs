//! A policy file in f64: sums of products and activations, layer by layer.

use std::path::Path;

use reachcast::policy::{Activation, Mlp, OutputActivation};

/// The network of a file under `configs`, as a function.
pub(crate) fn network(file: &str) -> impl Fn(&[f64]) -> Vec<f64> + use<> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let network = Mlp::load(&path).expect("a network");
    move |x| outputs(&network, x)
}

fn outputs(network: &Mlp, x: &[f64]) -> Vec<f64> {
    let mut x = x.to_vec();
    for (number, layer) in network.layers().iter().enumerate() {
        let last = number + 1 == network.layers().len();
        let sum = |row: usize| {
            let weights = &layer.weight[row * layer.inputs..][..layer.inputs];
            let products = weights.iter().zip(&x).map(|(weight, x)| f64::from(*weight) * x);
            products.sum::<f64>() + f64::from(layer.bias[row])
        };
        let value = |sum: f64| match (last, network.activation(), network.output()) {
            (true, _, OutputActivation::Identity) => sum,
            (true, _, OutputActivation::Tanh) | (false, Activation::Tanh, _) => sum.tanh(),
            (false, Activation::Relu, _) => sum.max(0.0),
            (false, Activation::Silu, _) => sum / (1.0 + (-sum).exp()),
        };
        x = (0..layer.outputs).map(|row| value(sum(row))).collect();
    }
    x
}
