//! Growth upward: radii fixed beforehand, tried from the smallest up, until one is refused.

use crate::balls::{Balls, Pool, of_each};
use crate::common::{cpu, settings};
use crate::plants::{Fails, Idle, Still};
use crate::{BETA, CERTIFICATES, EPSILON, false_ones, violates};
use reachcast::model::Plant;
use reachcast::scenario::bound::{certified_risk, required_with_failures};
use reachcast::scenario::growth::Growth;
use reachcast::scenario::growth_batch::{Request, grow_each};
use reachcast::scenario::growth_plan::GrowthPlan;
use reachcast::scenario::settings::{GrowthSettings, Settings};
use reachcast::scenario::{Context, Unwatched};

/// Failures that a round may have.
const ALLOWED: u64 = 3;
/// The true risk that is just above the claim.
const ABOVE: f64 = 1.02 * EPSILON;

/// Settings of `rounds` radii up to `radius`, each `factor` times the one before it, for a risk of `epsilon`.
fn growth(radius: f32, rounds: u32, factor: f64, epsilon: f64) -> GrowthSettings {
    let mut growth = settings(&Still(Fails::Rim), 1).growth;
    (growth.radius, growth.rounds) = (radius, rounds);
    (growth.epsilon, growth.beta) = (epsilon, BETA);
    growth.scenarios = required_with_failures(epsilon, BETA, ALLOWED).expect("a count");
    growth.plan = GrowthPlan { factor, ..GrowthPlan::UPWARD };
    assert_eq!(growth.allowed_failures(), Some(ALLOWED));
    growth
}

/// Settings of `rounds` radii up to `radius`.
fn asked(system: &Still, radius: f32, rounds: u32) -> Settings {
    Settings { growth: growth(radius, rounds, 1.03, EPSILON), ..settings(system, 1) }
}

/// The radius that each seed verifies; `call` numbers draws of the same seed.
fn radii(system: Still, settings: &Settings, call: u32) -> Vec<Option<f32>> {
    let backend = cpu(1);
    let plant = Plant::of(system, Idle);
    let program = backend.prepare(&plant).expect("a program");
    let context = Context { program: &program, watch: &Unwatched };
    let request = |seed| Request { center: vec![0.0; 2], seed, call };
    let requests: Vec<Request> = (0..CERTIFICATES).map(request).collect();
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
    let mut any = vec![false; CERTIFICATES as usize];
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
    assert!(sound as u64 > CERTIFICATES * 9 / 10, "{sound}");
}

/// A growth over stored balls, one for each radius.
struct Grown {
    asked: GrowthSettings,
    pools: Vec<Pool>,
}

impl Grown {
    /// Growth for a risk just below that of the first ball that is to be refused, number `wrong`, and of all
    /// that come after it.
    fn new(balls: &Balls<'_>, radius: f32, rounds: u32, factor: f64, wrong: usize) -> Self {
        let radii = growth(radius, rounds, factor, EPSILON).radii();
        let pools: Vec<Pool> = radii.into_iter().map(|radius| balls.pool(radius)).collect();
        let least = pools[wrong..].iter().map(Pool::risk).fold(1.0, f64::min);
        Self { asked: growth(radius, rounds, factor, EPSILON / ABOVE * least), pools }
    }

    /// Certificates that verify a ball whose risk is above the one claimed, from `starts` starts a round.
    fn false_ones(&self, rule: Rule, starts: u64) -> u64 {
        let radii = self.asked.radii();
        false_ones(|random| {
            let failures = self.pools.iter().map(|pool| pool.failures(starts, random));
            let passes = |(_, failures): &(usize, u64)| *failures <= ALLOWED;
            let number = match rule {
                Rule::Sound => self.asked.verified_radius(failures).map(|verified| {
                    radii.iter().position(|radius| *radius == verified).expect("a radius")
                }),
                Rule::GoesOn => {
                    failures.enumerate().filter(passes).last().map(|(number, _)| number)
                }
            };
            number.is_some_and(|number| self.pools[number].risk() > self.asked.epsilon)
        })
    }
}

/// How radii are gone through.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    /// As they have to be.
    Sound,
    /// On after a refusal, to the largest radius that passes.
    GoesOn,
}

/// On each plant: balls that hold no failure to speak of, then one whose risk is just above the claim; and
/// balls whose risks are all just above it, where one refusal is the end.
#[test]
fn growth_holds_on_three_plants_where_the_risk_is_just_above() {
    of_each(|name, balls| {
        let critical = balls.critical();
        let climb = Grown::new(balls, critical, 3, 3.0, 2);
        let risks: Vec<f64> = climb.pools.iter().map(Pool::risk).collect();
        println!("{name}: radius {critical}, risks {risks:?}, claimed {}", climb.asked.epsilon);
        assert!(risks[1] < 0.02, "{name}: the balls before are no sure steps");
        let starts = climb.asked.scenarios;
        assert!(!violates(&format!("growth on {name}"), climb.false_ones(Rule::Sound, starts)));
        let half = climb.false_ones(Rule::Sound, starts / 2);
        assert!(violates(&format!("growth on {name}, from half the starts"), half));
        let wrong = Grown::new(balls, 1.03 * critical, 8, 1.004, 0);
        let count = |rule| wrong.false_ones(rule, wrong.asked.scenarios);
        assert!(!violates(&format!("growth on {name}, all wrong"), count(Rule::Sound)));
        assert!(violates(&format!("growth on {name}, on after a refusal"), count(Rule::GoesOn)));
    });
}

/// The radius that a sample is cut at is chosen on that very sample, the largest whose bound is low enough.
#[test]
fn radii_chosen_on_the_sample_are_found_out() {
    let backend = cpu(2);
    // So far above that the count over the starts of any ball within shows it.
    let plant = Plant::of(Still(Fails::Wedge(1.1 * EPSILON)), Idle);
    let balls = Balls::around(backend.prepare(&plant).expect("a program"), vec![0.0; 2]);
    let pool = balls.pool(1.0);
    let count = false_ones(|random| {
        let mut sample: Vec<_> = (0..400).map(|_| pool.draw(random)).collect();
        sample.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        let mut failures = 0;
        let passes = |(before, start): (usize, &crate::balls::Start)| {
            failures += u64::from(start.failed);
            let passes = certified_risk(before as u64 + 1, failures, BETA) <= EPSILON;
            passes.then_some(start.distance)
        };
        let chosen = sample.iter().enumerate().filter_map(passes).last();
        chosen.is_some_and(|radius| pool.within(radius) > EPSILON)
    });
    assert!(violates("radii of the sample", count));
}
