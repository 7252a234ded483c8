//! Random formulas and boxes, and the slopes that sampled pairs of points find.

use rand::RngExt;
use rand::rngs::StdRng;

use super::super::{Domain, Enclosure};
use crate::real::Real;

/// A formula as a tree, evaluated in any instance of `Real`.
#[derive(Debug)]
pub(super) enum Tree {
    Input(usize),
    Number(f32),
    Unary(u32, Box<Tree>),
    Binary(u32, Box<[Tree; 2]>),
    Ternary(u32, Box<[Tree; 3]>),
}

const UNARY: u32 = 29;
const BINARY: u32 = 13;
const TERNARY: u32 = 4;

fn unary<R: Real>(kind: u32, a: R) -> R {
    match kind {
        0 => -a,
        1 => a.abs(),
        2 => (a.abs() + R::lit(0.25)).sqrt(),
        3 => a.sqrt(),
        4 => a.sin(),
        5 => a.cos(),
        6 => a.tanh(),
        7 => (a.abs() + R::lit(0.1)).ln_unit(),
        8 => a.floor(),
        9 => a * a,
        10 => a.if_lt(R::lit(0.0), R::lit(0.0), a),
        11 => R::lit(1.0) / (a * a + R::lit(0.5)),
        _ => function(kind, a),
    }
}

/// Functions, most of them over what lies in their domain.
fn function<R: Real>(kind: u32, a: R) -> R {
    let within_one = |a: R| R::lit(0.9) * a.tanh();
    match kind {
        12 => (R::lit(0.5) * a).tan(),
        13 => within_one(a).asin(),
        14 => within_one(a).acos(),
        15 => a.asin(),
        16 => a.atan(),
        17 => a.exp(),
        18 => (a.abs() + R::lit(0.2)).ln(),
        19 => a.ln(),
        20 => a.sigmoid(),
        21 => a.sign(),
        22 => a.wrap(),
        23 => a.powi(3),
        24 => a.powi(4),
        25 => a.powi(-1),
        26 => (a * a + R::lit(0.5)).powi(-2),
        27 => a.abs().powf(1.5),
        _ => (a.abs() + R::lit(0.3)).powf(-0.7),
    }
}

fn binary<R: Real>(kind: u32, a: R, b: R) -> R {
    match kind {
        0 | 1 => a + b,
        2 => a - b,
        3 => a * b,
        4 => a / b,
        5 => a.min(b),
        6 => a.max(b),
        7 => a.hypot(b),
        8 => a.atan2(b),
        9 => a.atan2(b.abs() + R::lit(0.5)),
        10 => network(a, b, |x| x.if_lt(R::lit(0.0), R::lit(0.0), x)),
        11 => network(a, b, R::tanh),
        _ => a.if_lt(b, a, b),
    }
}

/// A network of two layers with three neurons of an activation.
fn network<R: Real>(a: R, b: R, activation: fn(R) -> R) -> R {
    let weight = [0.8, -1.3, 0.6, 0.9, -0.7, -0.4];
    let hidden = R::dense(&weight, &[0.1, -0.3, 0.2], &[a, b]);
    let hidden: Vec<R> = hidden.into_iter().map(activation).collect();
    R::dense(&[1.1, -0.5, 0.7], &[-0.2], &hidden)[0]
}

fn ternary<R: Real>(kind: u32, a: R, b: R, c: R) -> R {
    match kind {
        0 => a.clamp(R::lit(-0.7), b.abs()) + c,
        1 => a.if_lt(b, c, c + a - b),
        2 => b.if_lt(a, a * c, b),
        _ => a.min(b).min(c),
    }
}

impl Tree {
    pub(super) fn random(rng: &mut StdRng, inputs: usize, depth: u32) -> Self {
        if depth == 0 || rng.random_bool(0.1) {
            return if rng.random_bool(0.8) {
                Self::Input(rng.random_range(0..inputs))
            } else {
                Self::Number(rng.random_range(-2.0..2.0))
            };
        }
        let (choice, kind) = (rng.random_range(0..10), rng.random_range(0..u32::MAX));
        let mut sub = || Self::random(rng, inputs, depth - 1);
        match choice {
            0..4 => Self::Unary(kind % UNARY, Box::new(sub())),
            4..9 => Self::Binary(kind % BINARY, Box::new([sub(), sub()])),
            _ => Self::Ternary(kind % TERNARY, Box::new([sub(), sub(), sub()])),
        }
    }

