//! Words, bits, limits and errors of activations.

use super::*;
use crate::formula::record;
use crate::real::Lanes;

/// Each kind, and those with parameters with others than the defaults besides.
fn all() -> Vec<Activation> {
    let other = [
        Activation::LeakyRelu { slope: 0.2 },
        Activation::LeakyRelu { slope: 0.0 },
        Activation::LeakyRelu { slope: -0.5 },
        Activation::Elu { alpha: 0.5 },
        Activation::Elu { alpha: 0.0 },
        Activation::Celu { alpha: 0.3 },
        Activation::Celu { alpha: 2e-38 },
        Activation::Softplus { beta: 3.0 },
        Activation::Softplus { beta: 1e-30 },
        Activation::Hardtanh { low: -2.0, high: 0.5 },
    ];
    Activation::ALL.into_iter().chain(other).collect()
}

/// Those of parameters of a size that differences in f64 can be taken of.
fn usual() -> impl Iterator<Item = Activation> {
    let tiny = |one: &Activation| one.parameters().iter().any(|p| *p != 0.0 && p.abs() < 1e-20);
    all().into_iter().filter(move |one| !tiny(one))
}

/// Numbers of all sizes, dense around 0.
fn numbers() -> Vec<f32> {
    let sizes = (0..=0x7f80_0000_u32).step_by(0x000f_fff1).map(f32::from_bits);
    let near = (-12_000..=12_000).map(|i| i as f32 * 1.1e-3);
    let edges = [0.0, -0.0, f32::MIN_POSITIVE, 1e-45, f32::MAX, f32::INFINITY, 1e30, 6.0, 1.0];
    let all = sizes.chain(near).chain(edges);
    all.flat_map(|x| [x, -x]).collect()
}

#[test]
fn words_are_read_as_they_are_written() {
    for activation in all() {
        assert_eq!(activation.name().parse(), Ok(activation), "{activation}");
    }
    assert_eq!(Activation::Hardtanh { low: -2.0, high: 2.0 }.name(), "hardtanh(-2,2)");
    assert_eq!(Activation::Elu { alpha: 1.0 }.name(), "elu");
    assert_eq!(" leaky_relu ( 0.2 ) ".parse(), Ok(Activation::LeakyRelu { slope: 0.2 }));
}

#[test]
fn other_words_and_parameters_without_sense_are_refused() {
    let refused = |text: &str, word: &str| {
        let problem = text.parse::<Activation>().expect_err(text);
        assert!(problem.contains(word), "no `{word}` in: {problem}");
    };
    refused("swish", "none of identity, relu, leaky_relu");
    refused("relu(1)", "takes 0 numbers");
    refused("elu(1,2)", "takes 1 numbers");
    refused("elu(1", "takes 1 numbers");
    refused("elu(one)", "takes 1 numbers");
    refused("elu()", "takes 1 numbers");
    refused("elu(-1)", "below 0");
    refused("elu(inf)", "finite");
    refused("leaky_relu(nan)", "finite");
    refused("celu(0)", "above 0");
    refused("softplus(-1)", "above 0");
    refused("softplus(1e-42)", "above 0");
    refused("hardtanh(1,1)", "below the upper one");
}

#[test]
fn numbers_lanes_and_recorded_formulas_have_the_same_bits() {
    for activation in all() {
        let graph = record(1, |x| vec![activation.apply(x[0])]).expanded();
        for lanes in numbers().chunks_exact(8) {
            let found = activation.apply(Lanes::<8>(lanes.try_into().expect("8 numbers"))).0;
            for (&x, lane) in lanes.iter().zip(found) {
                let one = activation.apply(x);
                assert_eq!(one.to_bits(), lane.to_bits(), "{activation} at {x}");
                assert_eq!(one.to_bits(), graph.eval(&[x])[0].to_bits(), "{activation} at {x}");
            }
        }
    }
}

/// Both f32 and f64: the limit where there is one, a number at every number, and NaN at NaN alone.
#[test]
fn infinities_have_their_limits_and_nan_stays() {
    let (inf, none) = (f64::INFINITY, f64::NEG_INFINITY);
    for activation in all() {
        assert!(activation.apply(f32::NAN).is_nan() && activation.apply(f64::NAN).is_nan());
        let [low, high] = match activation {
            Activation::Identity => [none, inf],
            Activation::LeakyRelu { slope } if slope > 0.0 => [none, inf],
            Activation::LeakyRelu { slope } if slope < 0.0 => [inf, inf],
            Activation::Elu { alpha } | Activation::Celu { alpha } => [-f64::from(alpha), inf],
            Activation::Selu => [-1.758_099_3, inf],
            Activation::Tanh | Activation::Softsign => [-1.0, 1.0],
            Activation::Sigmoid => [0.0, 1.0],
            Activation::Hardtanh { low, high } => [f64::from(low), f64::from(high)],
            Activation::Relu6 => [0.0, 6.0],
            _ => [0.0, inf],
        };
        // Of a beta of 1e-30, a number of 1e30 is none of the far ones.
        let far = if activation == (Activation::Softplus { beta: 1e-30 }) { inf } else { 1e30 };
        for (end, limit) in [(none, low), (inf, high), (-far, low), (far, high)] {
            // What has an infinite limit is as large as its argument, up to its slope.
            let close = |found: f64| match limit.is_finite() {
                true => (found - limit).abs() <= 4e-6 * (1.0 + limit.abs()),
                false if end.is_infinite() => found == limit,
                false => found.signum() == limit.signum() && found.abs() >= 1e27,
            };
            let [f32s, f64s] = [f64::from(activation.apply(end as f32)), activation.apply(end)];
            assert!(close(f32s) && close(f64s), "{activation} at {end}: {f32s}, {f64s}");
        }
        for x in numbers() {
            assert!(!activation.apply(x).is_nan(), "{activation} at {x}");
            let zero = activation.apply(0.0 * x).abs();
            assert!(x.abs() >= 1.0 || zero == activation.apply(0.0_f32), "{activation} at -0");
        }
    }
}

