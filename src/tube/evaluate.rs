//! Values of graphs and networks over affine forms.

use super::affine::{Affine, Symbols};
use super::choice;
use super::curve::Curve;
use crate::formula::{Call, Function, Graph, Node};
use crate::policy::{Activation, Mlp, Norm, Rescale};
use crate::real::bound::Interval;

/// The outputs of `graph` for `inputs`.
pub(super) fn outputs(graph: &Graph, inputs: &[Affine], symbols: &mut Symbols) -> Vec<Affine> {
    let values = values(graph, inputs, symbols);
    graph.outputs.iter().map(|output| values[*output as usize].clone()).collect()
}

/// The values of all nodes of `graph`.
pub(super) fn values(graph: &Graph, inputs: &[Affine], symbols: &mut Symbols) -> Vec<Affine> {
    let mut values: Vec<Affine> = Vec::with_capacity(graph.nodes.len());
    let mut said: Vec<Option<Vec<Affine>>> = vec![None; graph.calls.len()];
    for node in &graph.nodes {
        let value = match *node {
            Node::Said(number, output) => {
                let said = &mut said[number as usize];
                let call = || called(&graph.calls[number as usize], &values, symbols);
                said.get_or_insert_with(call)[output as usize].clone()
            }
            node => value(node, inputs, &values, symbols),
        };
        values.push(value);
    }
    values
}

/// What a network says to its arguments.
fn called(call: &Call, values: &[Affine], symbols: &mut Symbols) -> Vec<Affine> {
    let arguments = call.arguments.iter().map(|at| values[*at as usize].clone());
    network(&call.network, arguments.collect(), symbols)
}

/// The value of a node, given those of the earlier ones.
fn value(node: Node, inputs: &[Affine], values: &[Affine], symbols: &mut Symbols) -> Affine {
    let at = |i: u32| &values[i as usize];
    match node {
        Node::Input(i) => inputs[i as usize].clone(),
        Node::Literal(bits) => Affine::constant(f64::from(f32::from_bits(bits))),
        Node::Add(a, b) => at(a).plus(at(b)),
        Node::Sub(a, b) if a == b && at(a).known() => Affine::constant(0.0),
        Node::Sub(a, b) => at(a).minus(at(b)),
        Node::Mul(a, b) if a == b => Curve::Whole(2).of(at(a), symbols),
        Node::Mul(a, b) => at(a).times(at(b), symbols),
        Node::Div(a, b) => {
            let inverse = Curve::Reciprocal.of(at(b), symbols);
            at(a).times(&inverse, symbols)
        }
        Node::Neg(a) => at(a).negated(),
        Node::Abs(a) => choice::abs(at(a), symbols),
        Node::Sqrt(a) => Curve::Root.of(at(a), symbols),
        Node::Floor(a) => choice::floor(at(a), symbols),
        Node::Sign(a) => choice::sign(at(a), symbols),
        Node::Min(a, b) => choice::min(at(a), at(b), symbols),
        Node::Max(a, b) => choice::max(at(a), at(b), symbols),
        Node::Clamp(a, low, high) => choice::clamp(at(a), [at(low), at(high)], symbols),
        Node::IfLt(a, b, yes, no) | Node::SelectLt(a, b, yes, no) => {
            branch([a, b, yes, no], values, symbols)
        }
        Node::Hypot(a, b) => choice::hypot(at(a), at(b), symbols),
        Node::Atan2(a, b) => choice::atan2(at(a), at(b), symbols),
        Node::Powi(a, exponent) => power(at(a), exponent, symbols),
        Node::Powf(a, bits) => constant_power(at(a), f32::from_bits(bits), symbols),
        Node::Apply(Function::Wrap, a) => choice::wrap(at(a), symbols),
        Node::Apply(function, a) => Curve::Apply(function).of(at(a), symbols),
        Node::Said(..) => panic!("outputs of networks come from the calls of the graph"),
    }
}