    pub(super) fn eval<R: Real>(&self, x: &[R]) -> R {
        match self {
            Self::Input(i) => x[*i],
            Self::Number(value) => R::lit(*value),
            Self::Unary(kind, a) => unary(*kind, a.eval(x)),
            Self::Binary(kind, ab) => binary(*kind, ab[0].eval(x), ab[1].eval(x)),
            Self::Ternary(kind, abc) => {
                ternary(*kind, abc[0].eval(x), abc[1].eval(x), abc[2].eval(x))
            }
        }
    }
}

/// A box of random sides, and which of them vary (at least the first).
pub(super) struct Sides {
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
    pub(super) varies: Vec<bool>,
}

impl Sides {
    pub(super) fn random(rng: &mut StdRng, inputs: usize) -> Self {
        let low: Vec<f64> = (0..inputs).map(|_| rng.random_range(-2.0..1.5)).collect();
        let width = |rng: &mut StdRng| [0.1, 1.0, 3.0][rng.random_range(0..3)];
        Self {
            high: low.iter().map(|low| low + width(rng)).collect(),
            varies: (0..inputs).map(|i| i == 0 || rng.random_bool(0.7)).collect(),
            low,
        }
    }

    pub(super) fn cube(inputs: usize, half: f64) -> Self {
        Self { low: vec![-half; inputs], high: vec![half; inputs], varies: vec![true; inputs] }
    }

    pub(super) fn domain(&self) -> Domain<'_> {
        Domain { low: &self.low, high: &self.high, varies: &self.varies }
    }

    fn point(&self, rng: &mut StdRng) -> Vec<f64> {
        let sides = self.low.iter().zip(&self.high);
        sides.map(|(&low, &high)| rng.random_range(low..=high)).collect()
    }

    /// A second point, apart from `x` in varying coordinates only, near or far.
    fn partner(&self, rng: &mut StdRng, x: &[f64]) -> Vec<f64> {
        let share = [1.0, 0.1, 1e-3][rng.random_range(0..3)];
        let far = self.point(rng);
        let toward = |i: usize| x[i] + share * (far[i] - x[i]);
        (0..x.len()).map(|i| if self.varies[i] { toward(i) } else { x[i] }).collect()
    }
}

fn distance(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}

/// Largest slope between sampled pairs; checks values and slopes against the enclosure.
pub(super) fn steepest(
    found: &Enclosure,
    sides: &Sides,
    rng: &mut StdRng,
    formula: impl Fn(&[f64]) -> f64,
    name: &dyn Fn() -> String,
) -> f64 {
    let (value, constant) = (found.value(), found.constant());
    // Evaluation in f64: a hundred roundings of numbers no larger than the values allow, each
    // amplified by at most the constant. The formulas compared here stay below 1e4.
    let rounding = 1e-10 * (1.0 + constant.min(1e4));
    let mut largest = 0.0_f64;
    for _ in 0..60 {
        let x = sides.point(rng);
        let y = sides.partner(rng, &x);
        let (at_x, at_y) = (formula(&x), formula(&y));
        if !at_x.is_finite() || !at_y.is_finite() {
            assert_eq!(constant, f64::INFINITY, "{}: no value at {x:?} or {y:?}", name());
            continue;
        }
        let inside = |v: f64| value.low - rounding <= v && v <= value.high + rounding;
        assert!(inside(at_x), "{}: {at_x} at {x:?} is not in {value:?}", name());
        let (rise, apart) = ((at_x - at_y).abs(), distance(&x, &y));
        if !found.caveats.assumed_continuous {
            assert!(
                rise <= constant * apart + rounding,
                "{}: slope {} above {constant} between {x:?} and {y:?}",
                name(),
                rise / apart
            );
        }
        if apart > 1e-4 {
            largest = largest.max(rise / apart);
        }
    }
    largest
}
