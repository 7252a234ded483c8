//! Whole graphs, expanded ones and lanes against plain f32, bit by bit; what is printed of them.

use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::{Expr, Function, Graph, Node, record, wgsl};
use crate::real::bound::{Bound, Domain, enclose};
use crate::real::{Lanes, Real};

/// Numbers that functions treat differently: zeros, ends of domains, numbers next to those, overflow.
const SPECIAL: [f32; 27] = [
    0.0,
    -0.0,
    1e-45,
    -1e-40,
    f32::MIN_POSITIVE,
    2.5e-8,
    0.3,
    -0.5,
    0.75,
    1.0,
    -1.0,
    1.000_000_1,
    1.570_796_4,
    std::f32::consts::PI,
    -std::f32::consts::PI,
    -7.5,
    88.8,
    -87.4,
    -104.5,
    8192.0,
    -7.9e6,
    1e30,
    f32::MAX,
    f32::MIN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

/// Operations ahead of the elementary functions in [`operations`], and after them.
const AHEAD: usize = 17;
const AFTER: usize = 6;

/// Every operation of `a`, `b` and `c`.
fn operations<R: Real>([a, b, c]: [R; 3]) -> Vec<R> {
    let mut all = vec![
        a.min(b),
        a.max(b),
        a.clamp(b, c),
        a.if_lt(b, R::lit(1.0), R::lit(2.0)),
        a.if_le(b, R::lit(1.0), R::lit(2.0)),
        a.if_eq(b, R::lit(1.0), R::lit(2.0)),
        a.hypot(b),
        a.atan2(b),
        a.powi(3),
        a.powi(-4),
        a.powi(0),
        a.powf(0.5),
        a.powf(-1.7),
        a.abs(),
        a.sign(),
        a.floor(),
        a.sqrt(),
    ];
    all.extend(Function::ALL.map(|function| function.apply(a)));
    all.extend([a + b, a - b, a * b, a / b, -a, a.select_lt(b, c, a)]);
    all
}

/// Every triple of special numbers.
fn triples() -> impl Iterator<Item = [f32; 3]> {
    let pairs = SPECIAL.iter().flat_map(|a| SPECIAL.iter().map(move |b| [*a, *b]));
    pairs.flat_map(|[a, b]| SPECIAL.iter().map(move |c| [a, b, *c]))
}

fn graph() -> Graph {
    record(3, |x| operations([x[0], x[1], x[2]]))
}

fn same(found: f32, expected: f32) -> bool {
    found.to_bits() == expected.to_bits() || (found.is_nan() && expected.is_nan())
}

#[test]
fn every_replay_has_the_bits_of_f32() {
    let (whole, expanded) = (graph(), graph().expanded());
    assert!(expanded.nodes.len() > 3 * whole.nodes.len());
    for triple in triples() {
        let expected = operations(triple);
        let replayed = [whole.eval(&triple), expanded.eval(&triple)];
        let lanes = operations(triple.map(|x| Lanes([1.0, x])));
        for (i, expected) in expected.into_iter().enumerate() {
            for found in [replayed[0][i], replayed[1][i], lanes[i].0[1]] {
                assert!(same(found, expected), "{i} of {triple:?}: {found} {expected}");
            }
        }
    }
}

/// Of a NaN among the operands that a result depends on, in f32 and in f64; `exp_negative` alone has 0.
#[test]
fn a_nan_never_disappears() {
    let dropping = Function::ALL.iter().position(|function| *function == Function::ExpNegative);
    let dropping = AHEAD + dropping.expect("one of all");
    for triple in triples().filter(|triple| triple.iter().any(|x| x.is_nan())) {
        let (values, wide) = (operations(triple), operations(triple.map(f64::from)));
        for i in (0..values.len() - AFTER).filter(|i| *i != dropping) {
            let operands = match i {
                2 => 3,
                0..8 => 2,
                _ => 1,
            };
            if triple[..operands].iter().any(|x| x.is_nan()) {
                assert!(values[i].is_nan() && wide[i].is_nan(), "{i} of {triple:?}");
            }
        }
        assert!(!triple[0].is_nan() || values[dropping] == 0.0);
    }
}

/// Functions stay whole where they are recorded; nothing but primitives is left where they are expanded.
#[test]
fn functions_are_nodes() {
    let graph = record(2, |x| vec![x[0].sin() * x[0].cos(), x[0].atan2(x[1]).powf(1.5)]);
    let expected = [
        Node::Input(0),
        Node::Input(1),
        Node::Apply(Function::Sin, 0),
        Node::Apply(Function::Cos, 0),
        Node::Mul(2, 3),
        Node::Atan2(0, 1),
        Node::Powf(5, 1.5_f32.to_bits()),
    ];
    assert_eq!(graph.nodes, expected);
    let whole = |node: &Node| {
        use Node::{Apply, Atan2, Hypot, Powf, Powi};
        matches!(node, Apply(..) | Hypot(..) | Atan2(..) | Powi(..) | Powf(..))
    };
    let expanded = self::graph().expanded();
    assert!(!expanded.nodes.iter().any(whole));
    assert_eq!(expanded.expanded(), expanded);
}

/// Everything printed is valid, with literals that WGSL has no words for.
#[test]
fn printed_functions_are_valid() {
    let literals = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MAX, 1e-45];
    let odd = record(1, |x| literals.map(|literal| x[0].min(Expr::lit(literal))).to_vec());
    let outputs = odd.outputs.len();
    let text = [
        wgsl::CHOICES.to_owned(),
        wgsl::function("odd", &[("x", 1)], &odd),
        wgsl::function("all", &[("x", 3)], &graph()),
    ]
    .concat();
    assert!(text.contains("var b1 = 2139095040u;\n    let v1 = bitcast<f32>(b1);"), "{text}");
    let module = naga::front::wgsl::parse_str(&text)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    validator.validate(&module).unwrap_or_else(|error| panic!("{error:?}"));
    assert_eq!(outputs, 5);
}

/// What is known of no end: no panic, and ends that are numbers or infinite.
#[test]
fn functions_of_unbounded_intervals_have_ends() {
    let ends = [f64::NEG_INFINITY, -1e300, -2.0, -0.0, 0.0, 0.5, 1.0, 1e300, f64::INFINITY];
    let pairs = ends.iter().flat_map(|low| ends.iter().map(move |high| (*low, *high)));
    for (low, high) in pairs.filter(|(low, high)| low <= high && *low < 1e301 && *high > -1e301) {
        let domain = Domain { low: &[low, low], high: &[high, high], varies: &[true, true] };
        let outputs = enclose(domain, |x| {
            let mut all: Vec<Bound> = Function::ALL.map(|function| function.apply(x[0])).to_vec();
            let powers = [-3, -2, -1, 0, 1, 2, 3, i32::MAX, i32::MIN];
            all.extend(powers.map(|exponent| x[0].powi(exponent)));
            let powers = [-1.5, -1e-30, 0.5, 0.3, 1.7, 1e30, f32::NAN, f32::INFINITY];
            all.extend(powers.map(|exponent| x[0].powf(exponent)));
            all.extend([x[0].sign(), x[0].atan2(x[1]), x[0].hypot(x[1]), x[0].abs().sqrt()]);
            all
        });
        for (number, output) in outputs.iter().enumerate() {
            for piece in &output.pieces {
                let sides = piece.gradient.iter().chain([&piece.value]);
                for side in sides {
                    let sound = side.low <= side.high && side.low < f64::INFINITY;
                    let sound = sound && side.high > f64::NEG_INFINITY;
                    assert!(sound, "{number} over {low}..{high}: {output:?}");
                }
            }
        }
    }
}
