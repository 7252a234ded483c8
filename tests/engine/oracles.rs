//! Oracles: numbers that are known without the library, and scalar f64 loops beside every backend.

use crate::common::{
    ClosedForm, FALSE_ALARM, backends, cpu, literal, race_policy, race_settings, settings, supremum,
};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use reachcast::backend::{Backend, Program};
use reachcast::model::{Controller, Model, Plant};
use reachcast::policy::{Activation, Layer, Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{
    DeviationTask, Farthest, PairControl, PairMeasure, Pairs, Purpose, Query, ReachAvoidTask,
    Region, RolloutSpec, Starts, StateList, Stream, Tightening,
};
use reachcast::scenario::settings::{Joint, Settings};
use reachcast::scenario::{Context, Unwatched, certify, deviation, global};
use reachcast::system::{Axis, BangBang, DoubleIntegrator, System};
use statrs::distribution::{ContinuousCDF, Normal};
use std::array::from_fn;

/// Race, radius 0.1: step, exact supremum, scenario estimate with 159 pairs averaged over 400
/// independent draws (`docs/method.md`, section 9).
const RACE_DEVIATION: [(usize, f64, f64); 10] = [
    (0, 0.1, 0.0999),
    (1, 0.1468, 0.1258),
    (2, 0.1105, 0.1019),
    (3, 0.1161, 0.1073),
    (5, 0.1281, 0.1129),
    (10, 0.1618, 0.1373),
    (15, 0.2000, 0.1675),
    (20, 0.2414, 0.2012),
    (25, 0.2851, 0.2370),
    (30, 0.3303, 0.2743),
];
/// Half a unit of the last digit of these numbers.
const LAST_DIGIT: f64 = 5e-5;

fn program<'a>(backend: &'a Backend, plant: &Plant) -> Program<'a> {
    backend.prepare(plant).expect("a program")
}

fn context<'a>(program: &'a Program<'a>) -> Context<'a> {
    Context { program, watch: &Unwatched }
}

/// A network of the race with random weights.
fn random_policy(seed: u64) -> Mlp {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut layer = |inputs: usize, outputs: usize| {
        Layer::dense(
            (0..inputs * outputs).map(|_| rng.random_range(-1.0..1.0)).collect(),
            (0..outputs).map(|_| rng.random_range(-1.0..1.0)).collect(),
        )
    };
    let layers = vec![layer(12, 9), layer(9, 3)];
    Mlp::new(layers, Activation::Tanh, Activation::Tanh).expect("network")
}

/// Proportional feedback of the ego toward the gate: a formula policy of the race.
#[derive(Clone)]
struct Steer;

impl Policy<12, 3> for Steer {
    fn name(&self) -> String {
        "steer".to_owned()
    }
    #[inline(always)]
    fn control<R: Real>(&self, x: [R; 12]) -> [R; 3] {
        let [x, vx, _, vy, z, vz, ..] = x;
        let gain = R::lit(1.5);
        [-(gain * x + vx), R::lit(0.7) - vy, (gain * z + vz).tanh() * R::lit(-1.0)]
    }
}

/// Damped feedback of the double integrator: continuous, unlike [`BangBang`].
#[derive(Clone)]
struct Damped;

impl Policy<2, 1> for Damped {
    fn name(&self) -> String {
        "damped".to_owned()
    }
    #[inline(always)]
    fn control<R: Real>(&self, [position, velocity]: [R; 2]) -> [R; 1] {
        [-(R::lit(2.0) * position + R::lit(1.5) * velocity)]
    }
}

/// The scenario estimate of 159 pairs, each step by itself.
fn estimate(program: &Program<'_>, seed: u64) -> Vec<f64> {
    let mut settings = race_settings(&DroneRace::default());
    settings.seed = seed;
    settings.deviation.radius = 0.1;
    settings.deviation.joint = Joint::Separate;
    settings.deviation.scenarios = 159;
    let record = deviation::bound(context(program), &settings).expect("bound");
    record.largest
}

