//! Deviation bounds: offsets in closed form, drawn by another generator.

use crate::common::{binomial_limit, cpu, literal, settings};
use crate::plants::{Idle, Relay};
use crate::{BETA, CERTIFICATES, EPSILON, violates};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::Error;
use reachcast::model::Plant;
use reachcast::scenario::bound::required_scenarios;
use reachcast::scenario::settings::{Joint, Settings};
use reachcast::scenario::{Context, Unwatched, deviation};
use reachcast::system::{DoubleIntegrator, System};

/// Offsets of the sample that the true risk of a deviation bound is taken from.
const OFFSETS: usize = 40_000;

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
    let program = backend.prepare(&Plant::of(system, Idle)).expect("a program");
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
    (0..CERTIFICATES).filter(is_false).count() as u64
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