/// A branch; the patterns of minimum and maximum are these.
fn branch([a, b, yes, no]: [u32; 4], values: &[Affine], symbols: &mut Symbols) -> Affine {
    let at = |i: u32| &values[i as usize];
    match (yes, no) {
        (yes, no) if (yes, no) == (a, b) => choice::min(at(a), at(b), symbols),
        (yes, no) if (yes, no) == (b, a) => choice::max(at(a), at(b), symbols),
        _ => choice::if_lt([at(a), at(b)], [at(yes), at(no)], symbols),
    }
}

/// A whole power.
fn power(x: &Affine, exponent: i32, symbols: &mut Symbols) -> Affine {
    match exponent {
        0 if x.known() => Affine::constant(1.0),
        1 => x.clone(),
        _ => Curve::Whole(exponent).of(x, symbols),
    }
}

/// A constant power: a whole one or a root where it is that.
fn constant_power(x: &Affine, exponent: f32, symbols: &mut Symbols) -> Affine {
    let whole = exponent as i32;
    if whole as f32 == exponent && whole.unsigned_abs() < 1 << 24 {
        return power(x, whole, symbols);
    }
    let curve = if exponent == 0.5 { Curve::Root } else { Curve::Power(exponent) };
    curve.of(x, symbols)
}

/// The outputs of a network.
pub(super) fn network(network: &Mlp, x: Vec<Affine>, symbols: &mut Symbols) -> Vec<Affine> {
    let seen = network.input_map().map_or_else(|| x.clone(), |map| mapped(map, &x, symbols));
    let said = network.layers().iter().fold(seen, |x, layer| {
        let sums = Affine::dense(&layer.weight, &layer.bias, &x);
        let normed = match &layer.norm {
            Some(norm) => normed(norm, &sums, symbols),
            None => sums,
        };
        normed.iter().map(|sum| activated(layer.activation, sum, symbols)).collect()
    });
    network.output_map().map_or_else(|| said.clone(), |map| mapped(map, &said, symbols))
}

/// An activation of a sum.
fn activated(activation: Activation, sum: &Affine, symbols: &mut Symbols) -> Affine {
    let constant = |value: f32| Affine::constant(f64::from(value));
    match activation {
        Activation::Identity => sum.clone(),
        Activation::Relu => choice::positive_part(sum, symbols),
        Activation::LeakyRelu { slope } => {
            let above = choice::positive_part(sum, symbols);
            let slope = f64::from(slope);
            Affine::combination(&[(slope, sum), (1.0 - slope, &above)], 0.0)
        }
        Activation::Hardtanh { low, high } => {
            choice::clamp(sum, [&constant(low), &constant(high)], symbols)
        }
        Activation::Relu6 => choice::clamp(sum, [&constant(0.0), &constant(6.0)], symbols),
        Activation::Tanh => Curve::Apply(Function::Tanh).of(sum, symbols),
        Activation::Sigmoid => Curve::Apply(Function::Sigmoid).of(sum, symbols),
        Activation::Silu => {
            let logistic = Curve::Apply(Function::Sigmoid).of(sum, symbols);
            sum.times(&logistic, symbols)
        }
        smooth => Curve::Activated(smooth).of(sum, symbols),
    }
}

/// A norm of the sums of a layer.
fn normed(norm: &Norm, sums: &[Affine], symbols: &mut Symbols) -> Vec<Affine> {
    let count = Affine::constant(sums.len() as f64);
    let share = Curve::Reciprocal.of(&count, symbols);
    let mean = total(sums).times(&share, symbols);
    let apart: Vec<Affine> = sums.iter().map(|sum| sum.minus(&mean)).collect();
    let squares: Vec<Affine> = apart.iter().map(|gap| Curve::Whole(2).of(gap, symbols)).collect();
    let variance = total(&squares).times(&share, symbols);
    let within = variance.range;
    let variance = variance.ranged(Interval::new(0.0, within.high.max(0.0)));
    let factor = Curve::Normaliser(norm.epsilon).of(&variance, symbols);
    let each = apart.iter().zip(norm.scale.iter().zip(&norm.shift));
    each.map(|(gap, (&scale, &shift))| {
        let normed = gap.times(&factor, symbols);
        Affine::combination(&[(f64::from(scale), &normed)], f64::from(shift))
    })
    .collect()
}

/// The sum of all.
fn total(all: &[Affine]) -> Affine {
    let terms: Vec<(f64, &Affine)> = all.iter().map(|one| (1.0, one)).collect();
    Affine::combination(&terms, 0.0)
}