#[test]
fn race_deviation_stays_below_its_supremum_for_any_policy() {
    let system = DroneRace::default();
    let exact = supremum(&system, literal(0.1), 30);
    for (t, published, _) in RACE_DEVIATION {
        let off = (exact[t] - published).abs();
        // The system's constants are f32: 3e-8 relative at most, grown by no more than 30 steps.
        assert!(off <= LAST_DIGIT + 1e-6, "step {t}: {}", exact[t]);
    }
    for backend in &backends() {
        let plants = [
            Plant::of(DroneRace::default(), race_policy()),
            Plant::of(DroneRace::default(), random_policy(11)),
            Plant::of(DroneRace::default(), Steer),
        ];
        let largest =
            (3..).zip(&plants).map(|(seed, plant)| estimate(&program(backend, plant), seed));
        let largest: Vec<Vec<f64>> = largest.collect();
        for (policy, largest) in largest.iter().enumerate() {
            for (t, (largest, exact)) in largest.iter().zip(&exact).enumerate() {
                assert!(largest < exact, "policy {policy}, step {t}: {largest} of {exact}");
                // Far below the averages of the next test: only a broken rollout comes here.
                assert!(*largest > 0.5 * exact, "policy {policy}, step {t}: {largest} of {exact}");
            }
        }
    }
}

/// Ours and the published average are means of 400 independent draws each of the same distribution:
/// their difference has the standard error `sqrt(2) s / 20`, with s from our draws.
#[test]
fn race_deviation_averages_are_the_published_ones() {
    const DRAWS: usize = 400;
    let plant = Plant::of(DroneRace::default(), Steer);
    let quantile = Normal::standard().inverse_cdf(1.0 - FALSE_ALARM / 2.0);
    for backend in &backends() {
        let program = program(backend, &plant);
        let draws: Vec<Vec<f64>> =
            (0..DRAWS).map(|seed| estimate(&program, 1000 + seed as u64)).collect();
        for (t, _, published) in RACE_DEVIATION {
            let values: Vec<f64> = draws.iter().map(|draw| draw[t]).collect();
            let mean = values.iter().sum::<f64>() / DRAWS as f64;
            let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
            let error = (square / (DRAWS - 1) as f64 / DRAWS as f64).sqrt();
            let limit = quantile * (2.0 * error * error).sqrt() + LAST_DIGIT;
            println!("step {t}: {mean:.5} +- {error:.5}, published {published}");
            assert!((mean - published).abs() <= limit, "step {t}: {mean} +- {error}");
        }
    }
}

/// Lattice that the dynamics of the double integrator map to itself: position P / 500 m, velocity
/// V / 50 m/s and acceleration j / 5 m/s^2 with dt = 0.1 s give `P += V, V += j`.
mod lattice {
    /// Half widths of target and corridor, in lattice units.
    pub(crate) const TARGET: i32 = 125;
    pub(crate) const CORRIDOR: i32 = 500;
    /// Largest change of velocity per step.
    pub(crate) const PUSH: i32 = 5;
    /// Largest velocity of a start: 1.5 m/s.
    pub(crate) const SPEED: i32 = 75;
    pub(crate) const STEPS: i32 = 30;
    /// Velocities that a start can come to.
    const REACHED: i32 = SPEED + STEPS * PUSH;
    /// Stands for every state off the lattice: all are beyond the corridor, but for velocities that
    /// no start comes to in the steps left.
    const OUTSIDE: i32 = -1;

    /// Value of the reach-avoid problem over all controls, by value iteration
    /// `W <- min(c, max(r, max over j of W(P + V, V + j)))`, from `W = min(r, c)`.
    pub(crate) struct Value(Vec<i32>);

