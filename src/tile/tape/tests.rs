//! Tapes against the graphs that they come from, bit by bit.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::{Source, Tape};
use crate::formula::{Expr, Function, Graph, Node, record};
use crate::real::Real;
use crate::real::simd::Instructions;
use crate::tile::{Frame, Layout};

/// Numbers that find what is wrong sooner than most.
const SPECIAL: [f32; 12] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-42,
    -1e38,
    0.5,
    16_777_216.0,
    -2.5,
];

/// The least number that `ln_unit` is for: 2^-24.
const LEAST_UNIFORM: f32 = 1.0 / 16_777_216.0;

/// A number: special, or any between -4 and 4.
fn number(random: &mut StdRng) -> f32 {
    match random.random_range(0..4) {
        0 => SPECIAL[random.random_range(0..SPECIAL.len())],
        _ => random.random_range(-4.0..4.0),
    }
}

/// A graph of up to `size` operations of all kinds.
fn graph(random: &mut StdRng, inputs: usize, size: usize, outputs: usize) -> Graph {
    let mut nodes: Vec<Node> = (0..inputs).map(|i| Node::Input(i as u32)).collect();
    nodes.extend((0..3).map(|_| Node::Literal(number(random).to_bits())));
    for _ in 0..size {
        let node = node(random, nodes.len() as u32);
        nodes.push(node);
    }
    let count = nodes.len() as u32;
    // Now and then an input or a literal as it is, and the same node twice.
    let outputs = (0..outputs).map(|_| random.random_range(0..count)).collect();
    Graph { inputs, nodes, outputs, calls: Vec::new() }
}

/// An operation of earlier nodes, late ones more often.
fn node(random: &mut StdRng, count: u32) -> Node {
    let from = if random.random_range(0..3) == 0 { 0 } else { count.saturating_sub(6) };
    let [a, b, c, d] = std::array::from_fn(|_| random.random_range(from..count));
    match random.random_range(0..26) {
        0 | 1 => Node::Add(a, b),
        2 | 3 => Node::Sub(a, b),
        4 | 5 => Node::Mul(a, b),
        6 => Node::Div(a, b),
        7 => Node::Neg(a),
        8 => Node::Abs(a),
        9 => Node::Sqrt(a),
        10 => Node::Floor(a),
        11 if random.random() => Node::IfLt(a, b, a, b),
        11 => Node::IfLt(a, b, b, a),
        12 => Node::IfLt(a, b, c, d),
        13 => Node::SelectLt(a, b, c, d),
        14 => Node::Min(a, b),
        15 => Node::Max(a, b),
        16 => Node::Clamp(a, b, c),
        17 => Node::Sign(a),
        18 => Node::Hypot(a, b),
        19 => Node::Atan2(a, b),
        20 => Node::Powi(a, random.random_range(-9..=9)),
        21 => Node::Powf(a, number(random).to_bits()),
        _ => {
            // Instruction sets agree on it within its range alone, which has a test of its own.
            let total = Function::ALL.iter().filter(|f| **f != Function::LnUnit);
            let total: Vec<Function> = total.copied().collect();
            Node::Apply(total[random.random_range(0..total.len())], a)
        }
    }
}

/// A graph with the places of its inputs and outputs.
struct Case {
    graph: Graph,
    sources: Vec<Source>,
    outputs: Vec<usize>,
    layout: Layout,
}

impl Case {
    /// A random one.
    fn random(random: &mut StdRng) -> Self {
        let states = random.random_range(1..=64);
        let size = random.random_range(1..=500);
        let mut layout = Layout { states, controls: 2, own: 0 };
        let inputs = states + 4;
        let mut rows: Vec<usize> = (0..layout.rows()).collect();
        let outputs = (0..random.random_range(1..=states))
            .map(|_| rows.swap_remove(random.random_range(0..rows.len())))
            .collect::<Vec<_>>();
        let graph = graph(random, inputs, size, outputs.len());
        let mut sources: Vec<Source> = (0..states).map(Source::Row).collect();
        sources.extend([Source::Row(states), Source::Number(number(random))]);
        sources.extend([Source::Multiple { row: layout.step(), of: 0.1 }]);
        sources.extend([Source::Row(layout.step())]);
        layout.own = Self::tape(&graph, &sources, &outputs, layout).own_rows();
        Self { graph, sources, outputs, layout }
    }

    fn tape(graph: &Graph, sources: &[Source], outputs: &[usize], layout: Layout) -> Tape {
        Tape::new(&[graph], sources, outputs, layout.first_own())
    }

    /// The inputs of one trajectory.
    fn inputs(&self, frame: &Frame, lane: usize) -> Vec<f32> {
        let input = |source: &Source| match *source {
            Source::Row(row) => frame.row(row)[lane],
            Source::Number(number) => number,
            Source::Multiple { row, of } => frame.row(row)[lane] * of,
        };
        self.sources.iter().map(input).collect()
    }

