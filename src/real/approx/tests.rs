//! The functions against the platform's in f64.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use crate::real::Real;

/// Largest error of `ours` against `truth` over an even grid.
fn worst(low: f32, high: f32, ours: fn(f32) -> f32, truth: fn(f64) -> f64) -> f64 {
    let count = 200_001;
    (0..count)
        .map(|i| low + (high - low) * i as f32 / (count - 1) as f32)
        .map(|x| (f64::from(ours(x)) - truth(f64::from(x))).abs())
        .fold(0.0, f64::max)
}

#[test]
fn close_to_the_platform_in_f64() {
    assert!(worst(-4.0, 4.0, <f32 as Real>::sin, f64::sin) < 3e-7);
    assert!(worst(-4.0, 4.0, <f32 as Real>::cos, f64::cos) < 5e-7);
    assert!(worst(-1000.0, 1000.0, <f32 as Real>::sin, f64::sin) < 4e-7);
    assert!(worst(-1000.0, 1000.0, <f32 as Real>::cos, f64::cos) < 6e-7);
    assert!(worst(-12.0, 12.0, <f32 as Real>::tanh, f64::tanh) < 4e-7);
    assert!(worst(6e-8, 1.0, <f32 as Real>::ln_unit, f64::ln) < 1.2e-6);
    let relative = |x: f32| (f64::from(x.exp_negative()) / f64::from(x).exp() - 1.0).abs();
    let largest = (0..86_000).map(|i| relative(i as f32 * -1e-3)).fold(0.0, f64::max);
    assert!(largest < 3e-7, "{largest}");
}

/// Every turn that a uniform number can be.
#[test]
fn angles_within_a_turn_need_no_reduction() {
    for word in 0..1 << 23_u32 {
        let turn = f32::from_bits(word | 0x3f80_0000) - 1.0;
        let angle = std::f32::consts::TAU * (turn - 0.5);
        assert_eq!(super::angle::principal(angle).to_bits(), angle.to_bits(), "{turn}");
    }
    for angle in [-1.0_f32, 0.0, 2.5] {
        let [sin, cos] = angle.principal_sin_cos();
        assert_eq!([sin, cos], [Real::sin(angle), Real::cos(angle)]);
    }
}

#[test]
fn parts_of_a_unit_make_it_again() {
    for u in (1..=1 << 23).step_by(7).map(|k| k as f32 / 8_388_608.0) {
        let [mantissa, exponent] = u.unit_parts();
        let root = std::f32::consts::FRAC_1_SQRT_2;
        assert!((root..2.0 * root).contains(&mantissa), "{u}: {mantissa}");
        assert_eq!(mantissa * exponent.exp2(), u);
    }
}

#[test]
fn ends_of_the_ranges() {
    assert_eq!(<f32 as Real>::ln_unit(1.0), 0.0);
    let smallest = (-24.0_f32).exp2();
    assert!((Real::ln_unit(smallest) - f64::from(smallest).ln() as f32).abs() < 2e-6);
    assert_eq!(<f32 as Real>::tanh(0.0), 0.0);
    assert!(<f32 as Real>::tanh(1e30) <= 1.0);
    assert!(<f32 as Real>::tanh(f32::NAN).is_nan());
    assert_eq!(<f32 as Real>::exp_negative(0.0), 1.0);
    for far in [-87.5, -1e30, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(far.exp_negative(), 0.0, "{far}");
    }
}

/// Numbers from `low` to `high`, over two million: an even grid, and every so many of the bit patterns,
/// which are dense where numbers are small.
fn numbers([low, high]: [f32; 2]) -> impl Iterator<Item = f32> {
    const COUNT: i64 = 1 << 20;
    // Whole numbers in the order of the floats that they stand for.
    let place = |x: f32| {
        let size = i64::from(x.to_bits() & 0x7fff_ffff);
        if x.is_sign_negative() { -size } else { size }
    };
    let number = |place: i64| {
        let size = f32::from_bits(place.unsigned_abs() as u32);
        if place < 0 { -size } else { size }
    };
    let (first, last) = (place(low), place(high));
    let share = move |i: i64| i as f64 / COUNT as f64;
    let patterns =
        (0..=COUNT).map(move |i| number(first + ((last - first) as f64 * share(i)) as i64));
    let even = move |i: i64| f64::from(low) + (f64::from(high) - f64::from(low)) * share(i);
    patterns.chain((0..=COUNT).map(move |i| even(i) as f32))
}

/// Distance of two f32 numbers near `x`.
fn ulp(x: f64) -> f64 {
    let size = (x.abs() as f32).max(f32::MIN_POSITIVE);
    f64::from(f32::from_bits(size.to_bits() + 1)) - f64::from(size)
}

