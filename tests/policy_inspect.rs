//! Lipschitz bounds and ranges of networks, against decompositions, closed forms and many inputs.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod common;

use common::activations::{self, activations};
use nalgebra::DMatrix;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::policy::inspect::{Inspection, output_intervals, output_ranges};
use reachcast::policy::{Activation, Layer, Mlp, Norm, Rescale};
use reachcast::real::bound::{Domain, Interval, lipschitz};
use reachcast::rollout::{Purpose, Region, Stream};

/// A network with weights drawn uniformly, of about unit gain per layer.
fn network(widths: &[usize], activation: Activation, output: Activation, seed: u64) -> Mlp {
    let mut draw = StdRng::seed_from_u64(seed);
    let layers = widths.windows(2).map(|pair| {
        let (inputs, outputs) = (pair[0], pair[1]);
        let size = 1.5 / (inputs as f32).sqrt();
        let mut numbers =
            |count: usize| (0..count).map(|_| draw.random_range(-size..size)).collect();
        Layer::dense(numbers(inputs * outputs), numbers(outputs))
    });
    Mlp::new(layers.collect(), activation, output).unwrap()
}

/// The network in f64 from definitions, which the polynomials of `forward` are not.
fn exact(network: &Mlp, input: &[f64]) -> Vec<f64> {
    network.layers().iter().fold(input.to_vec(), |x, layer| {
        let rows = layer.weight.chunks_exact(layer.inputs).zip(&layer.bias);
        rows.map(|(row, &bias)| {
            let sum: f64 = row.iter().zip(&x).map(|(&w, x)| f64::from(w) * x).sum();
            activations::exact(layer.activation, sum + f64::from(bias))
        })
        .collect()
    })
}

fn race_policy() -> Mlp {
    Mlp::load("configs/policies/race_policy.safetensors".as_ref()).unwrap()
}

