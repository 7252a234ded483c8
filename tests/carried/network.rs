//! A policy file in f64: sums of products and activations, layer by layer.

use std::path::Path;

use reachcast::policy::{Activation, Mlp};

/// The network of a file under `configs`, as a function.
pub(crate) fn network(file: &str) -> impl Fn(&[f64]) -> Vec<f64> + use<> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(file);
    let network = Mlp::load(&path).expect("a network");
    move |x| outputs(&network, x)
}

fn outputs(network: &Mlp, x: &[f64]) -> Vec<f64> {
    let mut x = x.to_vec();
    for layer in network.layers() {
        let sum = |row: usize| {
            let weights = &layer.weight[row * layer.inputs..][..layer.inputs];
            let products = weights.iter().zip(&x).map(|(weight, x)| f64::from(*weight) * x);
            products.sum::<f64>() + f64::from(layer.bias[row])
        };
        let value = |sum: f64| match layer.activation {
            Activation::Identity => sum,
            Activation::Tanh => sum.tanh(),
            Activation::Relu => sum.max(0.0),
            Activation::Silu => sum / (1.0 + (-sum).exp()),
            other => unreachable!("no carried network has {other}"),
        };
        x = (0..layer.outputs).map(|row| value(sum(row))).collect();
    }
    x
}