    impl Value {
        pub(crate) fn iterate() -> Self {
            let columns = 2 * REACHED + 1;
            let size = ((2 * CORRIDOR - 1) * columns) as usize;
            let mut value = Self(vec![OUTSIDE; size]);
            for step in 0..=STEPS {
                let mut next = value.0.clone();
                for position in 1 - CORRIDOR..CORRIDOR {
                    let target = TARGET - position.abs();
                    let safe = CORRIDOR - position.abs();
                    for velocity in -REACHED..=REACHED {
                        let onward = |push| value.at(position + velocity, velocity + push);
                        let best = (-PUSH..=PUSH).map(onward).max().unwrap_or(OUTSIDE);
                        let best = if step == 0 { target } else { target.max(best) };
                        let index = Self::index(position, velocity);
                        if let Some(index) = index {
                            next[index] = safe.min(best);
                        }
                    }
                }
                value.0 = next;
            }
            value
        }

        pub(crate) fn at(&self, position: i32, velocity: i32) -> i32 {
            Self::index(position, velocity).map_or(OUTSIDE, |index| self.0[index])
        }

        fn index(position: i32, velocity: i32) -> Option<usize> {
            let inside = position.abs() < CORRIDOR && velocity.abs() <= REACHED;
            let row = (position + CORRIDOR - 1) * (2 * REACHED + 1);
            inside.then_some((row + velocity + REACHED) as usize)
        }
    }
}

/// Both are exact on the lattice (its numbers are integers, its step and unit are 1), so they agree
/// in every cell, the edges included: there is no band to allow for.
#[test]
fn closed_form_is_the_dynamic_program() {
    use lattice::{CORRIDOR, PUSH, SPEED, STEPS, TARGET, Value};
    let value = Value::iterate();
    let form = ClosedForm {
        dt: 1.0,
        acceleration: f64::from(PUSH),
        target: f64::from(TARGET),
        corridor: f64::from(CORRIDOR),
    };
    let loss = vec![0.0; STEPS as usize + 1];
    let mut inside = 0;
    for position in -CORRIDOR - 100..=CORRIDOR + 100 {
        for velocity in -SPEED..=SPEED {
            let program = value.at(position, velocity) > 0;
            let closed = form.contains([f64::from(position), f64::from(velocity)], &loss);
            assert_eq!(program, closed, "cell ({position}, {velocity})");
            inside += u32::from(program);
        }
    }
    // Neither all nor nothing: the set fills between a third and nine tenths of the corridor.
    let cells = (2 * CORRIDOR - 1) * (2 * SPEED + 1);
    let share = f64::from(inside) / f64::from(cells);
    assert!((0.33..0.9).contains(&share), "{share}");
}

/// Starts over the box of the double integrator, `side` along each axis, off its centre line.
fn grid(side: usize) -> Vec<[f32; 2]> {
    let node = |i: usize, half: f32| half * ((2 * i + 1) as f32 / side as f32 - 1.0);
    (0..side * side).map(|i| [node(i / side, 1.2), node(i % side, 1.5)]).collect()
}

/// Margins within the band are f64's, those outside stay as the backend has them.
#[test]
fn margins_within_the_band_are_decided_in_f64() {
    let system = DroneRace::default();
    let policy = race_policy();
    let spec = RolloutSpec::new(30, 0.95).expect("spec");
    let tightening = deviation::tightening(&supremum(&system, 0.1, 30), 14.15, 14.44, &spec);
    let region = Region::new_box(
        system.states().map(|axis| axis.low),
        system.states().map(|axis| axis.high),
    );
    let starts =
        Starts::Drawn { region: region.expect("box"), stream: Stream::new(5, Purpose::USER, 3) };
    let states = StateList::new(12).with((0..200).map(|index| starts.start(index)));
    let backend = cpu(2);
    let program = program(&backend, &Plant::of(system, policy.clone()));
    let margins = |band: f64| {
        let (states, query) = (states.view(), Query::Measure);
        global::check_margins(context(&program), &spec, &tightening, states, query, band)
            .expect("margins")
    };
    let (plain, banded) = (margins(0.0), margins(1.0));
    let mut changed = 0;
    for ((x, plain), banded) in states.arrays::<12>().into_iter().zip(plain).zip(banded) {
        if plain.abs() > 1.0 {
            assert_eq!(plain, banded);
            continue;
        }
        let typed = scalar_states::<f64, _, _, 12, 3>((&system, &policy), x, spec.horizon);
        let truth = scalar_measure(&system, &typed, &spec, &tightening) as f32;
        assert_eq!(banded, truth);
        changed += u32::from(banded != plain);
    }
    assert!(changed > 10, "only {changed} margins differ between f32 and f64");
}