/// The steepest slope by central differences on a grid.
fn steepest(activation: Activation) -> f64 {
    let at = |x: f64| activations::exact(activation, x);
    let near = (-80_000..80_000).map(|i| f64::from(i) * 1e-4 + 5e-5);
    let slopes =
        near.chain([12.0, 30.0, 60.0, 90.0]).map(|x| ((at(x + 4e-5) - at(x - 4e-5)) / 8e-5).abs());
    slopes.fold(0.0, f64::max)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_lipschitz_bound_is_the_product_of_the_norms() {
    let networks = activations()
        .into_iter()
        .map(|activation| network(&[6, 32, 20, 2], activation, Activation::Identity, 3));
    for network in networks.chain([race_policy()]) {
        let inspection = Inspection::of(&network);
        let norms = network.layers().iter().map(|layer| {
            let weights = layer.weight.iter().map(|&w| f64::from(w));
            DMatrix::from_row_iterator(layer.outputs, layer.inputs, weights).singular_values().max()
        });
        let product: f64 = norms.product();
        let slope = steepest(network.activation().unwrap());
        let product = product * slope.powi(network.layers().len() as i32 - 1);
        let bound = inspection.lipschitz_bound;
        assert!(bound >= product * (1.0 - 1e-7), "{bound} is below {product}");
        assert!(bound <= product * 1.0005, "{bound} is far above {product}");
    }
}

#[test]
fn no_two_outputs_are_farther_apart_than_the_bound_says() {
    let mut draw = StdRng::seed_from_u64(5);
    for activation in activations() {
        // One layer of one neuron comes close to its bound: a positive weight at the steepest.
        let narrow = network(&[1, 1, 1], activation, Activation::Identity, 1);
        let wide = network(&[3, 16, 2], activation, Activation::Tanh, 4);
        // Others are steepest at one side of a corner, or where few inputs come.
        let (relu, silu) = (Activation::Relu, Activation::Silu);
        let usual = [relu, silu, Activation::Tanh, Activation::Gelu, Activation::Mish];
        let [near, far] = if usual.contains(&activation) { [0.999, 0.05] } else { [0.3, 0.003] };
        for (network, share) in [(narrow, near), (wide, far)] {
            let bound = Inspection::of(&network).lipschitz_bound;
            let mut steepest: f64 = 0.0;
            for _ in 0..40_000 {
                let mut side = |size: f64| -> Vec<f64> {
                    (0..network.widths()[0]).map(|_| draw.random_range(-size..size)).collect()
                };
                let (a, step) = (side(4.0), side(1e-3));
                let b: Vec<f64> = a.iter().zip(&step).map(|(a, step)| a + step).collect();
                let apart = distance(&exact(&network, &a), &exact(&network, &b));
                // What the outputs in f64 may be wrong by.
                let slope = (apart - 1e-14) / distance(&a, &b);
                assert!(slope <= bound, "{activation:?}: {slope} above {bound}");
                steepest = steepest.max(slope);
            }
            assert!(steepest >= bound * share, "{activation:?}: {steepest} far below {bound}");
        }
    }
}

#[test]
fn one_layer_has_its_range_in_closed_form() {
    let network = network(&[4, 3], Activation::Relu, Activation::Identity, 7);
    let sides = [[-1.0, 2.0], [0.5, 0.5], [-3.0, -1.0], [0.0, 1.0]];
    let intervals =
        output_intervals(&network, &sides.map(|[low, high]| Interval::new(low, high))).unwrap();
    let layer = &network.layers()[0];
    for (row, found) in intervals.iter().enumerate() {
        let end = |upper: bool| -> f64 {
            let weights = &layer.weight[4 * row..4 * row + 4];
            let terms = weights.iter().zip(sides).map(|(&w, [low, high])| {
                f64::from(w) * if (w > 0.0) == upper { high } else { low }
            });
            f64::from(layer.bias[row]) + terms.sum::<f64>()
        };
        let (low, high) = (end(false), end(true));
        assert!(found.low <= low && high <= found.high, "{found:?}: {low} to {high}");
        assert!(low - found.low < 1e-14 && found.high - high < 1e-14, "{found:?}");
    }
}

/// One input through one neuron: the range is exact, wherever the interval lies.
#[test]
fn activations_have_their_exact_range() {
    let layer = |weight: f32| Layer::dense(vec![weight], vec![0.0]);
    for activation in activations() {
        let layers = vec![layer(1.0), layer(1.0)];
        let network = Mlp::new(layers, activation, Activation::Identity).unwrap();
        for i in 0..120 {
            let low = -6.0 + 0.1 * f64::from(i);
            for width in [0.0, 0.003, 0.2, 1.0, 5.0] {
                let found =
                    output_intervals(&network, &[Interval::new(low, low + width)]).unwrap()[0];
                let grid = (0..=1000).map(|j| low + width * f64::from(j) / 1000.0);
                let values: Vec<f64> = grid.map(|x| exact(&network, &[x])[0]).collect();
                let least = values.iter().copied().fold(f64::INFINITY, f64::min);
                let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                // The library's exp and tanh are within a few units in the last place, erfc is not.
                let slack = if activation == Activation::Gelu { 1e-10 } else { 1e-15 };
                let held = found.low <= least + slack && most <= found.high + slack;
                assert!(held, "{activation} {low} + {width}: {found:?}, {least} to {most}");
                // A grid of 5 / 1000 misses the valley of SiLU by at most 0.5 (2.5e-3)^2 / 2; the
                // valley is taken to be 1e-4 wide.
                let loose = least - found.low < 3e-6 && found.high - most < 3e-6;
                assert!(loose, "{activation:?} {low} + {width}: {found:?}, {least} to {most}");
            }
        }
    }
    let silu = Mlp::new(vec![layer(1.0), layer(1.0)], Activation::Silu, Activation::Identity);
    let all = output_intervals(&silu.unwrap(), &[Interval::ENTIRE]).unwrap()[0];
    assert!(all.low < -0.278_464_5 && all.low > -0.279 && all.high == f64::INFINITY, "{all:?}");
}

#[test]
fn every_output_lies_in_its_interval() {
    let mut draw = StdRng::seed_from_u64(9);
    for activation in activations() {
        for output in [Activation::Tanh, Activation::Identity] {
            let network = network(&[5, 24, 24, 3], activation, output, 11);
            for size in [0.001, 0.1, 2.0] {
                let centre: Vec<f64> = (0..5).map(|_| draw.random_range(-1.0..1.0)).collect();
                let sides = centre.iter().map(|&c| Interval::new(c - size, c + size));
                let intervals = output_intervals(&network, &sides.collect::<Vec<_>>()).unwrap();
                for _ in 0..2_000 {
                    // Corners and edges as well as the inside.
                    let offset =
                        |c: &f64| c + size * draw.random_range(-2.0..2.0_f64).clamp(-1.0, 1.0);
                    let input: Vec<f64> = centre.iter().map(offset).collect();
                    for (value, interval) in exact(&network, &input).iter().zip(&intervals) {
                        let slack = 1e-14;
                        let inside =
                            interval.low - slack <= *value && *value <= interval.high + slack;
                        assert!(inside, "{activation:?} {output:?}: {value} outside {interval:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn seen_ranges_are_those_of_the_states_drawn() {
    let network = race_policy();
    let (low, high) = (vec![-1.0_f32; 12], (0..12).map(|i| 0.25 * i as f32).collect::<Vec<_>>());
    let stream = Stream::new(3, Purpose::USER, 0);
    let batches = (0..640).step_by(16).map(|i| stream.in_box::<16>(&low, &high, i));
    let ranges = output_ranges(&network, batches);
    let region = Region::Box { low, high };
    for (control, [least, most]) in ranges.into_iter().enumerate() {
        let values = (0..640).map(|i| network.forward(&region.point(stream, i))[control]);
        let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        assert_eq!([least, most], [low, high]);
    }
}

#[test]
fn numbers_of_the_layers() {
    let layers = vec![
        Layer::dense(vec![3.0, 0.0, 0.0, -4.0], vec![0.5, -2.0]),
        Layer::dense(vec![0.6, 0.8], vec![1.0]),
    ];
    let network = Mlp::new(layers, Activation::Tanh, Activation::Identity).unwrap();
    let Inspection { layers, lipschitz_bound, parameter_count, .. } = Inspection::of(&network);
    assert_eq!((layers[0].weight_range, layers[0].bias_range), ([-4.0, 3.0], [-2.0, 0.5]));
    assert!((4.0..4.001).contains(&layers[0].spectral_norm), "{}", layers[0].spectral_norm);
    assert!((4.0 - 1e-6..4.001).contains(&lipschitz_bound), "{lipschitz_bound}");
    assert_eq!(parameter_count, 9);
}

/// A network with everything: a norm, a map at each end, an activation of its own in each layer.
fn whole(activation: Activation, seed: u64) -> Mlp {
    let mut layers = network(&[3, 12, 9, 2], activation, Activation::Gelu, seed).layers().to_vec();
    layers[1].activation = Activation::Softsign;
    let row = |from: f32, count: usize| (0..count).map(|k| from + 0.1 * (k % 4) as f32).collect();
    layers[0].norm = Some(Norm { scale: row(0.6, 12), shift: row(-0.2, 12), epsilon: 0.01 });
    let input = Rescale { low: vec![-0.8; 3], ..Rescale::affine(row(0.7, 3), row(-0.1, 3)) };
    let output = Rescale { high: vec![0.1, 3.0], ..Rescale::affine(row(-1.3, 2), row(0.2, 2)) };
    let mlp = Mlp::from_layers(layers).and_then(|mlp| mlp.with_input(input));
    mlp.and_then(|mlp| mlp.with_output(output)).unwrap()
}

#[test]
fn bounds_hold_networks_with_norms_and_maps() {
    let mut draw = StdRng::seed_from_u64(21);
    for (seed, activation) in (30..).zip(activations()) {
        let mlp = whole(activation, seed);
        let global = Inspection::of(&mlp).lipschitz_bound;
        for size in [0.01, 0.3, 2.0] {
            let centre: Vec<f64> = (0..3).map(|_| draw.random_range(-0.6..0.6)).collect();
            let [low, high] =
                [-size, size].map(|side| centre.iter().map(|c| c + side).collect::<Vec<_>>());
            let domain = Domain { low: &low, high: &high, varies: &[true; 3] };
            let local = lipschitz(domain, |x| mlp.forward(x)[0]).constant;
            let sides = low.iter().zip(&high).map(|(&low, &high)| Interval::new(low, high));
            let intervals = output_intervals(&mlp, &sides.collect::<Vec<_>>()).unwrap();
            let mut point = || -> Vec<f64> {
                centre.iter().map(|c| c + size * draw.random_range(-1.0..1.0)).collect()
            };
            for _ in 0..400 {
                let (a, b) = (point(), point());
                let b: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + 1e-3 * (b - a)).collect();
                let [at, next] = [&a, &b].map(|x| mlp.forward(x));
                let apart = distance(&at, &next) - 1e-13;
                assert!(apart <= global * distance(&a, &b), "{activation}: {global}");
                let apart = (at[0] - next[0]).abs() - 1e-13;
                assert!(apart <= local * distance(&a, &b), "{activation}: {local}");
                for (value, interval) in at.iter().zip(&intervals) {
                    let held = interval.low - 1e-13 <= *value && *value <= interval.high + 1e-13;
                    assert!(held, "{activation}: {value} outside {interval:?}");
                }
            }
        }
    }
}
