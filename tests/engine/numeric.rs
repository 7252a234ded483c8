//! Numbers that are not finite or hardly numbers: policies, dynamics, margins and costs that
//! overflow, give NaN or underflow, on every backend alike.
//!
//! Formulas here have + - * / sqrt and comparisons alone, so that host and adapter see the same
//! numbers; expectations are computed in the test, in f32.

use crate::common::{adapter, backends, settings};
use reachcast::backend::Backend;
use reachcast::backend::gpu::NetworkKernels;
use reachcast::cost::Cost;
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp, Policy};
use reachcast::real::Real;
use reachcast::report::html;
use reachcast::rollout::{
    CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, NON_FINITE, Planning, Purpose, Query,
    ReachAvoidTask, RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::scenario::global::check_margins;
use reachcast::scenario::record::Record;
use reachcast::scenario::{Context, Unwatched, certify};
use reachcast::system::{Axis, System};

/// What a [`Line`] does at each step and how it is judged.
#[derive(Clone, Copy, Debug)]
enum Motion {
    /// Moves by `u`; the target lies above 0.5.
    Driven,
    /// Is squared: above 1 it overflows, below 1 it underflows. The target lies between 100 and 300.
    Squared,
    /// Shrinks by 1e-10. The target lies above 0.
    Shrinking,
    /// Stays; the target margin overflows above 1.
    TargetOverflows,
    /// Stays; the constraint margin overflows downward above 1. The target lies above 0.5.
    ConstraintOverflows,
    /// Stays; the target margin is NaN below 0.
    TargetUnknown,
    /// Stays; the constraint margin is NaN below 0. The target lies above -0.5.
    ConstraintUnknown,
}

/// One state on a line.
struct Line(Motion);

impl System<1, 1> for Line {
    fn name(&self) -> &str {
        "line"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -2.0, 2.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        match self.0 {
            Motion::Driven => [x + R::lit(0.1) * u],
            Motion::Squared => [x * x + R::lit(0.0) * u],
            Motion::Shrinking => [x * R::lit(1e-10) + R::lit(0.0) * u],
            _ => [x + R::lit(0.0) * u],
        }
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        match self.0 {
            Motion::Squared => R::lit(100.0) - (x - R::lit(200.0)).abs(),
            Motion::Shrinking => x,
            Motion::TargetOverflows => x * R::lit(3.0e38),
            Motion::Driven | Motion::ConstraintOverflows => x - R::lit(0.5),
            Motion::TargetUnknown => x.sqrt(),
            Motion::ConstraintUnknown => x + R::lit(0.5),
        }
    }
    fn constraint<R: Real>(&self, [x]: [R; 1]) -> R {
        match self.0 {
            Motion::ConstraintOverflows => R::lit(1.0) - x * R::lit(3.0e38),
            Motion::ConstraintUnknown => x.sqrt(),
            _ => R::lit(1e6) + R::lit(0.0) * x,
        }
    }
}

/// Root of the state: NaN below 0.
#[derive(Clone)]
struct Root;

impl Policy<1, 1> for Root {
    fn name(&self) -> String {
        "root".to_owned()
    }
    fn control<R: Real>(&self, [x]: [R; 1]) -> [R; 1] {
        [x.sqrt()]
    }
}

/// No control.
#[derive(Clone)]
struct Idle;

impl Policy<1, 1> for Idle {
    fn name(&self) -> String {
        "idle".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 1]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// A network with a first layer of the weights `hidden`, a second that adds up half of each,
/// and the output weights `output`.
fn network(hidden: &[f32], output: &[f32]) -> Mlp {
    let width = hidden.len();
    let layer = |weight: Vec<f32>, inputs: usize| {
        let outputs = weight.len() / inputs;
        Layer::dense(weight, vec![0.0; outputs])
    };
    let passed = layer(vec![0.5; width * width], width);
    let layers = vec![layer(hidden.to_vec(), 1), passed, layer(output.to_vec(), width)];
    Mlp::new(layers, Activation::Relu, Activation::Tanh).expect("a whole network")
}

/// 401 starts over [-2, 2].
fn starts() -> Vec<[f32; 1]> {
    (0..=400).map(|i| [i as f32 / 100.0 - 2.0]).collect()
}

/// The backends, an adapter once for each way to run a network.
fn every_way() -> Vec<Backend> {
    let mut all = backends();
    if all.len() > 1 {
        let gpu = adapter().expect("it opened before");
        all.push(Backend::Gpu(gpu.with_networks(NetworkKernels::Fused)));
    }
    all
}

/// The measures, or their signs, of the starts.
fn measures(
    backend: &Backend,
    plant: &Plant,
    (query, tightening): (Query, &Tightening),
) -> Vec<f32> {
    let starts = starts();
    let spec = spec(tightening);
    let range = 0..starts.len() as u64;
    let task = ReachAvoidTask { starts: Starts::listed(&starts), range, spec, tightening, query };
    let mut all = Vec::new();
    let program = backend.prepare(plant).expect("it fits");
    let ran = program.reach_avoid(&task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    });
    ran.expect("a batch that runs");
    all
}

fn spec(tightening: &Tightening) -> RolloutSpec {
    RolloutSpec::new(tightening.target.len() as u32 - 1, 1.0).expect("a horizon")
}

/// Nothing lost over `horizon` steps.
fn none(horizon: u32) -> Tightening {
    Tightening::none(&RolloutSpec::new(horizon, 1.0).expect("a horizon"))
}

/// What section 1 of the method says, one state after the other.
fn expected<P: Policy<1, 1>>(motion: Motion, policy: &P, start: f32, horizon: u32) -> f32 {
    let (system, mut x) = (Line(motion), [start]);
    let (mut safe, mut best) = (f32::INFINITY, NON_FINITE);
    for t in 0..=horizon {
        let (r, c): (f32, f32) = (system.target(x), system.constraint(x));
        if !x[0].is_finite() || r.is_nan() || c.is_nan() {
            return if best > 0.0 { best } else { NON_FINITE };
        }
        // An infinite margin is satisfied or violated.
        let [r, c] = [r, c].map(|margin| margin.clamp(f32::MIN, f32::MAX));
        safe = safe.min(c);
        best = best.max(safe.min(r));
        if t < horizon {
            x = system.step(x, policy.control(x));
        }
    }
    best
}

/// Holds every backend against the definition; the number of starts with the least measure that there
/// is, that of rollouts which are not finite.
fn check<P>(motion: Motion, policy: &P, horizon: u32) -> usize
where
    P: Policy<1, 1> + Clone + Send + Sync + 'static,
{
    let (tightening, plant) = (none(horizon), Plant::of(Line(motion), policy.clone()));
    let truth: Vec<f32> =
        starts().iter().map(|[x]| expected(motion, policy, *x, horizon)).collect();
    for backend in every_way() {
        let name = backend.device();
        let found = measures(&backend, &plant, (Query::Measure, &tightening));
        for ((start, truth), found) in starts().iter().zip(&truth).zip(&found) {
            let close = (found - truth).abs() <= 1e-5 * truth.abs().max(1.0);
            assert!(close, "{motion:?} from {start:?} on {name}: {found}, not {truth}");
        }
        let signs = measures(&backend, &plant, (Query::Sign, &tightening));
        for (truth, sign) in truth.iter().zip(&signs) {
            assert_eq!(*truth > 0.0, *sign > 0.0, "{motion:?} on {name}");
        }
    }
    truth.iter().filter(|value| **value == NON_FINITE).count()
}

#[test]
fn a_policy_that_is_not_a_number_fails() {
    // Below 0; from 0.5 on the start is in the target, before any control.
    assert_eq!(check(Motion::Driven, &Root, 3), 200);
}

#[test]
fn a_network_that_is_not_a_number_fails() {
    // Infinity less infinity, for states below -3.4e38 / 3e38.
    let lost = network(&[-3e38, -3e38], &[1.0, -1.0]);
    assert_eq!(check(Motion::Driven, &lost, 3), 87);
}

/// A neuron that overflows saturates the output: neurons that pad a layer must not make it NaN.
#[test]
fn a_neuron_that_overflows_saturates() {
    for width in [1, 2, 3, 5, 8] {
        let saturated = network(&vec![3e38; width], &vec![1.0; width]);
        assert_eq!(check(Motion::Driven, &saturated, 3), 0, "{width} neurons");
    }
}

#[test]
fn dynamics_that_overflow_fail() {
    // Of the states beyond 1 those that pass through the target before they overflow succeed.
    let lost = check(Motion::Squared, &Idle, 12);
    assert!((1..200).contains(&lost), "{lost}");
}

#[test]
fn margins_that_overflow_are_satisfied_or_violated() {
    // The 87 starts beyond 3.4e38 / 3e38 on the side where the margin is positive are as those
    // before them. Downward all 200 count, since a margin below -1e30 is the least there is.
    assert_eq!(check(Motion::TargetOverflows, &Idle, 2), 200);
    assert_eq!(check(Motion::ConstraintOverflows, &Idle, 2), 200);
    for start in [1.0, 2.0] {
        assert!(expected(Motion::TargetOverflows, &Idle, start, 2) == 1e6, "from {start}");
        assert!(expected(Motion::ConstraintOverflows, &Idle, -start, 2) == -start - 0.5);
    }
}

#[test]
fn margins_that_are_not_numbers_fail() {
    assert_eq!(check(Motion::TargetUnknown, &Idle, 2), 200);
    assert_eq!(check(Motion::ConstraintUnknown, &Idle, 2), 200);
}

/// The range of subnormal numbers may be lost, nothing else; within a band nothing is.
#[test]
fn subnormal_numbers_are_zero_at_worst() {
    // Only the fourth step counts, at 1e-40 times the start.
    let mut tightening = none(4);
    tightening.target[..4].fill(10.0);
    let plant = Plant::of(Line(Motion::Shrinking), Idle);
    for backend in backends() {
        let found = measures(&backend, &plant, (Query::Measure, &tightening));
        let mut flushed = 0;
        for ([start], found) in starts().iter().zip(&found) {
            let exact = f64::from(*start) * 1e-40;
            assert!((f64::from(*found) - exact).abs() <= f64::from(f32::MIN_POSITIVE));
            assert!(*found <= 0.0 || *start > 0.0, "never a success that is none");
            flushed += u32::from(*found == 0.0 && *start != 0.0);
        }
        println!("{}: {flushed} of {} subnormal measures are 0", backend.device(), found.len());
        // A certificate decides them in f64.
        let program = backend.prepare(&plant).expect("a program");
        let context = Context { program: &program, watch: &Unwatched };
        let spec = spec(&tightening);
        let (starts, query) = (starts(), Query::Measure);
        let margins = check_margins(context, &spec, &tightening, (&starts).into(), query, 1e-5);
        for ([start], margin) in starts.iter().zip(margins.expect("margins")) {
            assert_eq!(*start > 0.0, margin > 0.0, "{start} on {}", backend.device());
        }
    }
}

/// Two states that stay where they are. The target lies below 0.5 in the first; far out
/// in the first the constraint margin overflows.
struct Plane {
    /// Where that begins.
    edge: f32,
}

impl System<2, 1> for Plane {
    fn name(&self) -> &str {
        "plane"
    }
    fn states(&self) -> [Axis; 2] {
        [Axis::new("x", "m", -0.9, 0.9), Axis::new("y", "m", -0.9, 0.9)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x, y]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        [x + R::lit(0.0) * u, y]
    }
    fn target<R: Real>(&self, [x, _]: [R; 2]) -> R {
        R::lit(0.5) - x
    }
    fn constraint<R: Real>(&self, [x, _]: [R; 2]) -> R {
        x.if_lt(R::lit(self.edge), R::lit(10.0), R::lit(-3.0e38) * (x + R::lit(1.0)))
    }
}

struct Still;

impl Policy<2, 1> for Still {
    fn name(&self) -> String {
        "still".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 2]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// The certificate of the plane on every backend.
fn certificates(edge: f32) -> Vec<Record> {
    let system = Plane { edge };
    let mut settings = settings(&system, 2);
    settings.state = vec![0.45, 0.0];
    settings.deviation.radius = 0.02;
    settings.growth.radius = 0.9;
    let plant = Plant::of(system, Still);
    let certify = |backend: &Backend| {
        let program = backend.prepare(&plant).expect("a program");
        certify(&program, &settings, serde_json::json!({}), &Unwatched).expect("a record")
    };
    backends().iter().map(certify).collect()
}

/// Counts of a record that meet what is not finite: pairs of the deviation bound, perturbed
/// rollouts, starts of each round of growth.
fn non_finite(record: &Record) -> (u64, u64, Vec<u64>) {
    let rounds = record.growth.rounds.iter().map(|round| round.non_finite).collect();
    (record.deviation.non_finite, record.global.non_finite, rounds)
}

#[test]
fn certificates_count_what_is_not_finite() {
    // Beyond 0.95: no pair comes there, the first ball reaches beyond 1.2.
    let outside = certificates(0.95);
    for record in &outside {
        assert!(record.global.accepted > 0, "{:?}", record.statements);
        let (pairs, perturbed, rounds) = non_finite(record);
        assert_eq!((pairs, perturbed), (0, 0));
        assert!(rounds[0] > 0, "{rounds:?}");
        assert_eq!(non_finite(record), non_finite(&outside[0]));
    }
    // Beyond 0.8, in the box: the certificate does not hold.
    let inside = certificates(0.8);
    for record in &inside {
        let (pairs, perturbed, _) = non_finite(record);
        assert!(pairs > 0 && perturbed > 0);
        assert!(!record.holds, "{:?}", record.statements);
        assert_eq!(non_finite(record), non_finite(&inside[0]));
        assert_eq!(record.deviation.claim.failures, inside[0].deviation.claim.failures);
        let page = html(record);
        for (name, count) in
            [("pairs not finite", pairs), ("failures that are not finite", perturbed)]
        {
            assert!(page.contains(name) && page.contains(&count.to_string()), "{name}");
        }
    }
}

/// Squares of state and control.
#[derive(Clone)]
struct Squares;

impl Cost<1, 1, 1> for Squares {
    fn stage<R: Real>(&self, [x]: [R; 1], [u]: [R; 1], _: [R; 1]) -> R {
        x * x + u * u
    }
}

/// State and control squared: beyond 1 that overflows after a few steps.
#[derive(Clone)]
struct Kicked;

impl System<1, 1> for Kicked {
    fn name(&self) -> &str {
        "kicked"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -2.0, 2.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [(x + u) * (x + u)]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [x]: [R; 1]) -> R {
        x
    }
}

#[test]
fn samples_that_overflow_have_no_weight() {
    let spec = MppiSpec::new(MppiSettings::new(&Kicked.controls(), 300, 12)).expect("settings");
    let planning = Planning::of(&Kicked, Squares, spec);
    let problem = |start: f32, number| {
        let stream = Stream::new(71, Purpose::CONTROL_NOISE, number);
        MppiProblem::new([start], &[[0.25]; 12], &[[0.0]; 12], stream)
    };
    // Some samples overflow, then all of them.
    let problems = [problem(0.3, 0), problem(100.0, 1)];
    let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Each };
    let run = |backend: &Backend| {
        let program = backend.prepare_plans(&planning).expect("a program");
        program.improve(&task).expect("plans")
    };
    let results: Vec<_> = backends().iter().map(run).collect();
    for result in &results {
        let [some, all] = &result[..] else { panic!("two problems") };
        assert!((1..300).contains(&some.non_finite), "{}", some.non_finite);
        assert_eq!(some.non_finite, results[0][0].non_finite);
        let weights = some.weights(1.0);
        let lost = |(cost, weight): (&f32, &f64)| cost.is_finite() || *weight == 0.0;
        assert!(some.costs.iter().zip(&weights).all(lost));
        let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-5;
        assert!(some.plan.iter().zip(&results[0][0].plan).all(near), "{:?}", some.plan);
        // Nothing to weigh: the plan stays, and the result says so.
        assert_eq!((all.non_finite, all.effective_samples), (300, 0.0));
        assert_eq!(all.plan, problems[1].plan);
        assert!(all.least_cost.is_infinite() && all.mean_cost == 0.0);
    }
}
