//! Certificates repeated over thousands of seeds: the share of false ones is at most beta.
//!
//! "False" is judged against a true risk that the test computes without the library: from a large
//! sample of another generator, by quadrature, or from a formula. The number of false certificates
//! among `SEEDS` is compared with the exact binomial quantile, and each harness is shown to report a
//! violation when it gets half the scenarios that the claim needs.

mod common;

use common::{ClosedForm, FALSE_ALARM, binomial_limit, cpu, literal, settings, supremum};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::Error;
use reachcast::backend::{Backend, Program};
use reachcast::model::Plant;
use reachcast::policy::Policy;
use reachcast::real::Real;
use reachcast::rollout::Tightening;
use reachcast::scenario::bound::{certified_risk, required_scenarios};
use reachcast::scenario::boundary::Boundary;
use reachcast::scenario::criterion::Criterion;
use reachcast::scenario::growth::{Growth, grow};
use reachcast::scenario::purpose;
use reachcast::scenario::settings::{Joint, Settings};
use reachcast::scenario::{Context, Unwatched, deviation, global};
use reachcast::system::{Axis, BangBang, DoubleIntegrator, System};
use statrs::distribution::{Beta, ContinuousCDF};
use std::f64::consts::PI;

/// Repetitions of each certificate.
const SEEDS: u64 = 2000;
/// Risk that the certificates claim.
const EPSILON: f64 = 0.1;
/// Chance that each may be false.
const BETA: f64 = 0.05;
/// Offsets of the sample that the true risk of a deviation bound is taken from.
const OFFSETS: usize = 40_000;

/// Whether `count` false certificates are more than a chance of [`BETA`] each explains.
fn violates(name: &str, count: u64) -> bool {
    let limit = binomial_limit(SEEDS, BETA);
    println!("{name}: {count} of {SEEDS} false, limit {limit}");
    count > limit
}

fn program<'a>(backend: &'a Backend, plant: &Plant) -> Program<'a> {
    backend.prepare(plant).expect("a program")
}

/// No control.
struct Idle;