/// Each certified start is inside the true set, with the whole ball around it; the certified share
/// of the set grows to at least nine tenths as the ball shrinks.
#[test]
fn certified_starts_are_inside_the_true_set() {
    let system = DoubleIntegrator::default();
    let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    let form = ClosedForm::of(&system);
    let spec = RolloutSpec::new(30, 0.95).expect("spec");
    let loss = [0.0; 31];
    let starts = grid(200);
    let inside = |[p, v]: [f32; 2]| form.contains([f64::from(p), f64::from(v)], &loss);
    let all = starts.iter().filter(|x| inside(**x)).count();
    for backend in &backends() {
        let program = program(backend, &plant);
        let mut shares = Vec::new();
        for radius in [0.1, 0.03, 0.01, 0.001] {
            let bound = supremum(&system, radius, 30);
            let tightening = deviation::tightening(&bound, 1.0, 1.0, &spec);
            let (context, query) = (context(&program), Query::Measure);
            let margins =
                global::check_margins(context, &spec, &tightening, (&starts).into(), query, 0.0)
                    .expect("margins");
            let certified = starts.iter().zip(margins).filter(|(_, m)| *m > 0.0);
            let mut count = 0;
            for ([p, v], margin) in certified {
                count += 1;
                assert!(inside([*p, *v]), "({p}, {v}) is certified by {margin}");
                // The rim of its ball; the tightening covers it, the policy acts in feedback.
                for k in 0..16 {
                    let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 16.0).sin_cos();
                    let rim = [f64::from(*p) + radius * cos, f64::from(*v) + radius * sin];
                    assert!(form.contains(rim, &loss), "{rim:?} near ({p}, {v}) fails");
                }
            }
            shares.push(count as f64 / all as f64);
        }
        println!("certified share of the true set: {shares:?}");
        assert!(shares.windows(2).all(|pair| pair[0] < pair[1]), "{shares:?}");
        assert!(shares[3] >= 0.9, "{shares:?}");
    }
}

/// The certificate's interval of the certified share holds the share of the closed form with the
/// certificate's own margins.
#[test]
fn certified_share_is_that_of_the_closed_form() {
    let system = DoubleIntegrator::default();
    let plant = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    let form = ClosedForm::of(&system);
    let mut settings = settings(&system, 30);
    settings.deviation.radius = 0.03;
    settings.global.draws = 20_000;
    settings.global.beta = FALSE_ALARM;
    settings.growth.radius = 0.05;
    for backend in &backends() {
        let record =
            certify(&program(backend, &plant), &settings, serde_json::Value::Null, &Unwatched)
                .expect("certificate");
        let bound = &record.deviation.bound;
        // No step leaps over the tightened target (see the closed form).
        assert!(bound.iter().all(|bound| 2.0 * (0.25 - bound) > 0.21));
        let share = form.share(literal(1.2), literal(1.5), bound);
        let [low, high] = record.global.share_interval;
        println!("share {share} within [{low}, {high}]");
        assert!(low <= share && share <= high, "{share} not in [{low}, {high}]");
        assert_eq!(record.global.claim.failures, 0, "constants and bound are valid");
        assert!(high - low < 0.05);
    }
}