    /// Compares all instruction sets with the graph, for `lanes` trajectories.
    fn check(&self, random: &mut StdRng, lanes: usize) {
        let tape = Self::tape(&self.graph, &self.sources, &self.outputs, self.layout);
        for with in Instructions::detect() {
            let mut frame = Frame::new(self.layout, lanes);
            frame.rows_mut().iter_mut().for_each(|place| *place = number(random));
            let inputs: Vec<_> = (0..lanes).map(|lane| self.inputs(&frame, lane)).collect();
            tape.evaluate(with, &mut frame, lanes);
            for (lane, inputs) in inputs.iter().enumerate() {
                for (row, expected) in self.outputs.iter().zip(self.graph.eval(inputs)) {
                    let got = frame.row(*row)[lane];
                    assert!(
                        same(got, expected),
                        "{}, row {row}, trajectory {lane}: {got}, not {expected}",
                        with.name()
                    );
                }
            }
        }
    }
}

/// Equal bits, or both no number.
fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

#[test]
fn random_graphs() {
    for seed in 0..400 {
        let random = &mut StdRng::seed_from_u64(seed);
        let lanes = random.random_range(1..=67);
        Case::random(random).check(random, lanes);
    }
}

#[test]
fn logarithms_within_their_range() {
    let case = in_place(&[0, 1], |x| {
        let (least, most) = (Expr::lit(LEAST_UNIFORM), Expr::lit(1.0));
        let within = |x: Expr| {
            let raised = least.select_lt(x, x, least);
            raised.select_lt(most, raised, most)
        };
        let size = Expr::lit(0.25) * x[0].abs();
        vec![within(size).ln_unit(), within(size * size * size * size).ln_unit() + x[1]]
    });
    let random = &mut StdRng::seed_from_u64(5);
    (0..50).for_each(|_| case.check(random, 67));
}

/// A formula whose outputs go to the rows `outputs` of its own inputs.
fn in_place(outputs: &[usize], formula: impl FnOnce(&[Expr]) -> Vec<Expr>) -> Case {
    let states = outputs.len();
    let graph = record(states, formula);
    let sources: Vec<Source> = (0..states).map(Source::Row).collect();
    let mut layout = Layout { states, controls: 0, own: 0 };
    layout.own = Case::tape(&graph, &sources, outputs, layout).own_rows();
    Case { graph, sources, outputs: outputs.to_vec(), layout }
}

#[test]
fn states_that_change_places() {
    let random = &mut StdRng::seed_from_u64(1);
    for outputs in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        in_place(&outputs, <[Expr]>::to_vec).check(random, 20);
        let sums = |x: &[Expr]| vec![x[0] + x[1], x[1] + x[2], x[2] + x[0]];
        in_place(&outputs, sums).check(random, 20);
        // The first output is an operand of the others.
        let chain = |x: &[Expr]| {
            let first = x[1] - x[2] * x[0];
            let second = first * x[0] - x[2];
            vec![first, second, (first + second) * x[1]]
        };
        in_place(&outputs, chain).check(random, 20);
    }
}

#[test]
fn an_output_in_two_places_and_none_that_moves() {
    let random = &mut StdRng::seed_from_u64(2);
    in_place(&[1, 0], |x| vec![x[0] * x[1]; 2]).check(random, 16);
    let still = in_place(&[0, 1], <[Expr]>::to_vec);
    let tape = Case::tape(&still.graph, &still.sources, &still.outputs, still.layout);
    assert!(tape.steps.is_empty(), "{tape:?}");
}

#[test]
fn positions_move_where_they_are() {
    // What a plant of positions and velocities costs: one loop for each, nothing copied.
    let case = in_place(&[0, 1], |x| {
        let dt = Expr::lit(0.1);
        vec![x[0] + dt * x[1], x[1] - dt * x[0]]
    });
    let tape = Case::tape(&case.graph, &case.sources, &case.outputs, case.layout);
    assert_eq!((tape.steps.len(), tape.own_rows()), (3, 1), "a circle of two");
    let falling = in_place(&[0, 1], |x| {
        let dt = Expr::lit(0.1);
        vec![x[0] + dt * x[1], x[1] - dt * x[1].abs()]
    });
    let tape = Case::tape(&falling.graph, &falling.sources, &falling.outputs, falling.layout);
    assert_eq!((tape.steps.len(), tape.own_rows()), (3, 1), "{tape:?}");
    falling.check(&mut StdRng::seed_from_u64(3), 33);
}

#[test]
fn what_numbers_make_is_known_before() {
    let case = in_place(&[0], |x| {
        let number = Expr::lit(3.0) * Expr::lit(-0.25).abs();
        vec![x[0] / Expr::lit(4.0) + number]
    });
    let tape = Case::tape(&case.graph, &case.sources, &case.outputs, case.layout);
    assert_eq!(tape.steps.len(), 1, "{tape:?}");
    case.check(&mut StdRng::seed_from_u64(4), 16);
}

#[test]
#[should_panic(expected = "two outputs of a tape to row 1")]
fn a_row_is_written_once() {
    in_place(&[1, 1], <[Expr]>::to_vec);
}
