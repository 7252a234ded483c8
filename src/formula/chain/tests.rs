//! Chains against the formulas that they are cut from.

use super::*;
use crate::formula::Scalar;
use crate::policy::{Activation, Layer};
use crate::real::Real;

/// A network of two numbers with two outputs, told from others by `scale`.
fn network(scale: f32) -> Arc<Mlp> {
    let layer = Layer::dense(vec![scale, -0.5, 0.25, 2.0 * scale], vec![0.1, -scale]);
    Arc::new(Mlp::new(vec![layer], Activation::Tanh, Activation::Tanh).expect("a network"))
}

/// What the chain gives for `inputs`, link by link.
fn run(chain: &Chain, inputs: &[f64]) -> Vec<f64> {
    let mut asked = vec![f64::NAN; chain.asked];
    let mut said = vec![f64::NAN; chain.said];
    let mut carried = vec![f64::NAN; chain.carried];
    for link in &chain.links {
        let read = |place: &Place| match *place {
            Place::Asked(at) => asked[at],
            Place::Said(at) => said[at],
            Place::Carried(at) => carried[at],
        };
        let reads: Vec<f64> = link.reads.iter().map(read).collect();
        let outputs = link.graph.eval(&[inputs, &reads].concat());
        if link.writes.is_empty() {
            return outputs;
        }
        for (place, value) in link.writes.iter().zip(outputs) {
            match *place {
                Place::Asked(at) => asked[at] = value,
                Place::Said(at) => said[at] = value,
                Place::Carried(at) => carried[at] = value,
            }
        }
        // What was said before is gone.
        said.fill(f64::NAN);
        for ask in &link.asks {
            let answer = ask.network.forward(&asked[ask.asked.clone()]);
            said[ask.said.clone()].copy_from_slice(&answer);
        }
    }
    panic!("the last link writes to no place");
}

/// Networks one after the other, beside each other, and numbers that cross them.
fn formula(x: &[Expr]) -> Vec<Expr> {
    let (one, two) = (network(0.7), network(-0.3));
    let early = x[0].sin() * x[1];
    let first = Expr::call(&one, &[x[0], x[1]]);
    let beside = Expr::call(&two, &[early, x[1] + first[1]]);
    let again = Expr::call(&one, &[beside[0] * first[0], Expr::lit(0.5)]);
    let late = early + again[1] * first[1] + x[1].exp();
    vec![late, beside[1], early, x[0], again[0] - late]
}

#[test]
fn a_chain_is_the_formula() {
    let graph = record(2, formula);
    let chain = Chain::new(&graph);
    assert_eq!(chain.links.len(), 4, "three networks one after the other");
    for x in [[0.3, -0.8], [1.5, 2.0], [-1.0, 0.0]] {
        assert_eq!(run(&chain, &x), graph.eval(&x), "{x:?}");
    }
}

#[test]
fn a_formula_without_networks_is_one_link() {
    let graph = record(2, |x| vec![x[0].sin() + x[1], x[1]]);
    let chain = Chain::new(&graph);
    assert_eq!((chain.links.len(), chain.carried, chain.asked), (1, 0, 0));
    assert_eq!(run(&chain, &[0.5, 2.0]), graph.eval(&[0.5, 2.0]));
}

/// All outputs of one call are one evaluation, and equal calls are one.
#[test]
fn equal_calls_are_one() {
    let graph = record(2, |x| {
        let [a, b] = [0, 1].map(|i| Expr::call(&network(0.7), x)[i]);
        let other = Expr::call(&network(0.8), x)[0];
        vec![a + b + other, Expr::call(&network(0.7), &[x[1], x[0]])[0]]
    });
    assert_eq!(graph.calls.len(), 3);
    let joined = Graph::joined(&[&graph, &graph]);
    assert_eq!((joined.calls.len(), joined.nodes.len()), (3, graph.nodes.len()));
    assert_eq!(joined.outputs, [&graph.outputs[..], &graph.outputs].concat());
    let ignored = record(2, |x| {
        Expr::call(&network(0.9), x);
        vec![x[0]]
    });
    assert!(ignored.calls.is_empty(), "what nothing needs is left out");
}

/// Values between networks take as many places as there are at a time, not as many as there are.
#[test]
fn places_are_used_again() {
    let one = network(0.7);
    let graph = record(2, |x| {
        let mut y = x.to_vec();
        for _ in 0..20 {
            let said = Expr::call(&one, &y);
            y = vec![y[0] + said[0], y[1] * said[1]];
        }
        y
    });
    let chain = Chain::new(&graph);
    assert_eq!((chain.links.len(), chain.carried), (21, 2));
    let [x, y] = [0.4, -0.6];
    assert_eq!(run(&chain, &[x, y]), graph.eval(&[x, y]));
}