/// Largest error of `ours` over the numbers from `low` to `high`, absolute and in units in the last
/// place of the truth.
fn errors(range: [f32; 2], ours: impl Fn(f32) -> f32, truth: impl Fn(f64) -> f64) -> [f64; 2] {
    numbers(range).fold([0.0_f64; 2], |[absolute, units], x| {
        let truth = truth(f64::from(x));
        let error = (f64::from(ours(x)) - truth).abs();
        assert!(!error.is_nan(), "{x}");
        [absolute.max(error), units.max(error / ulp(truth))]
    })
}

/// What the documentation of each function states, and that it does not state much more than there is.
#[test]
fn errors_are_as_stated() {
    type Case = ([f32; 2], fn(f32) -> f32, fn(f64) -> f64, f64);
    let in_units: [Case; 8] = [
        ([-87.3, 88.72], Real::exp, f64::exp, 1.1),
        ([1e-45, 0.5], Real::ln, f64::ln, 1.3),
        ([2.0, f32::MAX], Real::ln, f64::ln, 1.3),
        ([-87.0, 100.0], Real::sigmoid, Real::sigmoid, 2.6),
        ([-1.5, 1.5], Real::tan, f64::tan, 3.5),
        ([-1.0, 1.0], Real::asin, f64::asin, 2.5),
        ([-1.0, 1.0], Real::acos, f64::acos, 1.5),
        ([-f32::MAX, f32::MAX], Real::atan, f64::atan, 3.0),
    ];
    for (number, (range, ours, truth, limit)) in in_units.into_iter().enumerate() {
        let [_, units] = errors(range, ours, truth);
        assert!(units < limit && units > 0.7 * limit, "{number}: {units} of {limit}");
    }
    let absolute: [Case; 6] = [
        ([0.5, 2.0], Real::ln, f64::ln, 6e-8),
        ([-104.0, -87.3], Real::exp, f64::exp, 1.5e-45),
        ([-12.0, 12.0], Real::tanh, f64::tanh, 4e-7),
        ([-8192.0, 8192.0], Real::sin, f64::sin, 3e-7),
        ([-8192.0, 8192.0], Real::cos, f64::cos, 5e-7),
        ([-f32::MAX, -87.0], Real::sigmoid, Real::sigmoid, 1.2e-38),
    ];
    for (number, (range, ours, truth, limit)) in absolute.into_iter().enumerate() {
        let [error, _] = errors(range, ours, truth);
        assert!(error < limit && (number == 5 || error > 0.6 * limit), "{number}: {error:e}");
    }
}

/// The tangent grows with the error of the angle where it is steep.
#[test]
fn tangents_of_far_angles() {
    for x in numbers([-8192.0, 8192.0]) {
        let truth = f64::from(x).tan();
        let error = (f64::from(Real::tan(x)) - truth).abs();
        assert!(error < 5.0 * ulp(truth) + 5e-8 * (1.0 + truth * truth), "{x}: {error:e}");
    }
}

/// `wrap` is the angle to which f64 wraps, or that angle a whole turn on next to an odd half turn.
#[test]
fn wrapped_angles() {
    let pi = std::f32::consts::PI;
    for (range, limit) in [([-8192.0, 8192.0], 4e-7), ([-1e6, 1e6], 0.04)] {
        for x in numbers(range) {
            let (found, truth) = (Real::wrap(x), Real::wrap(f64::from(x)));
            assert!((-pi..pi).contains(&found), "{x}: {found}");
            let apart = (f64::from(found) - truth).abs();
            let apart = apart.min((apart - std::f64::consts::TAU).abs());
            assert!(apart < limit, "{x}: {found} {truth}");
        }
    }
    assert_eq!([pi, -pi, 0.0, 3.0, -3.0].map(Real::wrap), [-3.141_592_5, -pi, 0.0, 3.0, -3.0]);
    for far in [4.3e6, 1e30, f32::MAX, f32::INFINITY, f32::NAN] {
        assert!(Real::wrap(far).is_nan() && Real::wrap(-far).is_nan(), "{far}");
    }
    for x in [pi, -pi, 1e15, -1e15] {
        let wrapped = Real::wrap(f64::from(x));
        assert!((-std::f64::consts::PI..std::f64::consts::PI).contains(&wrapped), "{x}");
    }
}

