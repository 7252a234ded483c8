//! Random formulas against sampled slopes, and cases whose constant is known.

mod sampling;

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use self::sampling::{Sides, Tree, steepest};
use super::pieces::LIMIT;
use super::{Bound, Domain, Lipschitz, enclose, lipschitz};
use crate::real::Real;

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
        assert!(found.constant >= slope - 1e-15, "{angle}: {}", found.constant);
        assert!(found.constant <= 1.0013 * slope, "{angle}: {}", found.constant);
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
        assert!(found.constant >= 3.0 && found.constant < 3.0 + 1e-14, "{found:?}");
    }
    assert_eq!(constant(&sides, |x| x[0].abs()).pieces, 2);
    assert_eq!(constant(&sides, |x| x[0].max(Bound::lit(0.0)).sqrt()).constant, f64::INFINITY);
}

#[test]
fn decided_branches_leave_one_piece() {
    let sides = Sides::cube(2, 1.0);
    let found = constant(&sides, |x| {
        let far = x[0] * Bound::lit(100.0) + Bound::lit(200.0);
        let wild = Bound::lit(1.0) / x[1];
        let low = x[0].if_lt(Bound::lit(2.0), x[1], wild);
        far.min(low).max(far - Bound::lit(400.0)).clamp(Bound::lit(-9.0), Bound::lit(9.0))
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
    infinite(|x| x[0].sign());
    infinite(|x| (Bound::lit(4.0) * x[0]).wrap());
    infinite(|x| x[0].atan2(x[1]));
    infinite(|x| x[0].atan2(x[1] - Bound::lit(2.0)));
    infinite(|x| (Bound::lit(2.0) * x[0]).tan());
    infinite(|x| (Bound::lit(1.1) * x[0]).asin());
    infinite(|x| x[0].acos());
    infinite(|x| x[0].powi(-1));
    infinite(|x| x[0].powf(1.5));
    infinite(|x| x[0].abs().powf(0.3));
    // What does not touch a varying coordinate does not jump along it.
    let across = Sides { varies: vec![false, true], ..Sides::cube(2, 1.0) };
    let found =
        constant(&across, |x| x[0].if_lt(Bound::lit(0.0), Bound::lit(1.0), -x[1]) + x[0].floor());
    assert!(found.constant == 1.0_f64.next_up() && !found.assumed_continuous, "{found:?}");
    // Sides that meet are taken to be continuous, and this is said.
    let bent = constant(&sides, |x| x[0].if_lt(Bound::lit(0.0), x[0] * Bound::lit(0.5), x[0]));
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
        let folded = (0..11).fold(x[2], |sum, i| sum + (x[i % 3] - R::lit(0.05 * i as f32)).abs());
        (around * folded).min(around + folded * x[0])
    }
    let found = enclose(sides.domain(), |x| vec![formula(x)]).remove(0);
    assert!(found.caveats.hulled && found.constant().is_finite());
    assert!(found.pieces.len() <= LIMIT);
    let name = || "sum of distances".to_owned();
    let slope = (0..300).map(|_| steepest(&found, &sides, &mut rng, formula, &name));
    let slope = slope.fold(0.0, f64::max);
    assert!(slope > 10.0 && slope <= found.constant(), "{slope} of {}", found.constant());
    let small = constant(&sides, |x| x[0].hypot(x[1]) + x[2].abs());
    assert!(!small.hulled && small.pieces == 128);
    // A product with itself needs no pairs.
    let square = constant(&sides, |x| {
        let length = x[0].hypot(x[1]);
        length * length
    });
    assert!(!square.hulled && square.pieces == 64);
}

/// Partial derivatives of smooth functions over a point are their values there.
#[test]
fn gradients_over_a_point_are_derivatives() {
    let at = [0.3, 0.7];
    let domain = Domain { low: &at, high: &at, varies: &[true, true] };
    let outputs = enclose(domain, |x| {
        vec![
            x[0].sin(),
            x[0].cos(),
            x[0].tanh(),
            x[1].ln_unit(),
            x[1].sqrt(),
            x[0] / x[1],
            x[0] * x[1],
            x[0].tan(),
            x[0].asin(),
            x[0].acos(),
            x[0].atan(),
            x[0].exp(),
            x[1].ln(),
            x[0].sigmoid(),
            (x[0] - Bound::lit(8.0)).wrap(),
            x[1].sign(),
            x[0].powi(5),
            x[1].powi(-3),
            x[1].powf(-1.5),
            x[1].powf(2.5),
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
        [1.0 + x.tan().powi(2), 0.0],
        [1.0 / (1.0 - x * x).sqrt(), 0.0],
        [-1.0 / (1.0 - x * x).sqrt(), 0.0],
        [1.0 / (1.0 + x * x), 0.0],
        [x.exp(), 0.0],
        [0.0, 1.0 / y],
        [(-x).exp() / (1.0 + (-x).exp()).powi(2), 0.0],
        [1.0, 0.0],
        [0.0, 0.0],
        [5.0 * x.powi(4), 0.0],
        [0.0, -3.0 * y.powi(-4)],
        [0.0, -1.5 * y.powf(-2.5)],
        [0.0, 2.5 * y.powf(1.5)],
    ];
    for (output, expected) in outputs.iter().zip(expected) {
        let [piece] = &output.pieces[..] else {
            panic!("a smooth function has one piece");
        };
        for (side, expected) in piece.gradient.iter().zip(expected) {
            let slack = 4.0 * f64::EPSILON * expected.abs();
            let holds = side.low - slack <= expected && expected <= side.high + slack;
            assert!(holds && side.high - side.low < 1e-13, "{side:?} {expected}");
        }
    }
}

/// The gradient of an angle is one over the distance from the origin, in any direction.
#[test]
fn angles_turn_by_one_over_the_distance() {
    let domain = Domain { low: &[-1.0, 2.0], high: &[1.0, 3.0], varies: &[true, true] };
    let found = lipschitz(domain, |x| x[0].atan2(x[1]));
    assert!(found.constant >= 0.5 && found.constant < 0.501, "{found:?}");
    let across = Domain { low: &[0.0, -3.0], high: &[0.5, -2.0], varies: &[true, true] };
    let up_to_the_cut = lipschitz(across, |x| x[0].atan2(x[1]));
    assert!(up_to_the_cut.constant < 0.501, "{up_to_the_cut:?}");
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
