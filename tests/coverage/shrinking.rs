//! Growth by Algorithm 1: every round is paid for.

use crate::common::{ClosedForm, cpu, settings};
use crate::plants::{Fails, Idle, Still};
use crate::{BETA, CERTIFICATES, EPSILON, violates};
use reachcast::Error;
use reachcast::model::Plant;
use reachcast::scenario::bound::required_scenarios;
use reachcast::scenario::boundary::Boundary;
use reachcast::scenario::growth::{Growth, grow};
use reachcast::scenario::settings::Settings;
use reachcast::scenario::{Context, Unwatched};
use reachcast::system::{BangBang, DoubleIntegrator};

/// How beta is spent on the rounds of a growth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Spending {
    /// An equal part each.
    Split,
    /// All of it each, as published.
    Whole,
}

/// Rounds of a growth.
const ROUNDS: u32 = 3;
/// How much more of the first ball fails than the claim allows: enough for quadrature to tell.
const EXCESS: f64 = 1.02;

/// A growth that is repeated.
#[derive(Clone, Copy, Debug)]
struct Trial {
    center: [f32; 2],
    radius: f32,
    scenarios: u64,
    spending: Spending,
}

/// Seeds of which the growth verifies a ball that is false by `failure`, the share of a ball of a
/// given radius that fails.
fn false_balls(plant: &Plant, asked: &Settings, trial: Trial, failure: impl Fn(f64) -> f64) -> u64 {
    let backend = cpu(1);
    let program = backend.prepare(plant).expect("a program");
    let context = Context { program: &program, watch: &Unwatched };
    let mut settings = asked.clone();
    settings.growth.radius = trial.radius;
    settings.growth.rounds = ROUNDS;
    settings.growth.scenarios = trial.scenarios;
    settings.growth.epsilon = EPSILON;
    settings.growth.beta = BETA;
    settings.growth.split_beta = trial.spending == Spending::Split;
    let boundary = Boundary { point: trial.center.to_vec(), distance: 0.0 };
    let mut false_balls = 0;
    for seed in 0..CERTIFICATES {
        settings.seed = seed;
        let growth = loop {
            // A looser risk than the one judged by, where the count asks for it.
            match grow(context, &settings, &boundary, 1e-5, 0) {
                Err(Error::TooFewScenarios { .. }) => settings.growth.epsilon *= 1.02,
                grown => break grown.expect("growth").outcome,
            }
        };
        if let Growth::Verified(ball) = growth {
            false_balls += u64::from(failure(f64::from(ball.radius)) > EPSILON);
        }
    }
    false_balls
}

/// Share of the disc of `radius` around `center` that lies at or above `reach(v)`: midpoint sums of
/// the chords.
fn disc_failure(form: &ClosedForm, [p, v]: [f64; 2], radius: f64, loss: &[f64]) -> f64 {
    const NODES: usize = 400;
    let (mut beyond, mut whole) = (0.0, 0.0);
    for i in 0..NODES {
        let offset = radius * ((2 * i + 1) as f64 / NODES as f64 - 1.0);
        let half = (radius * radius - offset * offset).sqrt();
        beyond += (p + half - form.reach(v + offset, loss)).clamp(0.0, 2.0 * half);
        whole += 2.0 * half;
    }
    beyond / whole
}

/// Starts of one round for the claim.
fn round_count(spending: Spending) -> u64 {
    let beta = match spending {
        Spending::Split => BETA / f64::from(ROUNDS),
        Spending::Whole => BETA,
    };
    required_scenarios(EPSILON, beta, 1).expect("count")
}

/// The double integrator near the edge of its known set.
#[test]
fn grown_balls_are_false_at_most_as_often_as_claimed() {
    let system = DoubleIntegrator::default();
    let plant = Plant::of(system, BangBang { acceleration: 1.0 });
    let form = ClosedForm::of(&system);
    let horizon = 20;
    let settings = settings(&system, horizon);
    let loss = vec![0.0; horizon as usize + 1];
    let center = [0.6_f32, 0.3];
    let failure = |radius: f64| disc_failure(&form, center.map(f64::from), radius, &loss);
    // The radius at which a little more than EPSILON fails; the ball stays on the side p > 0.
    let [mut low, mut high] = [0.0, 0.59];
    assert!(failure(high) > EXCESS * EPSILON);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if failure(middle) > EXCESS * EPSILON { &mut high } else { &mut low }) = middle;
    }
    let trial = Trial {
        center,
        radius: high as f32,
        scenarios: round_count(Spending::Split),
        spending: Spending::Split,
    };
    println!("radius {high}: {} fails", failure(f64::from(trial.radius)));
    assert!(failure(f64::from(trial.radius)) > EPSILON);
    let half = Trial { scenarios: trial.scenarios / 2, ..trial };
    assert!(!violates("growth", false_balls(&plant, &settings, trial, failure)));
    assert!(violates("growth, half", false_balls(&plant, &settings, half, failure)));
}

/// A wedge, where every round is at risk: the claim is tight over all rounds, and spending the whole
/// of beta on each of them (as published) is found out.
#[test]
fn every_round_of_growth_is_paid_for() {
    let share = EXCESS * EPSILON;
    let system = Still(Fails::Wedge(share));
    let plant = Plant::of(system, Idle);
    let settings = settings(&system, 1);
    let trial = |scenarios, spending| Trial { center: [0.0; 2], radius: 0.5, scenarios, spending };
    let count = |trial| false_balls(&plant, &settings, trial, |_| share);
    let scenarios = round_count(Spending::Split);
    let split = trial(scenarios, Spending::Split);
    assert!(!violates("wedge", count(split)));
    let half = trial(scenarios / 2, Spending::Split);
    assert!(violates("wedge, half", count(half)));
    let whole = trial(round_count(Spending::Whole), Spending::Whole);
    assert!(violates("wedge, beta not split", count(whole)));
}