impl<const NX: usize> Policy<NX, 1> for Idle {
    fn name(&self) -> String {
        "idle".to_owned()
    }
    fn control<R: Real>(&self, _x: [R; NX]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// Hands the next state's value to the first one, sixteen times as large, step after step.
///
/// The distance at step t = 1, 2, 3 is 16 times the offset of state t but for a hundredth: three
/// steps, three nearly independent directions, so a bound on all three has three support scenarios
/// and the scenario theory holds with equality.
#[derive(Clone, Copy)]
struct Relay;

impl System<4, 1> for Relay {
    fn name(&self) -> &str {
        "relay"
    }
    fn states(&self) -> [Axis; 4] {
        ["a", "b", "c", "d"].map(|name| Axis::new(name, "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("none", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [a, b, c, d]: [R; 4], [u]: [R; 1]) -> [R; 4] {
        [R::lit(16.0) * b, c, d, R::lit(0.0625) * a + u]
    }
    fn target<R: Real>(&self, [a, ..]: [R; 4]) -> R {
        R::lit(1.0) - a.abs()
    }
    fn constraint<R: Real>(&self, [a, ..]: [R; 4]) -> R {
        R::lit(2.0) - a.abs()
    }
}

/// Distances `|A^t e|` of offsets e that are uniform in the ball, `[T + 1, OFFSETS]`; drawn by
/// rejection from the cube with another generator than the library's.
fn offset_distances<S: System<NX, 1>, const NX: usize>(
    system: &S,
    radius: f64,
    horizon: usize,
) -> Vec<Vec<f32>> {
    let mut rng = StdRng::seed_from_u64(20_240_229);
    let origin = trace(system, [0.0; NX], horizon);
    let mut distances = vec![Vec::with_capacity(OFFSETS); horizon + 1];
    while distances[0].len() < OFFSETS {
        let offset: [f64; NX] = std::array::from_fn(|_| rng.random_range(-radius..radius));
        if offset.iter().map(|e| e * e).sum::<f64>() > radius * radius {
            continue;
        }
        let states = trace(system, offset, horizon);
        for ((distances, x), origin) in distances.iter_mut().zip(states).zip(&origin) {
            let square = |(x, o): (&f64, &f64)| (x - o) * (x - o);
            let distance = x.iter().zip(origin).map(square).sum::<f64>().sqrt();
            distances.push(distance as f32);
        }
    }
    distances
}

/// The states from `x` without control, in f64.
fn trace<S: System<NX, 1>, const NX: usize>(
    system: &S,
    mut x: [f64; NX],
    horizon: usize,
) -> Vec<[f64; NX]> {
    let mut states = vec![x];
    for _ in 0..horizon {
        x = system.step(x, [0.0]);
        states.push(x);
    }
    states
}

/// What a deviation bound has to satisfy.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Judge {
    /// All steps at once with risk [`EPSILON`].
    Together,
    /// Each step with an equal share of it: what Bonferroni asks of each of its programs.
    StepByStep,
}

/// Whether the offsets refute that `bound` is exceeded with probability at most [`EPSILON`].
fn refutes(bound: &[f64], distances: &[Vec<f32>], limits: [u64; 2], judge: Judge) -> bool {
    let beyond = |t: usize| {
        let bound = bound[t];
        distances[t].iter().map(move |d| f64::from(*d) > bound)
    };
    let count = |exceeded: &mut dyn Iterator<Item = bool>| exceeded.filter(|e| *e).count() as u64;
    match judge {
        Judge::StepByStep => (1..bound.len()).any(|t| count(&mut beyond(t)) > limits[1]),
        Judge::Together => {
            let mut any = vec![false; OFFSETS];
            for t in 1..bound.len() {
                for (any, beyond) in any.iter_mut().zip(beyond(t)) {
                    *any |= beyond;
                }
            }
            count(&mut any.into_iter()) > limits[0]
        }
    }
}

/// Settings that the library accepts with their number of scenarios: a looser risk than the one
/// that the bound is judged by.
fn loosened(context: Context<'_>, mut settings: Settings) -> Settings {
    while let Err(error) = deviation::bound(context, &settings) {
        assert!(
            matches!(error, Error::TooFewScenarios { .. }) && settings.deviation.epsilon < 0.9,
            "{error}"
        );
        settings.deviation.epsilon *= 1.02;
    }
    settings
}

/// Seeds whose deviation bound from `scenarios` pairs is false.
fn false_bounds<S: System<NX, 1> + Copy + Send + 'static, const NX: usize>(
    system: S,
    horizon: u32,
    joint: Joint,
    scenarios: u64,
    judge: Judge,
) -> u64 {
    let backend = cpu(1);
    let program = program(&backend, &Plant::of(system, Idle));
    let context = Context { program: &program, watch: &Unwatched };
    let mut settings = settings(&system, horizon);
    settings.deviation.epsilon = EPSILON;
    settings.deviation.beta = BETA;
    settings.deviation.joint = joint;
    settings.deviation.scenarios = scenarios;
    settings.deviation.pilot = 20;
    settings = loosened(context, settings);
    let radius = literal(settings.deviation.radius);
    let distances = offset_distances(&system, radius, horizon as usize);
    // More offsets than this beyond the bound have probability FALSE_ALARM if its risk is EPSILON.
    let share = [EPSILON, EPSILON / f64::from(horizon)];
    let limits = share.map(|risk| binomial_limit(OFFSETS as u64, risk));
    let is_false = |seed: &u64| {
        settings.seed = *seed;
        let record = deviation::bound(context, &settings).expect("bound");
        refutes(&record.bound, &distances, limits, judge)
    };
    (0..SEEDS).filter(is_false).count() as u64
}

/// The exact count of the fixed shape, for risk `EPSILON / parts` and confidence `BETA / parts`.
fn exact_count(parts: u32, decision_vars: u32) -> u64 {
    let parts = f64::from(parts);
    required_scenarios(EPSILON / parts, BETA / parts, decision_vars).expect("count")
}

/// One scalar: the chance of a false bound is 0.9^29 = 0.047 exactly, 0.9^14 = 0.23 with half.
#[test]
fn fixed_shape_bounds_are_false_at_most_as_often_as_claimed() {
    let scenarios = exact_count(1, 1);
    assert_eq!(scenarios, 29);
    let system = DoubleIntegrator::default();
    let count = |n| false_bounds(system, 8, Joint::FixedShape, n, Judge::Together);
    assert!(!violates("fixed shape", count(scenarios)));
    assert!(violates("fixed shape, half", count(scenarios / 2)));
    let count = |n| false_bounds(Relay, 3, Joint::FixedShape, n, Judge::Together);
    assert!(!violates("fixed shape, relay", count(scenarios)));
    assert!(violates("fixed shape, relay, half", count(scenarios / 2)));
}

/// Three decision variables, each with its support scenario.
#[test]
fn bounds_by_variables_are_false_at_most_as_often_as_claimed() {
    let scenarios = exact_count(1, 3);
    let count = |n| false_bounds(Relay, 3, Joint::Variables, n, Judge::Together);
    assert!(!violates("variables", count(scenarios)));
    assert!(violates("variables, half", count(scenarios / 2)));
}

/// Three programs at a third of the risk. Their joint claim is far from tight, the claim of each
/// step is what its count is chosen for.
#[test]
fn bonferroni_bounds_are_false_at_most_as_often_as_claimed() {
    let scenarios = exact_count(3, 1);
    let count = |n, judge| false_bounds(Relay, 3, Joint::Bonferroni, n, judge);
    assert!(!violates("Bonferroni", count(scenarios, Judge::Together)));
    let steps = count(scenarios, Judge::StepByStep);
    assert!(!violates("Bonferroni by step", steps));
    let half = count(scenarios / 2, Judge::StepByStep);
    assert!(violates("Bonferroni by step, half", half));
}

/// The published count bounds each step by itself; taken as a joint statement it is false far more
/// often than claimed.
#[test]
fn separate_bounds_make_no_joint_statement() {
    let count = |judge| false_bounds(Relay, 3, Joint::Separate, exact_count(1, 1), judge);
    assert!(violates("separate, jointly", count(Judge::Together)));
}

/// Largest perturbation of the conditional test: large, so that failures are common.
const PERTURBATION: f64 = 0.3;
/// Steps of the conditional test.
const STEPS: usize = 15;
/// Constant of both margins there: far below the valid 1.
const SMALL_CONSTANT: f64 = 0.02;

/// The conditional failure in truth: failures and certified starts among a million pairs, rolled
/// out by a loop of the test's own.
fn conditional_failures(tightening: &Tightening) -> [u64; 2] {
    let mut rng = StdRng::seed_from_u64(7_777);
    let dt = literal(0.1);
    let (mut failures, mut certified) = (0, 0);
    for _ in 0..2_000_000 {
        let nominal = [rng.random_range(-1.2..1.2), rng.random_range(-1.5..1.5)];
        let offset = loop {
            let offset: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            if offset[0] * offset[0] + offset[1] * offset[1] <= 1.0 {
                break offset.map(|e| PERTURBATION * e);
            }
        };
        let mut states = [nominal, [nominal[0] + offset[0], nominal[1] + offset[1]]];
        let (mut alive, mut reached) = ([true; 2], [false; 2]);
        for t in 0..=STEPS {
            let loss = [[tightening.target[t], tightening.constraint[t]].map(f64::from), [0.0; 2]];
            for (i, [position, _]) in states.iter().enumerate() {
                alive[i] &= 1.0 - position.abs() - loss[i][1] > 0.0;
                reached[i] |= alive[i] && 0.25 - position.abs() - loss[i][0] > 0.0;
            }
            let control = if states[0][0] < 0.0 { 1.0 } else { -1.0 };
            for [position, velocity] in &mut states {
                *position += dt * *velocity;
                *velocity += dt * control;
            }
        }
        certified += u64::from(reached[0]);
        failures += u64::from(reached[0] && !reached[1]);
    }
    assert!(certified >= 1_000_000, "only {certified} certified starts");
    [failures, certified]
}

/// The conditional failure bound and the interval of the certified share, over all seeds.
#[test]
fn conditional_failure_bounds_are_false_at_most_as_often_as_claimed() {
    let backend = cpu(1);
    let system = DoubleIntegrator::default();
    let program = program(&backend, &Plant::of(system, BangBang { acceleration: 1.0 }));
    let context = Context { program: &program, watch: &Unwatched };
    let mut settings = settings(&system, STEPS as u32);
    settings.deviation.radius = PERTURBATION as f32;
    settings.global.beta = BETA;
    settings.global.draws = 150;
    let bound = supremum(&system, PERTURBATION, STEPS as u32);
    let tightening = deviation::tightening(&bound, SMALL_CONSTANT, SMALL_CONSTANT, &settings.spec);
    let [failures, certified] = conditional_failures(&tightening);
    let criterion = Criterion::Margins(tightening.clone());
    // Clopper and Pearson's lower end: the true probability is at least this.
    let below = Beta::new(failures as f64, (certified - failures + 1) as f64).expect("beta");
    let truth = below.inverse_cdf(FALSE_ALARM);
    println!("conditional failure: {failures} of {certified}, at least {truth}");
    assert!(truth > 0.03 && truth < 0.5, "{truth}");
    let loss: Vec<f64> = tightening.target.iter().copied().map(f64::from).collect();
    let share = ClosedForm::of(&system).share(literal(1.2), literal(1.5), &loss);
    let (mut false_bounds, mut false_halves, mut false_shares) = (0, 0, 0);
    for seed in 0..SEEDS {
        settings.seed = seed;
        let purposes = [purpose::CONDITIONAL_NOMINAL, purpose::CONDITIONAL_PERTURBATION];
        let record = global::conditional(context, &settings, &criterion, purposes)
            .expect("conditional failure");
        let (n, k) = (record.accepted, record.claim.failures);
        assert_eq!(record.claim.certified_risk, certified_risk(n, k, BETA));
        false_bounds += u64::from(record.claim.certified_risk < truth);
        // Half the pairs that the claim says it has.
        false_halves += u64::from(certified_risk(2 * n, 2 * k, BETA) < truth);
        let [low, high] = record.share_interval;
        false_shares += u64::from(!(low..=high).contains(&share));
    }
    assert!(!violates("conditional failure", false_bounds));
    assert!(violates("conditional failure, half", false_halves));
    assert!(!violates("certified share", false_shares));
}

/// A state that stays where it is, in a plane of which a wedge with its tip at the origin fails.
///
/// The same share of every ball around the tip fails, so that every round of the growth is as
/// likely as the first to come out clean by luck.
#[derive(Clone, Copy)]
struct Wedge {
    /// Share of the full angle.
    share: f64,
}

impl System<2, 1> for Wedge {
    fn name(&self) -> &str {
        "wedge"
    }
    fn states(&self) -> [Axis; 2] {
        ["x", "y"].map(|name| Axis::new(name, "m", -1.0, 1.0))
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
        y.abs() - R::lit((PI * self.share).tan() as f32) * x
    }
}

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
    let program = program(&backend, plant);
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
    for seed in 0..SEEDS {
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
    let system = Wedge { share };
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