/// Each number behind a map.
fn mapped(map: &Rescale, x: &[Affine], symbols: &mut Symbols) -> Vec<Affine> {
    let each = x.iter().enumerate().map(|(i, x)| {
        let number = |value: f32| f64::from(value);
        let apart = Affine::combination(&[(1.0, x)], -number(map.center[i]));
        let moved = Affine::combination(&[(number(map.scale[i]), &apart)], number(map.shift[i]));
        let limits = [map.low[i], map.high[i]].map(|limit| Affine::constant(number(limit)));
        choice::clamp(&moved, [&limits[0], &limits[1]], symbols)
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::Layer;

    /// Networks of two inputs and outputs: every activation hidden and last, with a norm, with maps.
    fn networks() -> Vec<Mlp> {
        let mut random = 0.41_f64;
        let mut numbers = |count: usize, size: f64| -> Vec<f32> {
            let mut next = || {
                random = (random * 997.0 + 0.123).fract();
                (size * (2.0 * random - 1.0)) as f32
            };
            (0..count).map(|_| next()).collect()
        };
        let mut all = Vec::new();
        let other = [Activation::LeakyRelu { slope: 0.2 }, Activation::Elu { alpha: 0.5 }];
        for activation in Activation::ALL.into_iter().chain(other) {
            for normed in [false, true] {
                let mut dense = |inputs: usize, outputs: usize| {
                    Layer::dense(numbers(inputs * outputs, 2.0), numbers(outputs, 0.5))
                        .activated(activation)
                };
                let mut layers = vec![dense(2, 5), dense(5, 4), dense(4, 2)];
                layers[0].norm = normed.then(|| Norm {
                    scale: numbers(5, 1.5),
                    shift: numbers(5, 0.3),
                    epsilon: 1e-3,
                });
                let mlp = Mlp::from_layers(layers).expect("a network");
                let input = Rescale {
                    high: vec![0.9; 2],
                    ..Rescale::affine(vec![1.2, 0.8], vec![0.1, -0.1])
                };
                let output = Rescale {
                    low: vec![-0.4; 2],
                    ..Rescale::affine(vec![-1.5, 2.0], vec![0.2, 0.0])
                };
                let mapped = mlp.clone().with_input(input).and_then(|mlp| mlp.with_output(output));
                all.extend([mlp, mapped.expect("maps")]);
            }
        }
        all
    }

    #[test]
    fn forms_hold_what_networks_say() {
        for mlp in networks() {
            for (width, centers) in [(1e-3, [0.3, -0.7]), (0.1, [-0.2, 0.05]), (1.5, [0.6, 0.4])] {
                let form = |i: usize| {
                    let mut ball = vec![0.0; 2];
                    ball[i] = width;
                    Affine::new(centers[i], ball, Vec::new(), 0.0)
                };
                let forms = network(&mlp, vec![form(0), form(1)], &mut Symbols::default());
                for k in 0..60 {
                    let (sin, cos) = (0.7 * f64::from(k)).sin_cos();
                    let length = f64::from(k % 4) / 3.0;
                    let d = [length * cos, length * sin];
                    let x = [centers[0] + width * d[0], centers[1] + width * d[1]];
                    for (form, truth) in forms.iter().zip(mlp.forward(&x)) {
                        assert!(form.known(), "{mlp:?}");
                        let at =
                            form.center + form.ball.iter().zip(d).map(|(a, d)| a * d).sum::<f64>();
                        let open = form.spread.iter().map(|s| s.abs()).sum::<f64>() + form.rest;
                        assert!(
                            (at - truth).abs() <= open + 1e-12,
                            "{at} and {truth}, {open}: {mlp:?}"
                        );
                        let Interval { low, high } = form.range;
                        assert!(low - 1e-12 <= truth && truth <= high + 1e-12, "{mlp:?}");
                    }
                }
                let narrow = |form: &Affine| form.range.high - form.range.low < 100.0 * width;
                assert!(width > 1e-2 || forms.iter().all(narrow), "{forms:?}: {mlp:?}");
            }
        }
    }
}