/// Margins of a rollout, written out: the measure is `max over t of min(gamma^t r_t, min over s <= t
/// of gamma^s c_s)`. Starts and gamma are f32 throughout; the arithmetic is that of `R`.
fn scalar_measure<R: Real + PartialOrd, S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    states: &[[R; NX]],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> R {
    let (mut best, mut safe, mut discount) = (R::lit(-1e30), R::lit(1e30), R::lit(1.0));
    for (t, x) in states.iter().enumerate() {
        let target = discount * (system.target(*x) - R::lit(tightening.target[t]));
        let constraint = discount * (system.constraint(*x) - R::lit(tightening.constraint[t]));
        if constraint < safe {
            safe = constraint;
        }
        let reached = if target < safe { target } else { safe };
        if reached > best {
            best = reached;
        }
        discount = discount * R::lit(spec.gamma);
    }
    best
}

/// The states x_0..=x_T of a system and a policy in Rust, in a loop over `R`.
fn scalar_states<R: Real, S, P, const NX: usize, const NU: usize>(
    (system, policy): (&S, &P),
    start: [f32; NX],
    horizon: u32,
) -> Vec<[R; NX]>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let mut states = vec![start.map(R::lit)];
    for t in 0..horizon as usize {
        let x = states[t];
        states.push(system.step(x, policy.control(x)));
    }
    states
}

/// A pair side by side: measures of both and the distance at each step.
struct ScalarPair {
    nominal: f64,
    perturbed: f64,
    distances: Vec<f64>,
}

/// One pair in a loop over `R`.
fn scalar_pair<R: Real + PartialOrd + Into<f64>, S, P, const NX: usize, const NU: usize>(
    (system, policy): (&S, &P),
    [nominal, perturbed]: [[f32; NX]; 2],
    spec: &RolloutSpec,
    tightening: &Tightening,
    control: PairControl,
) -> ScalarPair
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let first = scalar_states((system, policy), nominal, spec.horizon);
    let mut second = vec![perturbed.map(R::lit)];
    for t in 0..spec.horizon as usize {
        let y = second[t];
        let driver = match control {
            PairControl::Replay => first[t],
            PairControl::ClosedLoop => y,
        };
        second.push(system.step(y, policy.control(driver)));
    }
    let distance = |(x, y): (&[R; NX], &[R; NX])| {
        let square = |i: usize| (y[i] - x[i]) * (y[i] - x[i]);
        let sum = (1..NX).fold(square(0), |sum, i| sum + square(i));
        sum.sqrt().into()
    };
    let none = Tightening::none(spec);
    ScalarPair {
        nominal: scalar_measure(system, &first, spec, tightening).into(),
        perturbed: scalar_measure(system, &second, spec, &none).into(),
        distances: first.iter().zip(&second).map(distance).collect(),
    }
}

/// Multiple of the worst distance of a scalar f32 loop from f64 that a backend is allowed: it may
/// add in another order or fuse.
const ORDER: f64 = 8.0;

/// The worst distance of the scalar f32 loop from f64, and what it allows a backend.
fn allowance(name: &str, pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("{name}: scalar f32 within {worst:e} of f64");
    assert!(worst > 0.0 && worst < 1e-3, "{name}: {worst}");
    ORDER * worst
}

