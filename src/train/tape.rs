//! A recorded graph with a reverse sweep: values forward, derivatives backward, in any [`Real`].

use crate::error::{Error, Result};
use crate::formula::{Graph, Node};
use crate::real::Real;

/// A recorded graph whose constants are folded and whose choices at the top may be soft.
#[derive(Clone, Debug)]
pub struct Tape {
    inputs: usize,
    ops: Vec<Op>,
    outputs: Vec<u32>,
}

/// One operation; operands are indices of earlier ones.
#[derive(Clone, Copy, Debug)]
enum Op {
    /// As recorded.
    Plain(Node),
    /// The smaller of two, or a smooth number below it.
    SoftMin(u32, u32, f32),
    /// The larger of two, or a smooth number above it.
    SoftMax(u32, u32, f32),
}

impl Tape {
    /// The graph as it is, its functions as polynomials.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it calls a network, as formulas from text may.
    pub fn hard(graph: &Graph) -> Result<Self> {
        if let Some(call) = graph.calls.first() {
            let problem = format!(
                "a network of the widths {:?} is called inside of a formula, which has no derivatives in \
                 training; write what it computes as formulas, or let it be the policy",
                call.network.widths()
            );
            return Err(Error::invalid("formula", problem));
        }
        let graph = graph.expanded();
        let ops = folded(&graph.nodes).into_iter().map(Op::Plain).collect();
        Ok(Self { inputs: graph.inputs, ops, outputs: graph.outputs })
    }

    /// The graph with soft choices in place of every minimum and maximum that an output is made
    /// of, also through constant positive factors and constant summands. Others stay hard: those
    /// inside of a term, and clips.
    ///
    /// At temperature `tau`, `min(a, b)` becomes `-tau ln(exp(-a / tau) + exp(-b / tau))`, where
    /// the temperature is that of the output: below a factor k it is `tau / k`.
    ///
    /// # Errors
    /// As [`Tape::hard`].
    pub fn soft(graph: &Graph) -> Result<Self> {
        let mut tape = Self::hard(graph)?;
        let mut factors: Vec<Option<f32>> = vec![None; tape.ops.len()];
        for &output in &tape.outputs {
            factors[output as usize] = Some(1.0);
        }
        for i in (0..tape.ops.len()).rev() {
            if let (Some(factor), Op::Plain(node)) = (factors[i], tape.ops[i]) {
                tape.soften(i, node, factor, &mut factors);
            }
        }
        Ok(tape)
    }

