//! Random expressions against sampled slopes, and cases whose constant is known.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::{Bound, Domain, Enclosure, Lipschitz, enclose, lipschitz};
use crate::real::Real;

/// A formula as a tree, evaluated in any instance of `Real`.
#[derive(Debug)]
enum Tree {
    Input(usize),
    Number(f32),
    Unary(u32, Box<Tree>),
    Binary(u32, Box<[Tree; 2]>),
    Ternary(u32, Box<[Tree; 3]>),
}

const UNARY: u32 = 12;
const BINARY: u32 = 9;
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
        _ => R::lit(1.0) / (a * a + R::lit(0.5)),
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
        _ => a.if_lt(b, a, b),
    }
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
    fn random(rng: &mut StdRng, inputs: usize, depth: u32) -> Self {
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

    fn eval<R: Real>(&self, x: &[R]) -> R {
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
struct Sides {
    low: Vec<f64>,
    high: Vec<f64>,
    varies: Vec<bool>,
}

impl Sides {
    fn random(rng: &mut StdRng, inputs: usize) -> Self {
        let low: Vec<f64> = (0..inputs).map(|_| rng.random_range(-2.0..1.5)).collect();
        let width = |rng: &mut StdRng| [0.1, 1.0, 3.0][rng.random_range(0..3)];
        Self {
            high: low.iter().map(|low| low + width(rng)).collect(),
            varies: (0..inputs)
                .map(|i| i == 0 || rng.random_bool(0.7))
                .collect(),
            low,
        }
    }

    fn cube(inputs: usize, half: f64) -> Self {
        Self {
            low: vec![-half; inputs],
            high: vec![half; inputs],
            varies: vec![true; inputs],
        }
    }

    fn domain(&self) -> Domain<'_> {
        Domain {
            low: &self.low,
            high: &self.high,
            varies: &self.varies,
        }
    }

    fn point(&self, rng: &mut StdRng) -> Vec<f64> {
        let sides = self.low.iter().zip(&self.high);
        sides
            .map(|(&low, &high)| rng.random_range(low..=high))
            .collect()
    }

    /// A second point, apart from `x` in varying coordinates only, near or far.
    fn partner(&self, rng: &mut StdRng, x: &[f64]) -> Vec<f64> {
        let share = [1.0, 0.1, 1e-3][rng.random_range(0..3)];
        let far = self.point(rng);
        let toward = |i: usize| x[i] + share * (far[i] - x[i]);
        (0..x.len())
            .map(|i| if self.varies[i] { toward(i) } else { x[i] })
            .collect()
    }
}

fn distance(x: &[f64], y: &[f64]) -> f64 {
    x.iter()
        .zip(y)
        .map(|(x, y)| (x - y).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Largest slope between sampled pairs; checks values and slopes against the enclosure.
fn steepest(
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
            assert_eq!(
                constant,
                f64::INFINITY,
                "{}: no value at {x:?} or {y:?}",
                name()
            );
            continue;
        }
        let inside = |v: f64| value.low - rounding <= v && v <= value.high + rounding;
        assert!(
            inside(at_x),
            "{}: {at_x} at {x:?} is not in {value:?}",
            name()
        );
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

/// Soundness on random formulas, and that the bounds say something: most are finite, and of
/// those most are within a factor of the sampled slope.
#[test]
fn random_expressions_stay_within_their_bounds() {
    let mut rng = StdRng::seed_from_u64(7);
    let [mut finite, mut flat, mut close, mut assumed] = [0; 4];
    let count = 4000;
    for number in 0..count {
        let inputs = rng.random_range(1..=3);
        let depth = rng.random_range(1..=4);
        let tree = Tree::random(&mut rng, inputs, depth);
        let sides = Sides::random(&mut rng, inputs);
        let found = enclose(sides.domain(), |x| vec![tree.eval(x)]).remove(0);
        if found.value().magnitude() > 1e4 && found.constant().is_finite() {
            continue;
        }
        let name = || format!("formula {number} {tree:?}");
        let slope = steepest(&found, &sides, &mut rng, |x| tree.eval(x), &name);
        finite += u32::from(found.constant().is_finite());
        flat += u32::from(found.constant() == 0.0);
        close += u32::from(found.constant() > 0.0 && found.constant() <= 3.0 * slope);
        assumed += u32::from(found.caveats.assumed_continuous);
    }
    println!("{finite} finite, {flat} flat, {close} close, {assumed} assumed of {count}");
    assert!(finite > count / 2 && assumed > 20 && flat < finite / 4);
    assert!(2 * close > finite - flat, "{close} of {finite} are close");
}

fn constant(sides: &Sides, formula: impl FnOnce(&[Bound]) -> Bound) -> Lipschitz {
    lipschitz(sides.domain(), formula)
}

/// In direction `t` the function has slope 2, which needs the arc that holds `t`.
#[test]
fn every_arc_of_hypot_is_needed() {
    let sides = Sides::cube(2, 1.0);
    for k in 0..512 {
        let angle = std::f32::consts::TAU * k as f32 / 512.0;
        let found = constant(&sides, |x| {
            x[0].hypot(x[1]) + x[0] * Real::lit(angle.cos()) + x[1] * Real::lit(angle.sin())
        });
        // The f32 direction is a unit vector up to 1e-7.
        let slope = 1.0 + f64::hypot(f64::from(angle.cos()), f64::from(angle.sin()));
        assert!(
            found.constant >= slope - 1e-15,
            "{angle}: {}",
            found.constant
        );
        assert!(
            found.constant <= 1.0013 * slope,
            "{angle}: {}",
            found.constant
        );
        assert_eq!(found.pieces, 64);
    }
}

/// Each side of a minimum alone has the largest slope somewhere.
#[test]
fn every_piece_counts() {
    let sides = Sides::cube(2, 1.0);
    for steep in 0..4 {
        let found = constant(&sides, |x| {
            let slope = |i: usize| Bound::lit(if i == steep { 3.0 } else { 1.0 });
            let low = (x[0] * slope(0)).min(x[1] * slope(1));
            let high = (x[0] * slope(2)).max(x[1] * slope(3)) - Bound::lit(0.5);
            low.max(high.abs())
        });
        assert!(
            found.constant >= 3.0 && found.constant < 3.0 + 1e-14,
            "{found:?}"
        );
    }
    assert_eq!(constant(&sides, |x| x[0].abs()).pieces, 2);
    assert_eq!(
        constant(&sides, |x| x[0].max(Bound::lit(0.0)).sqrt()).constant,
        f64::INFINITY
    );
}

#[test]
fn decided_branches_leave_one_piece() {
    let sides = Sides::cube(2, 1.0);
    let found = constant(&sides, |x| {
        let far = x[0] * Bound::lit(100.0) + Bound::lit(200.0);
        let wild = Bound::lit(1.0) / x[1];
        let low = x[0].if_lt(Bound::lit(2.0), x[1], wild);
        far.min(low)
            .max(far - Bound::lit(400.0))
            .clamp(Bound::lit(-9.0), Bound::lit(9.0))
    });
    assert_eq!(
        found,
        Lipschitz {
            constant: 1.0_f64.next_up(),
            pieces: 1,
            hulled: false,
            assumed_continuous: false,
        }
    );
}

#[test]
fn jumps_and_lost_domains_have_no_constant() {
    let sides = Sides::cube(2, 1.0);
    let infinite = |formula: fn(&[Bound]) -> Bound| {
        assert_eq!(constant(&sides, formula).constant, f64::INFINITY);
    };
    infinite(|x| x[0].if_lt(x[1], Bound::lit(1.0), Bound::lit(-1.0)));
    // The jump of a condition, a jump that is clipped, and one that a product hides.
    infinite(|x| x[0].floor().if_lt(Bound::lit(0.0), x[1], x[0]));
    infinite(|x| {
        let step = x[0].if_lt(x[1], Bound::lit(1.0), Bound::lit(-1.0));
        step.clamp(Bound::lit(-0.1), Bound::lit(0.1)) * x[0]
    });
    infinite(|x| x[0].floor());
    infinite(|x| x[0].sqrt());
    infinite(|x| (x[0] / x[1]).tanh());
    infinite(|x| x[0].ln_unit().min(Bound::lit(3.0)));
    infinite(|x| x[0] + Bound::lit(f32::NAN));
    // What does not touch a varying coordinate does not jump along it.
    let across = Sides {
        varies: vec![false, true],
        ..Sides::cube(2, 1.0)
    };
    let found = constant(&across, |x| {
        x[0].if_lt(Bound::lit(0.0), Bound::lit(1.0), -x[1]) + x[0].floor()
    });
    assert!(
        found.constant == 1.0_f64.next_up() && !found.assumed_continuous,
        "{found:?}"
    );
    // Sides that meet are taken to be continuous, and this is said.
    let bent = constant(&sides, |x| {
        x[0].if_lt(Bound::lit(0.0), x[0] * Bound::lit(0.5), x[0])
    });
    assert!(bent.assumed_continuous && bent.constant == 1.0_f64.next_up());
    assert!(!constant(&sides, |x| x[0].if_lt(x[1], x[1], x[0])).assumed_continuous);
    assert!(!constant(&sides, |x| x[0].if_lt(x[1], x[0], x[0])).assumed_continuous);
}

/// Sums of many distances pass the limit; the hulls must still hold every slope.
#[test]
fn hulls_past_the_limit_are_said_and_sound() {
    let mut rng = StdRng::seed_from_u64(3);
    let sides = Sides::cube(3, 1.0);
    fn formula<R: Real>(x: &[R]) -> R {
        let around = x[0].hypot(x[1]) + x[1].hypot(x[2] + R::lit(0.5));
        let folded = (0..11).fold(x[2], |sum, i| {
            sum + (x[i % 3] - R::lit(0.05 * i as f32)).abs()
        });
        (around * folded).min(around + folded * x[0])
    }
    let found = enclose(sides.domain(), |x| vec![formula(x)]).remove(0);
    assert!(found.caveats.hulled && found.constant().is_finite());
    assert!(found.pieces.len() <= super::pieces::LIMIT);
    let name = || "sum of distances".to_owned();
    let slope = (0..300).map(|_| steepest(&found, &sides, &mut rng, formula, &name));
    let slope = slope.fold(0.0, f64::max);
    assert!(
        slope > 10.0 && slope <= found.constant(),
        "{slope} of {}",
        found.constant()
    );
    let small = constant(&sides, |x| x[0].hypot(x[1]) + x[2].abs());
    assert!(!small.hulled && small.pieces == 128);
}

/// Partial derivatives of smooth functions over a point are their values there.
#[test]
fn gradients_over_a_point_are_derivatives() {
    let at = [0.3, 0.7];
    let domain = Domain {
        low: &at,
        high: &at,
        varies: &[true, true],
    };
    let outputs = enclose(domain, |x| {
        vec![
            x[0].sin(),
            x[0].cos(),
            x[0].tanh(),
            x[1].ln_unit(),
            x[1].sqrt(),
            x[0] / x[1],
            x[0] * x[1],
        ]
    });
    let (x, y): (f64, f64) = (0.3, 0.7);
    let expected = [
        [x.cos(), 0.0],
        [-x.sin(), 0.0],
        [1.0 - x.tanh().powi(2), 0.0],
        [0.0, 1.0 / y],
        [0.0, 0.5 / y.sqrt()],
        [1.0 / y, -x / y / y],
        [y, x],
    ];
    for (output, expected) in outputs.iter().zip(expected) {
        let [piece] = &output.pieces[..] else {
            panic!("a smooth function has one piece");
        };
        for (side, expected) in piece.gradient.iter().zip(expected) {
            assert!(
                side.contains(expected) && side.high - side.low < 1e-14,
                "{side:?} {expected}"
            );
        }
    }
}

/// A formula that bounds another in passing does not disturb it.
#[test]
fn evaluations_nest() {
    let sides = Sides::cube(2, 1.0);
    let found = constant(&sides, |x| {
        let inner = constant(&Sides::cube(5, 2.0), |y| y[4] * Bound::lit(3.0));
        assert!(inner.constant < 3.0 + 1e-14);
        x[0] * Bound::lit(4.0)
    });
    assert!(found.constant >= 4.0 && found.constant < 4.0 + 1e-14);
}