/// Compares every path of `backend` over 500 pairs with f64 loops.
fn compare<S, P, const NX: usize, const NU: usize>(
    backend: &Backend,
    (system, policy): (&S, &P),
    settings: &Settings,
    control: PairControl,
) where
    S: System<NX, NU> + Clone + Send + Sync + 'static,
    P: Policy<NX, NU> + Clone + Send + Sync + 'static,
{
    const COUNT: u64 = 500;
    let name = format!("{} {} {control:?}", system.name(), policy.name());
    let spec = settings.spec;
    let radius = literal(settings.deviation.radius);
    let bound: Vec<f64> = (0..=spec.horizon).map(|t| radius * (1.0 + 0.1 * f64::from(t))).collect();
    let tightening = deviation::tightening(&bound, 0.5, 0.25, &spec);
    let starts = || Starts::Drawn {
        region: Region::new_box(&*settings.low, &*settings.high).expect("box"),
        stream: Stream::new(9, Purpose::USER, 0),
    };
    let pairs = Pairs {
        nominal: starts(),
        radius: settings.deviation.radius,
        stream: Stream::new(9, Purpose::USER, 1),
    };
    let typed = (system, policy);
    let given = |i: u64| pairs.pair(i).map(|x| from_fn(|k| x[k]));
    let oracle: Vec<ScalarPair> = (0..COUNT)
        .map(|i| scalar_pair::<f64, S, P, NX, NU>(typed, given(i), &spec, &tightening, control))
        .collect();
    let single: Vec<ScalarPair> = (0..COUNT)
        .map(|i| scalar_pair::<f32, S, P, NX, NU>(typed, given(i), &spec, &tightening, control))
        .collect();
    let both = || oracle.iter().zip(&single);
    let nominal = both().map(|(a, b)| (a.nominal, b.nominal));
    let perturbed = both().map(|(a, b)| (a.perturbed, b.perturbed));
    let band = allowance(&name, nominal.chain(perturbed));
    let mut measures: Vec<PairMeasure> = Vec::new();
    let task = DeviationTask {
        pairs: pairs.clone(),
        range: 0..COUNT,
        spec,
        tightening: &tightening,
        control,
    };
    let plant = Plant::of(system.clone(), policy.clone());
    let program = program(backend, &plant);
    let farthest = program
        .deviation(&task, &mut |first, values| {
            assert_eq!(first, measures.len() as u64);
            measures.extend_from_slice(values);
            Ok(())
        })
        .expect("pairs");
    assert_eq!(measures.len(), COUNT as usize);
    for (i, (found, oracle)) in measures.iter().zip(&oracle).enumerate() {
        let near = |found: f32, oracle: f64| (f64::from(found) - oracle).abs() <= band;
        assert!(near(found.nominal, oracle.nominal), "{name}, pair {i}: {found:?}");
        assert!(near(found.perturbed, oracle.perturbed), "{name}, pair {i}: {found:?}");
    }
    compare_farthest(&name, &farthest, &oracle, &single);
    compare_measures(&program, &starts(), &spec, &tightening, &oracle, band);
}

/// The farthest distance of each step, and that the pair named attains it.
fn compare_farthest(
    name: &str,
    farthest: &[Farthest],
    oracle: &[ScalarPair],
    single: &[ScalarPair],
) {
    let distances = |pairs: &[ScalarPair]| -> Vec<f64> {
        pairs.iter().flat_map(|pair| pair.distances.clone()).collect()
    };
    let [exact, rounded] = [distances(oracle), distances(single)];
    let allowed = allowance(&format!("{name}, distances"), exact.into_iter().zip(rounded));
    for (t, found) in farthest.iter().enumerate() {
        let largest = oracle.iter().map(|pair| pair.distances[t]).fold(0.0, f64::max);
        let off = (f64::from(found.distance) - largest).abs();
        assert!(off <= allowed, "{name}, step {t}: {found:?} of {largest}");
        let attained = oracle[found.pair as usize].distances[t];
        assert!((attained - largest).abs() <= allowed, "{name}, step {t}: {found:?}");
    }
}

/// Measure and sign of each start, with tightened margins.
fn compare_measures(
    program: &Program<'_>,
    starts: &Starts<'_>,
    spec: &RolloutSpec,
    tightening: &Tightening,
    oracle: &[ScalarPair],
    band: f64,
) {
    let run = |query: Query| {
        let mut values = Vec::new();
        let task = ReachAvoidTask {
            starts: starts.clone(),
            range: 0..oracle.len() as u64,
            spec: *spec,
            tightening,
            query,
        };
        let mut sink = |_: u64, found: &[f32]| {
            values.extend_from_slice(found);
            Ok(())
        };
        program.reach_avoid(&task, &mut sink).expect("measures");
        values
    };
    let (values, signs) = (run(Query::Measure), run(Query::Sign));
    assert_eq!([values.len(), signs.len()], [oracle.len(); 2]);
    let (mut inside, mut positive) = (0, 0);
    for (i, oracle) in oracle.iter().enumerate() {
        let exact = oracle.nominal;
        let off = (f64::from(values[i]) - exact).abs();
        assert!(off <= band, "start {i}: {}, f64 {exact}", values[i]);
        assert!(signs[i].abs() == 1.0, "start {i}: sign {}", signs[i]);
        if exact.abs() <= band {
            inside += 1;
        } else {
            assert_eq!(signs[i] > 0.0, exact > 0.0, "start {i}: {exact}");
        }
        positive += usize::from(exact > 0.0);
    }
    println!("{positive} of {} positive, {inside} within the band", oracle.len());
    assert!(positive > 0 && positive < oracle.len(), "both signs occur");
}