    /// Makes operation `i`, which stands below the constant `factor`, soft if it is a choice, and
    /// notes the factors of its operands.
    fn soften(&mut self, i: usize, node: Node, factor: f32, factors: &mut [Option<f32>]) {
        let constant = |operand: u32| match self.ops[operand as usize] {
            Op::Plain(Node::Literal(bits)) => Some(f32::from_bits(bits)),
            _ => None,
        };
        let choice = match node {
            Node::Min(a, b) => Some((a, b, Op::SoftMin(a, b, factor))),
            Node::IfLt(a, b, yes, no) if (a, b) == (yes, no) => {
                Some((a, b, Op::SoftMin(a, b, factor)))
            }
            Node::Max(b, a) => Some((a, b, Op::SoftMax(a, b, factor))),
            Node::IfLt(a, b, yes, no) if (a, b) == (no, yes) => {
                Some((a, b, Op::SoftMax(a, b, factor)))
            }
            _ => None,
        };
        if let Some((a, b, soft)) = choice {
            self.ops[i] = soft;
            (factors[a as usize], factors[b as usize]) = (Some(factor), Some(factor));
            return;
        }
        match node {
            Node::Mul(a, b) => match (constant(a), constant(b)) {
                (Some(k), None) if k > 0.0 => factors[b as usize] = Some(factor * k),
                (None, Some(k)) if k > 0.0 => factors[a as usize] = Some(factor * k),
                _ => {}
            },
            Node::Add(a, b) if constant(a).is_some() => factors[b as usize] = Some(factor),
            Node::Add(a, b) | Node::Sub(a, b) if constant(b).is_some() => {
                factors[a as usize] = Some(factor);
            }
            _ => {}
        }
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// The value of every operation for `inputs`, written to `values`.
    #[inline(always)]
    pub fn forward<R: Real>(&self, inputs: &[R], temperature: f32, values: &mut Vec<R>) {
        values.clear();
        values.reserve(self.ops.len());
        for op in &self.ops {
            let at = |i: u32| values[i as usize];
            let value = match *op {
                Op::SoftMin(a, b, factor) => soft_min(at(a), at(b), temperature / factor),
                Op::SoftMax(a, b, factor) => -soft_min(-at(a), -at(b), temperature / factor),
                Op::Plain(node) => node.value(inputs, values),
            };
            values.push(value);
        }
    }

    /// The outputs among the `values` of a forward sweep.
    pub fn read<'a, R: Real>(&'a self, values: &'a [R]) -> impl Iterator<Item = R> + 'a {
        self.outputs.iter().map(|&output| values[output as usize])
    }

    /// The derivative of `sum of seeds * outputs` by each input, written to `slopes`, from the
    /// `values` of a forward sweep at the same temperature; `adjoints` is working memory.
    ///
    /// A branch has the derivative of the side taken; `|x|` at 0 has 1, the root at 0 and a sign none.
    #[inline(always)]
    pub fn backward<R: Real>(
        &self,
        values: &[R],
        seeds: &[R],
        temperature: f32,
        adjoints: &mut Vec<R>,
        slopes: &mut [R],
    ) {
        let zero = R::lit(0.0);
        adjoints.clear();
        adjoints.resize(self.ops.len(), zero);
        slopes.fill(zero);
        for (&output, &seed) in self.outputs.iter().zip(seeds) {
            adjoints[output as usize] = adjoints[output as usize] + seed;
        }
        for (i, op) in self.ops.iter().enumerate().rev() {
            let (slope, value) = (adjoints[i], values[i]);
            let at = |i: u32| values[i as usize];
            let mut add = |i: u32, slope: R| adjoints[i as usize] = adjoints[i as usize] + slope;
            match *op {
                Op::SoftMin(a, b, factor) => {
                    let tau = R::lit(factor / temperature);
                    add(a, slope * ((value - at(a)) * tau).exp_negative());
                    add(b, slope * ((value - at(b)) * tau).exp_negative());
                }
                Op::SoftMax(a, b, factor) => {
                    let tau = R::lit(factor / temperature);
                    add(a, slope * ((at(a) - value) * tau).exp_negative());
                    add(b, slope * ((at(b) - value) * tau).exp_negative());
                }
                Op::Plain(node) => match node {
                    Node::Input(i) => slopes[i as usize] = slopes[i as usize] + slope,
                    Node::Literal(_) | Node::Floor(_) | Node::Sign(_) => {}
                    Node::Add(a, b) => {
                        add(a, slope);
                        add(b, slope);
                    }
                    Node::Sub(a, b) => {
                        add(a, slope);
                        add(b, -slope);
                    }
                    Node::Mul(a, b) => {
                        add(a, slope * at(b));
                        add(b, slope * at(a));
                    }
                    Node::Div(a, b) => {
                        add(a, slope / at(b));
                        add(b, -(slope * value / at(b)));
                    }
                    Node::Neg(a) => add(a, -slope),
                    Node::Abs(a) => add(a, at(a).select_lt(zero, -slope, slope)),
                    Node::Sqrt(a) => {
                        let half = R::lit(0.5) * slope / value;
                        add(a, zero.select_lt(value, half, zero));
                    }
                    Node::Min(a, b) => {
                        add(a, at(a).select_lt(at(b), slope, zero));
                        add(b, at(a).select_lt(at(b), zero, slope));
                    }
                    Node::Max(a, b) => {
                        add(a, at(b).select_lt(at(a), slope, zero));
                        add(b, at(b).select_lt(at(a), zero, slope));
                    }
                    Node::Clamp(a, low, high) => {
                        let floored = at(a).select_lt(at(low), at(low), at(a));
                        let below = at(high).select_lt(floored, zero, slope);
                        add(high, at(high).select_lt(floored, slope, zero));
                        add(low, at(a).select_lt(at(low), below, zero));
                        add(a, at(a).select_lt(at(low), zero, below));
                    }
                    Node::IfLt(a, b, yes, no) | Node::SelectLt(a, b, yes, no) => {
                        add(yes, at(a).select_lt(at(b), slope, zero));
                        add(no, at(a).select_lt(at(b), zero, slope));
                    }
                    other => unreachable!("an expanded graph has no {other:?}"),
                },
            }
        }
    }
}

/// `-tau ln(exp(-a / tau) + exp(-b / tau))`, at most the smaller of both.
#[inline(always)]
fn soft_min<R: Real>(a: R, b: R, tau: f32) -> R {
    let one = R::lit(1.0);
    let apart = -((a - b).abs() * R::lit(1.0 / tau));
    // The logarithm is that of a number in [1/2, 1].
    a.min(b) + R::lit(tau) * (one / (one + apart.exp_negative())).ln_unit()
}

/// The nodes with literals in place of operations on literals, in f32 as the engine has them.
fn folded(nodes: &[Node]) -> Vec<Node> {
    let mut folded: Vec<Node> = Vec::with_capacity(nodes.len());
    for &node in nodes {
        let literal = |i: u32| match folded[i as usize] {
            Node::Literal(bits) => Some(f32::from_bits(bits)),
            _ => None,
        };
        let constant = match node {
            Node::Add(a, b) => literal(a).zip(literal(b)).map(|(a, b)| a + b),
            Node::Sub(a, b) => literal(a).zip(literal(b)).map(|(a, b)| a - b),
            Node::Mul(a, b) => literal(a).zip(literal(b)).map(|(a, b)| a * b),
            Node::Div(a, b) => literal(a).zip(literal(b)).map(|(a, b)| a / b),
            Node::Neg(a) => literal(a).map(|a| -a),
            _ => None,
        };
        folded.push(constant.map_or(node, |value| Node::Literal(value.to_bits())));
    }
    folded
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::Tape;
    use crate::error::Error;
    use crate::formula::{Expr, Graph, Scalar, record};
    use crate::policy::{Activation, Layer, Mlp, OutputActivation};
    use crate::real::{Lanes, Real};

    /// The output of the tape, and its slopes.
    fn slopes<R: Real>(tape: &Tape, x: &[R], tau: f32) -> (R, Vec<R>) {
        let (mut values, mut adjoints) = (Vec::new(), Vec::new());
        let mut slopes = vec![R::lit(0.0); x.len()];
        tape.forward(x, tau, &mut values);
        tape.backward(&values, &[R::lit(1.0)], tau, &mut adjoints, &mut slopes);
        (tape.read(&values).next().expect("one output"), slopes)
    }

    /// Every operation, with kinks away from the points below.
    fn formula() -> Graph {
        record(3, |x| {
            let [a, b, c] = [x[0], x[1], x[2]];
            let kinked = a.min(b * c).max(c - a.abs()) + (a * a + b * b).sqrt() / (c + b);
            let wavy = (a * b).sin() + (-(a * a)).exp_negative() - c.tanh().clamp(b, a);
            vec![kinked * wavy - a.floor()]
        })
    }

    #[test]
    fn networks_in_formulas_are_refused() {
        let layer = Layer { weight: vec![1.0, 2.0], bias: vec![0.0], inputs: 2, outputs: 1 };
        let network = Mlp::new(vec![layer], Activation::Relu, OutputActivation::Identity);
        let network = Arc::new(network.expect("a network"));
        let graph = record(2, |x| vec![x[0] + Expr::call(&network, x)[0]]);
        for refused in [Tape::hard(&graph), Tape::soft(&graph)] {
            let refused = refused.expect_err("no derivatives");
            assert!(matches!(refused, Error::Invalid { .. }), "{refused}");
            let refused = refused.to_string();
            assert!(refused.contains("[2, 1]") && refused.contains("let it be the policy"));
        }
    }

    #[test]
    fn slopes_are_central_differences() {
        let tape = Tape::hard(&formula()).expect("no network");
        for x in [[0.7_f64, 0.3, 1.9], [-1.3, 0.8, 0.4], [2.2, -0.6, 1.5]] {
            let (_, found) = slopes(&tape, &x, 1.0);
            for i in 0..3 {
                let moved = |step: f64| {
                    let mut x = x;
                    x[i] += step;
                    formula().expanded().eval(&x)[0]
                };
                let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                let error = (found[i] - expected).abs();
                assert!(error < 1e-6 * (1.0 + expected.abs()), "{x:?} {i}: {found:?} {expected}");
            }
        }
    }

    /// Every function, away from jumps and ends of domains.
    fn functions() -> Graph {
        record(3, |x| {
            let [a, b, c] = [x[0], x[1], x[2]];
            let positive = c * c + Expr::lit(0.1);
            let angles = a.tan() + (Expr::lit(0.4) * b).asin() * (Expr::lit(0.3) * a).acos();
            let turned = a.atan() + b.atan2(c) * (-a).atan2(b) + (Expr::lit(3.0) * a).wrap();
            let grown = (a * b).exp() + positive.ln() + a.sigmoid();
            let powers = c.powi(3) + positive.powi(-2) + positive.powf(1.3) + a.hypot(c);
            vec![angles * turned + grown * powers + a.sign() * b]
        })
    }

    /// The polynomials have the slopes of the functions that they stand for.
    #[test]
    fn functions_have_their_slopes() {
        let tape = Tape::hard(&functions()).expect("no network");
        for x in [[0.7_f64, 0.3, 1.9], [-1.3, 0.8, 0.4], [1.2, -0.6, -1.5]] {
            let (_, found) = slopes(&tape, &x, 1.0);
            for i in 0..3 {
                let moved = |step: f64| {
                    let mut x = x;
                    x[i] += step;
                    functions().eval(&x)[0]
                };
                let expected = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                let error = (found[i] - expected).abs();
                assert!(error < 1e-5 * (1.0 + expected.abs()), "{x:?} {i}: {found:?} {expected}");
            }
        }
    }

    /// `log-sum-exp` of the terms, wherever factors and summands stand.
    #[test]
    fn choices_at_the_top_are_soft_and_others_are_not() {
        let graph = record(3, |x| {
            let inner = x[2] - x[0].max(x[1]);
            let terms = Expr::lit(2.0) * (x[0].min(x[1]) - Expr::lit(0.5));
            vec![Expr::lit(2.0) * (Expr::lit(3.0) * terms.min(inner)).max(x[2])]
        });
        let tape = Tape::soft(&graph).expect("no network");
        let (x, tau) = ([0.3_f64, 0.45, 0.8], 0.6);
        let (found, slope) = slopes(&tape, &x, 0.6);
        let terms = [12.0 * (x[0] - 0.5), 12.0 * (x[1] - 0.5), 6.0 * (x[2] - x[1])];
        let sum: f64 = terms.iter().map(|term| (-term / tau).exp()).sum();
        let expected = tau * ((-tau * sum.ln() / tau).exp() + (2.0 * x[2] / tau).exp()).ln();
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        // The maximum inside of a term is hard: x[0] moves the output through its own term alone.
        let share = (-tau * sum.ln() / tau - expected / tau).exp();
        let weight = share * (-terms[0] / tau).exp() / sum;
        assert!((slope[0] - 12.0 * weight).abs() < 1e-6, "{} {weight}", slope[0]);
    }

    #[test]
    fn lanes_agree_with_f64_and_kinks_stay_finite() {
        let tape = Tape::soft(&formula()).expect("no network");
        let points = [[0.7_f32, 0.3, 1.9], [-1.3, 0.8, 0.4], [2.2, -0.6, 1.5], [0.0, 0.0, 1.0]];
        let lanes: [Lanes<4>; 3] = std::array::from_fn(|i| Lanes(points.map(|point| point[i])));
        let (_, found) = slopes(&tape, &lanes, 0.3);
        for (lane, point) in points.iter().enumerate() {
            let (_, exact) = slopes(&tape, &point.map(f64::from), 0.3);
            for i in 0..3 {
                let error = (f64::from(found[i].0[lane]) - exact[i]).abs();
                assert!(error < 2e-5 * (1.0 + exact[i].abs()), "{point:?} {i}: {error}");
            }
        }
    }
}
