//! What is never certified: a rounding error too much, what is no number, what a kind is not for.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::rollout::PairControl;
use reachcast::scenario::deterministic::{Deterministic, Kind};
use reachcast::system::{Axis, System};

use crate::cases::{dubins, race, spec};

/// A number that grows by a factor in each step, with an affine target.
struct Line {
    growth: f32,
    slope: f32,
    offset: f32,
}

impl System<1, 1> for Line {
    fn name(&self) -> &str {
        "line"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], _: [R; 1]) -> [R; 1] {
        [R::lit(self.growth) * x]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        R::lit(self.slope) * x - R::lit(self.offset)
    }
    fn constraint<R: Real>(&self, _: [R; 1]) -> R {
        R::lit(1.0)
    }
}

/// No control.
struct Still;

impl Policy<1, 1> for Still {
    fn name(&self) -> String {
        "still".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 1]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// Radii at which the true margin is 0 or less by far less than a rounding error of f64: whoever rounds to nearest
/// certifies about half of them. All numbers are whole multiples of powers of two, so the margin is an integer.
#[test]
fn a_rounding_error_too_much_is_refused() {
    let mut random = StdRng::seed_from_u64(11);
    let (mut refused, mut certified) = (0, 0);
    for _ in 0..400 {
        // 24 bits each: the growth in [1, 2), slope and start in [0.5, 1).
        let mut bits = || i128::from(random.random_range(1_u32 << 23..1 << 24));
        let (growth, slope, x) = (bits(), bits(), bits());
        let slopes = growth * slope;
        // The largest multiple of 2^-23 below the target's value after a step: an f32.
        let offset = ((slopes * x) >> 48) << 1;
        let number = |bits: i128, places: i32| bits as f32 / 2.0_f32.powi(places);
        let system = Line {
            growth: number(growth, 23),
            slope: number(slope, 24),
            offset: number(offset, 24),
        };
        let plant = Plant::of(system, Still);
        let certificate =
            Deterministic::new(&plant, spec(1), PairControl::ClosedLoop, Kind::Tube).unwrap();
        // The margin after a step in units of 2^-121, for a radius in units of 2^-74.
        let value = slopes * x * (1 << 50) - offset * (1 << 97);
        let least = (value + slopes - 1) / slopes;
        let verdict = |radius: i128| {
            certificate.verdict(&[number(x, 24)], radius as f64 / 2.0_f64.powi(74)).certified
        };
        for radius in least..least + 3 {
            assert!(value - slopes * radius <= 0 && !verdict(radius), "{radius}");
            refused += 1;
        }
        certified += u32::from(verdict(least / 2));
    }
    assert!(refused == 1200 && certified > 390, "{refused} {certified}");
}

/// A target that is no number left of 0.
struct Root;

impl System<1, 1> for Root {
    fn name(&self) -> &str {
        "root"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -1.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, x: [R; 1], _: [R; 1]) -> [R; 1] {
        x
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        R::lit(1.0) + x.sqrt()
    }
    fn constraint<R: Real>(&self, _: [R; 1]) -> R {
        R::lit(1.0)
    }
}

#[test]
fn what_is_no_number_is_never_certified() {
    for (plant, kind) in [(race(), Kind::Pieces), (race(), Kind::Tube), (race(), Kind::Lipschitz)] {
        let certificate = Deterministic::new(&plant, spec(30), PairControl::Replay, kind).unwrap();
        let start = vec![0.0, 0.0, -0.1, 0.9, 0.0, 0.0, 0.5, 0.0, -3.0, 0.1, 0.0, 0.0];
        assert!(certificate.verdict(&start, 1e-4).certified);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for i in 0..12 {
                let mut start = start.clone();
                start[i] = bad;
                assert!(!certificate.verdict(&start, 1e-4).certified, "{kind:?} {bad} {i}");
                assert_eq!(certificate.radius(&start, 0.1), 0.0);
            }
        }
        for radius in [f64::NAN, f64::INFINITY, -1.0, f64::MAX] {
            assert!(!certificate.verdict(&start, radius).certified, "{kind:?} {radius}");
        }
    }
    let plant = Plant::of(Root, Still);
    let certificate =
        Deterministic::new(&plant, spec(1), PairControl::ClosedLoop, Kind::Tube).unwrap();
    assert!(certificate.verdict(&[0.5], 0.4).certified);
    assert!(!certificate.verdict(&[0.5], 0.6).certified);
    assert!(!certificate.verdict(&[-0.5], 0.0).certified);
}

#[test]
fn pieces_need_a_linear_plant_and_replay() {
    let refusal = |plant: &Plant, control| {
        let refused = Deterministic::new(plant, spec(30), control, Kind::Pieces);
        refused.map(drop).unwrap_err().to_string()
    };
    assert!(refusal(&dubins(), PairControl::Replay).contains("linear"));
    assert!(refusal(&race(), PairControl::ClosedLoop).contains("replay"));
}