/// Race with the trained network, race with a formula, double integrator; replayed and in feedback.
#[test]
fn every_f32_path_is_near_its_f64_loop() {
    let race = DroneRace::default();
    let integrator = DoubleIntegrator::default();
    let network = race_policy();
    for backend in &backends() {
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            let mut settings_of_race = race_settings(&race);
            // Near the gate, so that both signs are common.
            settings_of_race.low =
                vec![-0.5, -0.2, -1.5, 0.4, -0.3, -0.2, -1.0, -0.2, -3.2, 0.1, -1.0, -0.2];
            settings_of_race.high =
                vec![0.5, 0.2, -0.5, 0.8, 0.3, 0.2, 1.0, 0.2, -1.0, 0.4, 1.0, 0.2];
            compare(backend, (&race, &network), &settings_of_race, control);
            compare(backend, (&race, &Steer), &settings_of_race, control);
            compare(backend, (&integrator, &Damped), &settings(&integrator, 30), control);
        }
    }
}

/// A network whose file names a part of the states, in another order, has the measures of the one that sees
/// them all and weighs the others with zero, to the rounding of one sum.
#[test]
fn a_network_of_some_states_runs_as_one_that_ignores_the_others() {
    let model = || Model::of(DroneRace::default());
    let names: Vec<String> = model().states.iter().map(|axis| axis.name.clone()).collect();
    let seen = [2, 0, 9];
    let layers = random_policy(5).layers().to_vec();
    let few = |layer: &Layer| {
        let rows = layer.weight.chunks(layer.inputs);
        let weight = rows.flat_map(|row| seen.map(|place| row[place])).collect();
        Layer { weight, inputs: seen.len(), ..layer.clone() }
    };
    let zeros = |layer: &Layer| {
        let mut layer = layer.clone();
        for row in layer.weight.chunks_mut(12) {
            (0..12).filter(|place| !seen.contains(place)).for_each(|place| row[place] = 0.0);
        }
        layer
    };
    let network = |first: Layer| {
        let layers = vec![first, layers[1].clone()];
        Mlp::new(layers, Activation::Tanh, Activation::Tanh).expect("network")
    };
    let named = network(few(&layers[0]))
        .with_state_order(seen.map(|place| names[place].clone()).to_vec())
        .expect("names");
    let whole = network(zeros(&layers[0]));
    let plants = [named, whole].map(|network| {
        let controller = Controller::network_of(&model(), network).expect("a controller");
        Plant::new(model(), controller)
    });
    let spec = RolloutSpec::new(30, 0.95).expect("a horizon");
    let mut starts = StateList::new(12);
    (0..64).for_each(|seed| starts.push(&random_start(seed, &model().states)));
    for backend in backends() {
        let measures = plants.each_ref().map(|plant| {
            program(&backend, plant).measures(starts.view(), &spec).expect("measures")
        });
        let distance = measures[0].iter().zip(&measures[1]).map(|(a, b)| (a - b).abs());
        let largest = distance.fold(0.0, f32::max);
        assert!(largest < 2e-4, "{}: {largest}", backend.name());
        assert!(measures[0].iter().any(|measure| *measure > -0.5), "{:?}", measures[0]);
    }
}

/// A start in the box of `axes`.
fn random_start(seed: u64, axes: &[Axis]) -> Vec<f32> {
    let mut rng = StdRng::seed_from_u64(seed);
    axes.iter().map(|axis| rng.random_range(axis.low..axis.high)).collect()
}
