//! The functions against the platform's in f64.

use crate::real::{Lanes, Real};

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
    let patterns = (0..=COUNT).map(move |i| number(first + ((last - first) as f64 * share(i)) as i64));
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

#[test]
fn measure() {
    type Case = (&'static str, [f32; 2], fn(f32) -> f32, fn(f64) -> f64);
    let cases: &[Case] = &[
        ("exp", [-87.3, 88.72], <f32 as Real>::exp, f64::exp),
        ("exp sub", [-104.0, -87.3], <f32 as Real>::exp, f64::exp),
        ("ln small", [1e-45, 0.5], <f32 as Real>::ln, f64::ln),
        ("ln mid", [0.5, 2.0], <f32 as Real>::ln, f64::ln),
        ("ln big", [2.0, f32::MAX], <f32 as Real>::ln, f64::ln),
        ("sigmoid", [-87.0, 100.0], <f32 as Real>::sigmoid, |x| 1.0 / (1.0 + (-x).exp())),
        ("tanh", [-12.0, 12.0], <f32 as Real>::tanh, f64::tanh),
        ("tan 1.5", [-1.5, 1.5], <f32 as Real>::tan, f64::tan),
        ("tan pi", [-3.1, 3.1], <f32 as Real>::tan, f64::tan),
        ("tan 8192", [-8192.0, 8192.0], <f32 as Real>::tan, f64::tan),
        ("asin", [-1.0, 1.0], <f32 as Real>::asin, f64::asin),
        ("acos", [-1.0, 1.0], <f32 as Real>::acos, f64::acos),
        ("atan", [-10.0, 10.0], <f32 as Real>::atan, f64::atan),
        ("atan", [-f32::MAX, f32::MAX], <f32 as Real>::atan, f64::atan),
        ("sin pi", [-3.2, 3.2], <f32 as Real>::sin, f64::sin),
        ("cos pi", [-3.2, 3.2], <f32 as Real>::cos, f64::cos),
        ("sin 8192", [-8192.0, 8192.0], <f32 as Real>::sin, f64::sin),
        ("cos 8192", [-8192.0, 8192.0], <f32 as Real>::cos, f64::cos),
        ("1.5", [1e-25, 1e25], |x| Real::powf(x, 1.5), |x| x.powf(1.5)),
        ("-0.3", [1e-25, 1e25], |x| Real::powf(x, -0.3), |x| x.powf(f64::from(-0.3f32))),
    ];
    for (name, range, ours, truth) in cases {
        let [absolute, units] = errors(*range, ours, truth);
        println!("{name:10} {absolute:e} {units}");
    }
    let mut worst = 0.0f64;
    for x in numbers([-8192.0, 8192.0]) {
        let t = f64::from(x).tan();
        let d = ((f64::from(Real::tan(x)) - t).abs() - 5.0 * ulp(t)) / (1.0 + t * t);
        worst = worst.max(d);
    }
    println!("tan 8192 combined {worst:e}");
}