/// Against f64, over a million numbers: in units of the larger of 1 and the value.
#[test]
fn errors_are_those_that_are_stated() {
    for activation in all() {
        let error = |i: i32| {
            let x = i as f32 * 3.1e-5;
            let truth = activation.apply(f64::from(x));
            (f64::from(activation.apply(x)) - truth).abs() / truth.abs().max(1.0)
        };
        let worst = (-500_000..500_000).map(error).fold(0.0, f64::max);
        println!("{activation}: {worst:.2e}");
        // Of 1 / beta, at the smallest beta.
        let scale =
            activation.parameters().iter().fold(1.0, |most: f64, p| most.max(f64::from(*p)));
        // What is a half of x and that times a tangent ends within the rounding of x.
        let halves =
            matches!(activation, Activation::Gelu | Activation::GeluTanh | Activation::Silu);
        let most = if halves { 2.5e-6 } else { 6e-7 * scale };
        assert!(worst < most, "{activation}: {worst}");
    }
}

/// The three functions of the scalar type that only activations need.
#[test]
fn their_functions_are_close_to_f64() {
    let over = |low: f32, high: f32, ours: fn(f32) -> f32, truth: fn(f64) -> f64| {
        let at = |i: u32| low + (high - low) * i as f32 / 1e6;
        let error = |x: f32| {
            let truth = truth(f64::from(x));
            let unit = f64::from((truth as f32).abs().next_up() - (truth as f32).abs());
            [(f64::from(ours(x)) - truth).abs(), (f64::from(ours(x)) - truth).abs() / unit]
        };
        let errors = (0..=1_000_000).map(|i| error(at(i)));
        errors.fold([0.0; 2], |most: [f64; 2], one| [most[0].max(one[0]), most[1].max(one[1])])
    };
    let [_, ulp] = over(-16.0, -1e-6, Real::exp_m1_negative, Real::exp_m1_negative);
    assert!(ulp < 5.0, "{ulp}");
    let [_, ulp] = over(-86.0, 86.0, Real::softplus_excess, Real::softplus_excess);
    assert!(ulp < 5.0, "{ulp}");
    let [error, _] = over(-9.0, 9.0, Real::normal_share, Real::normal_share);
    assert!(error < 4e-7, "{error}");
    println!("{:?}", over(-9.0, 9.0, Real::normal_share, Real::normal_share));
    println!("{:?}", over(-16.0, -1e-6, Real::exp_m1_negative, Real::exp_m1_negative));
    println!("{:?}", over(-86.0, 86.0, Real::softplus_excess, Real::softplus_excess));
}

/// Values and slopes of sampled numbers lie in the range of their interval, and that is no wider than it need be.
#[test]
fn ranges_hold_values_and_slopes() {
    for activation in usual() {
        let at = |x: f64| activation.apply(x);
        for i in 0..240 {
            let low = -9.0 + 0.075 * f64::from(i);
            for width in [0.0, 0.003, 0.2, 1.0, 5.0, 20.0] {
                let (values, slopes) = activation.range(Interval::new(low, low + width));
                let mut seen = [f64::INFINITY, f64::NEG_INFINITY];
                for j in 0..=400 {
                    let x = low + width * f64::from(j) / 400.0;
                    // The formula in f64 has rounding of its own.
                    let slack = 1e-13 * (1.0 + at(x).abs());
                    let held = values.low - slack <= at(x) && at(x) <= values.high + slack;
                    assert!(held, "{activation} at {x}: {} outside {values:?}", at(x));
                    seen = [seen[0].min(at(x)), seen[1].max(at(x))];
                    let step = 1e-6;
                    let inside = low <= x - step && x + step <= low + width;
                    let slope = (at(x + step) - at(x - step)) / (2.0 * step);
                    let held = slopes.low - 2e-8 <= slope && slope <= slopes.high + 2e-8;
                    assert!(!inside || held, "{activation} at {x}: {slope} outside {slopes:?}");
                }
                // What 400 places miss of a curve of bend 2.5, and of a corner.
                let miss = (width / 400.0).powi(2) + 1e-7 + width / 200.0;
                let loose = (seen[0] - values.low).max(values.high - seen[1]);
                assert!(loose <= miss, "{activation} {low} + {width}: {values:?}, seen {seen:?}");
            }
        }
        let (values, slopes) = activation.range(Interval::ENTIRE);
        for x in numbers() {
            assert!(values.contains(at(f64::from(x)).clamp(-1e300, 1e300)), "{activation} at {x}");
        }
        assert!(
            slopes.magnitude() <= activation.slope() && activation.slope() < 3.1,
            "{activation}"
        );
    }
}

#[cfg(feature = "train")]
#[test]
fn slopes_are_central_differences() {
    for activation in usual() {
        for i in -3000..3000 {
            // Off the corners.
            let x = f64::from((f64::from(i) * 0.0051 + 0.0021) as f32);
            let slope = (activation.apply(x + 1e-6) - activation.apply(x - 1e-6)) / 2e-6;
            let found = f64::from(activation.slope_at(x as f32));
            assert!((found - slope).abs() < 5e-6, "{activation} at {x}: {found}, {slope}");
        }
        assert!(activation.slope_at(1e30).is_finite() && activation.slope_at(-1e30).is_finite());
    }
}