/// Two million points of the plane, near and far from the axes, in all quadrants.
#[test]
fn angles_of_points() {
    let mut rng = StdRng::seed_from_u64(1);
    let mut worst = 0.0_f64;
    for _ in 0..2_000_000 {
        let mut number =
            || rng.random_range(-1.0_f32..1.0) * 10.0_f32.powi(rng.random_range(-9..9));
        let (y, x) = (number(), number());
        let truth = Real::atan2(f64::from(y), f64::from(x));
        worst = worst.max((f64::from(Real::atan2(y, x)) - truth).abs());
    }
    assert!(worst < 3e-7 && worst > 1e-7, "{worst:e}");
    let pi = std::f32::consts::PI;
    for (y, x, angle) in [
        (0.0, 0.0, 0.0),
        (-0.0, -0.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, -1.0, pi),
        (-0.0, -1.0, pi),
        (1.0, 0.0, 0.5 * pi),
        (-1.0, 0.0, -0.5 * pi),
        (f32::INFINITY, f32::INFINITY, 0.25 * pi),
        (f32::NEG_INFINITY, f32::NEG_INFINITY, -0.75 * pi),
        (f32::INFINITY, 1.0, 0.5 * pi),
        (1.0, f32::INFINITY, 0.0),
        (1.0, f32::NEG_INFINITY, pi),
        (f32::MAX, f32::MAX, 0.25 * pi),
        (1e-40, -1.0, pi),
    ] {
        let found = Real::atan2(y, x);
        assert!((found - angle).abs() < 3e-7, "{y} {x}: {found}");
        let found = Real::atan2(f64::from(y), f64::from(x));
        assert!((found - f64::from(angle)).abs() < 3e-7, "{y} {x}: {found} in f64");
    }
}

/// Powers by repeated products, the root, and the exponential of the logarithm.
#[test]
fn powers() {
    for exponent in [-2.5_f32, -0.3, 0.1, 1.5, 3.3] {
        for x in numbers([1e-20, 1e10]) {
            let exact = f64::from(x).powf(f64::from(exponent));
            if exact < f64::from(f32::MIN_POSITIVE) || exact > f64::from(f32::MAX) {
                continue;
            }
            let relative = (f64::from(Real::powf(x, exponent)) / exact - 1.0).abs();
            let allowed = 3e-7 * (1.0 + (f64::from(exponent) * f64::from(x).ln()).abs());
            assert!(relative < allowed, "{x}^{exponent}: {relative:e} of {allowed:e}");
        }
    }
    for x in [-3.0_f32, -0.5, 0.7, 2.0, 11.0] {
        assert_eq!(Real::powi(x, 3), x * (x * x));
        assert_eq!(Real::powf(x, 2.0), x * x);
        assert_eq!(Real::powi(x, -1), 1.0 / x);
        assert_eq!(Real::powf(x, 0.0), 1.0);
        let sum = (f64::from(Real::powi(x, 13)) / f64::from(x).powi(13) - 1.0).abs();
        assert!(sum < 5e-7, "{x}: {sum:e}");
        assert!(x > 0.0 || (Real::powf(x, 0.5).is_nan() && Real::powf(x, 1.7).is_nan()));
    }
    assert_eq!(Real::powf(2.0_f32, 0.5), 2.0_f32.sqrt());
    assert_eq!([Real::powf(0.0_f32, 1.3), Real::powf(0.0_f32, -1.3)], [0.0, f32::INFINITY]);
    assert!(Real::powi(f32::NAN, 0).is_nan() && Real::powf(1.0_f32, f32::NAN).is_nan());
    assert_eq!(Real::powi(1.0_f32, i32::MIN), 1.0);
}

/// Every function at the numbers that formulas may meet, in f32 and in f64, on either side of its domain.
#[test]
fn ends_of_the_domains() {
    let (infinite, nan) = (f32::INFINITY, f32::NAN);
    assert_eq!([0.0_f32, -infinite, infinite].map(Real::exp), [1.0, 0.0, infinite]);
    assert_eq!([88.8_f32, -104.0].map(Real::exp), [infinite, 0.0]);
    assert_eq!(Real::exp(88.722_8_f32), f64::from(88.722_8_f32).exp() as f32);
    assert_eq!([1.0_f32, infinite].map(Real::ln), [0.0, infinite]);
    for x in [0.0, -0.0, -1e-45, -1.0, -infinite, nan] {
        assert!(Real::ln(x).is_nan() && Real::ln(f64::from(x)).is_nan(), "{x}");
    }
    assert_eq!([infinite, -infinite].map(Real::sigmoid), [1.0, 0.0]);
    assert_eq!([1.0_f32, -1.0].map(Real::acos), [0.0, std::f32::consts::PI]);
    for x in [1.000_000_1_f32, -1.5, infinite, nan] {
        assert!(Real::asin(x).is_nan() && Real::acos(x).is_nan(), "{x}");
    }
    assert_eq!([infinite, -2.0, 3.0, 0.0].map(Real::sign), [1.0, -1.0, 1.0, 0.0]);
    assert_eq!(Real::atan(infinite), std::f32::consts::FRAC_PI_2);
    for x in numbers([6e-8, 1.0]) {
        assert_eq!(Real::ln(x).to_bits(), Real::ln_unit(x).to_bits(), "{x}");
    }
}
