//! Growth upward repeated over thousands of seeds: the share of false sets is at most beta, and broken rules
//! are found out.

mod common;

use common::{binomial_limit, cpu, settings};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::scenario::bound::{certified_risk, required_with_failures};
use reachcast::scenario::growth::Growth;
use reachcast::scenario::growth_batch::{Request, grow_each};
use reachcast::scenario::growth_plan::GrowthPlan;
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Context, Unwatched};
use reachcast::system::{Axis, System};

/// Repetitions of each certificate.
const SEEDS: u64 = 2000;
/// Risk that the certificates claim.
const EPSILON: f64 = 0.1;
/// Chance that each may be false.
const BETA: f64 = 0.05;
/// Failures that a round may have.
const ALLOWED: u64 = 3;
/// The true risk that is just above the claim.
const ABOVE: f64 = 1.02 * EPSILON;

/// Whether `count` false certificates are more than a chance of [`BETA`] each explains.
fn violates(name: &str, count: u64) -> bool {
    let limit = binomial_limit(SEEDS, BETA);
    println!("{name}: {count} of {SEEDS} false, limit {limit}");
    count > limit
}

/// No control.
struct Idle;

impl Policy<2, 1> for Idle {
    fn name(&self) -> String {
        "idle".to_owned()
    }
    fn control<R: Real>(&self, _x: [R; 2]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// What of the plane fails.
#[derive(Clone, Copy)]
enum Fails {
    /// A wedge with its tip at the origin, that share of every ball around it.
    Wedge(f64),
    /// What is farther than 1 from the origin: `1 - 1 / r^2` of a ball of radius r above 1.
    Rim,
}

/// A state that stays where it is.
#[derive(Clone, Copy)]
struct Still(Fails);

impl System<2, 1> for Still {
    fn name(&self) -> &str {
        "still"
    }
    fn states(&self) -> [Axis; 2] {
        ["x", "y"].map(|name| Axis::new(name, "m", -2.0, 2.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("none", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, x: [R; 2], _u: [R; 1]) -> [R; 2] {
        x
    }
    fn target<R: Real>(&self, _x: [R; 2]) -> R {
        R::lit(10.0)
    }
    fn constraint<R: Real>(&self, [x, y]: [R; 2]) -> R {
        match self.0 {
            Fails::Wedge(share) => {
                y.abs() - R::lit((std::f64::consts::PI * share).tan() as f32) * x
            }
            Fails::Rim => R::lit(1.0) - x * x - y * y,
        }
    }
}

/// Settings of `rounds` radii up to `radius`.
fn asked(system: &Still, radius: f32, rounds: u32) -> Settings {
    let mut settings = settings(system, 1);
    let growth = &mut settings.growth;
    (growth.radius, growth.rounds) = (radius, rounds);
    (growth.epsilon, growth.beta) = (EPSILON, BETA);
    growth.scenarios = required_with_failures(EPSILON, BETA, ALLOWED).expect("a count");
    growth.plan = GrowthPlan { factor: 1.03, ..GrowthPlan::UPWARD };
    assert_eq!(growth.allowed_failures(), Some(ALLOWED));
    settings
}

/// The radius that each seed verifies; `call` numbers draws of the same seed.
fn radii(system: Still, settings: &Settings, call: u32) -> Vec<Option<f32>> {
    let backend = cpu(1);
    let plant = Plant::of(system, Idle);
    let program = backend.prepare(&plant).expect("a program");
    let context = Context { program: &program, watch: &Unwatched };
    let request = |seed| Request { center: vec![0.0; 2], seed, call };
    let requests: Vec<Request> = (0..SEEDS).map(request).collect();
    let grown = grow_each(context, settings, &requests, 0.0).expect("balls");
    let radius = |growth: Growth| match growth {
        Growth::Verified(ball) => Some(ball.radius),
        Growth::Exhausted { .. } => None,
    };
    grown.into_iter().map(|grown| radius(grown.outcome)).collect()
}

/// Every radius has a risk just above the claim, so every verified ball is false.
#[test]
fn no_round_costs_more_than_the_whole_sequence() {
    let system = Still(Fails::Wedge(ABOVE));
    let settings = asked(&system, 0.5, 8);
    let found = radii(system, &settings, 0);
    assert!(!violates("wedge", found.iter().flatten().count() as u64));
    // Half the starts that the claim needs, with the failures that the whole of them may have.
    let mut half = asked(&system, 0.5, 8);
    half.growth.scenarios /= 2;
    half.growth.epsilon = (1..99)
        .map(|percent| f64::from(percent) / 100.0)
        .find(|epsilon| {
            half.growth.epsilon = *epsilon;
            half.growth.allowed_failures() == Some(ALLOWED)
        })
        .expect("a risk that allows as many");
    let found = radii(system, &half, 0);
    assert!(violates("wedge, half", found.iter().flatten().count() as u64));
    // Going on after a refusal: eight radii, each with draws of its own.
    let single = asked(&system, 0.5, 1);
    let mut any = vec![false; SEEDS as usize];
    for call in 0..8 {
        let found = radii(system, &single, call);
        any.iter_mut().zip(found).for_each(|(any, radius)| *any |= radius.is_some());
    }
    assert!(violates(
        "wedge, on after a refusal",
        any.into_iter().filter(|any| *any).count() as u64
    ));
}

/// Sound radii below, one just above the claim, one farther on.
#[test]
fn the_first_wrong_radius_is_seldom_taken() {
    let system = Still(Fails::Rim);
    let wrong = (1.0 - ABOVE).sqrt().recip();
    let settings = asked(&system, (1.03 * wrong) as f32, 4);
    let found = radii(system, &settings, 0);
    let is_false = |radius: &&f32| f64::from(**radius) > (1.0 - EPSILON).sqrt().recip();
    assert!(!violates("rim", found.iter().flatten().filter(is_false).count() as u64));
    // Sound radii are found: at 1.0246 a twentieth fails.
    let sound = found.iter().flatten().filter(|radius| **radius > 0.99).count();
    assert!(sound as u64 > SEEDS * 9 / 10, "{sound}");
}

/// The radius that a sample is cut at is chosen on that very sample.
#[test]
fn radii_chosen_on_the_sample_are_found_out() {
    let is_false = |seed: &u64| {
        let mut rng = StdRng::seed_from_u64(*seed);
        // In the order of their distance, starts of the wedge fail independently.
        let mut failures = 0;
        (1..=400_u64).any(|inside| {
            failures += u64::from(rng.random_bool(ABOVE));
            certified_risk(inside, failures, BETA) <= EPSILON
        })
    };
    assert!(violates("radii of the sample", (0..SEEDS).filter(is_false).count() as u64));
}
