//! MPPI against mathematics: closed forms, an f64 loop on the same noise, limits of the
//! temperature, statistics of the noise.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use crate::oracle;
use std::sync::Arc;

use crate::common::{backends, cpu};
use nalgebra::{DMatrix, DVector};
use reachcast::backend::Backend;
use reachcast::cost::{Cost, Obstacle, Quadratic};
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::race::{
    DroneRace, Fence, LaneCost, QuadraticCost, RaceCost, RaceReference, RecoveryCost, Safety,
    SafetyCone,
};
use reachcast::real::Real;
use reachcast::rollout::{
    CostQuery, Disturbance, MppiProblem, MppiResult, MppiSettings, MppiSpec, MppiTask, NoiseKind,
    Planning, Purpose, Sigma, Stream, ValueTerm,
};
use reachcast::system::{Axis, DoubleIntegrator, System};

/// A chain of two integrators without any bound that matters: linear, so that the optimum of a
/// quadratic cost is known.
#[derive(Clone)]
struct Linear;

impl System<2, 1> for Linear {
    fn name(&self) -> &str {
        "linear"
    }
    fn states(&self) -> [Axis; 2] {
        ["position", "velocity"].map(|name| Axis::new(name, "", -10.0, 10.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("force", "", -100.0, 100.0)]
    }
    fn step<R: Real>(&self, [x, v]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        [x + R::lit(0.25) * v, v + R::lit(0.25) * u]
    }
    fn target<R: Real>(&self, [x, _]: [R; 2]) -> R {
        x
    }
    fn constraint<R: Real>(&self, [x, _]: [R; 2]) -> R {
        x
    }
}

const STEPS: usize = 8;
const LAMBDA: f32 = 2.0;
const SIGMA: f32 = 0.75;
/// Of three controls.
const COVARIANCE: [[f32; 3]; 3] = [[0.16, 0.05, 0.0], [0.05, 0.2, -0.02], [0.0, -0.02, 0.1]];

fn covariance(rows: [[f32; 3]; 3]) -> Sigma {
    Sigma::Covariance(rows.map(|row| row.to_vec()).to_vec())
}

fn linear_cost() -> Quadratic<2, 1> {
    Quadratic { state: [1.0, 0.25], control: [0.125], last: [2.0, 1.0], obstacle: None }
}

fn linear_problem(plan: &[f32], seed: u64) -> MppiProblem {
    let context = (0..STEPS).map(|t| [0.0, 0.0, f32::from(u8::from(t + 1 == STEPS))]);
    let (stages, context): (Vec<[f32; 1]>, Vec<_>) =
        (plan.iter().map(|u| [*u]).collect(), context.collect());
    MppiProblem::new([1.0, -0.5], &stages, &context, Stream::new(seed, Purpose::CONTROL_NOISE, 0))
}

fn linear_settings(samples: u32) -> MppiSettings {
    MppiSettings {
        temperature: LAMBDA,
        sigma: Sigma::PerControl(vec![SIGMA]),
        ..MppiSettings::new(&Linear.controls(), samples, STEPS as u32)
    }
}

fn linear(settings: MppiSettings) -> Planning {
    Planning::of::<_, _, 2, 1, 3>(&Linear, linear_cost(), MppiSpec::new(settings).unwrap())
}

fn improve(backend: &Backend, samples: u32, plan: &[f32], seed: u64) -> MppiResult {
    plans(backend, &linear(linear_settings(samples)), &[linear_problem(plan, seed)]).remove(0)
}

fn task(problems: &[MppiProblem]) -> MppiTask<'_> {
    MppiTask { problems, iteration: 0, costs: CostQuery::Each }
}

fn plans(backend: &Backend, planning: &Planning, problems: &[MppiProblem]) -> Vec<MppiResult> {
    backend.prepare_plans(planning).unwrap().improve(&task(problems)).unwrap()
}

/// `S(v) = v' M v + 2 b' v + c` of the linear problem, by evaluating it in f64.
fn quadratic_form() -> (DMatrix<f64>, DVector<f64>) {
    let value = |v: &DVector<f64>| {
        let mut x = [1.0, -0.5];
        let mut sum = 0.0;
        for t in 0..STEPS {
            let last = f64::from(u8::from(t + 1 == STEPS));
            sum += linear_cost().stage::<f64>(x, [v[t]], [0.0, 0.0, last]);
            x = Linear.step(x, [v[t]]);
        }
        sum
    };
    let unit = |i: usize| DVector::from_fn(STEPS, |j, _| f64::from(u8::from(i == j)));
    let zero = value(&DVector::zeros(STEPS));
    let matrix = DMatrix::from_fn(STEPS, STEPS, |i, j| {
        let both = value(&(unit(i) + unit(j)));
        0.5 * (both - value(&unit(i)) - value(&unit(j)) + zero)
    });
    let linear =
        DVector::from_fn(STEPS, |i, _| 0.5 * (value(&unit(i)) - zero) - 0.5 * matrix[(i, i)]);
    (matrix, linear)
}

/// The limit of one update for K to infinity: Gaussian noise weighted by `exp(-S / lambda)` is
/// Gaussian again, its mean the minimiser of `S(v) / lambda + |v - U|^2 / (2 sigma^2)`.
fn limit(plan: &DVector<f64>) -> DVector<f64> {
    let (matrix, linear) = quadratic_form();
    let (lambda, precision) = (f64::from(LAMBDA), 1.0 / f64::from(SIGMA).powi(2));
    let left = matrix * (2.0 / lambda) + DMatrix::identity(STEPS, STEPS) * precision;
    let right = plan * precision - linear * (2.0 / lambda);
    left.lu().solve(&right).unwrap()
}

fn distance(plan: &[f32], truth: &DVector<f64>) -> f64 {
    plan.iter().zip(truth.iter()).map(|(u, v)| (f64::from(*u) - v).powi(2)).sum::<f64>().sqrt()
}

/// The error of one update against its closed-form limit falls as one over the root of K.
#[test]
fn one_update_converges_to_its_closed_form_at_the_rate_of_monte_carlo() {
    for backend in backends() {
        let truth = limit(&DVector::zeros(STEPS));
        let error = |samples: u32| {
            let square = |seed| {
                distance(&improve(&backend, samples, &[0.0; STEPS], seed).plan, &truth).powi(2)
            };
            ((0..24).map(square).sum::<f64>() / 24.0).sqrt()
        };
        let errors = [256, 4096, 65_536].map(error);
        println!("{}: errors {errors:?}", backend.name());
        // 16 times the samples: a quarter of the error, within the scatter of 24 seeds.
        for pair in errors.windows(2) {
            let ratio = pair[0] / pair[1];
            assert!((2.8..5.7).contains(&ratio), "{errors:?}");
        }
        assert!(errors[2] < 0.08 * truth.norm(), "{errors:?} of {}", truth.norm());
    }
}

/// Updates one after the other approach the optimum of the linear quadratic regulator.
#[test]
fn iterated_updates_approach_the_optimum_of_the_regulator() {
    let (matrix, linear) = quadratic_form();
    let optimum = matrix.lu().solve(&(-linear)).unwrap();
    let backend = cpu(2);
    let reach = |samples: u32| {
        let mut plan = vec![0.0; STEPS];
        let mut far = Vec::new();
        for seed in 0..60 {
            plan = improve(&backend, samples, &plan, seed).plan;
            if seed >= 50 {
                far.push(distance(&plan, &optimum));
            }
        }
        far.iter().sum::<f64>() / far.len() as f64
    };
    let [few, many] = [512, 32_768].map(reach);
    println!("distance from the optimum of norm {}: {few}, {many}", optimum.norm());
    assert!(many < 0.03 * optimum.norm());
    assert!(few > 3.0 * many, "64 times the samples: about an eighth of the distance");
}

#[test]
fn weights_sum_to_one_and_follow_the_temperature() {
    for backend in backends() {
        let run = |temperature: f32| {
            let bounds = vec![[-1.0, 1.5]];
            let planning = linear(MppiSettings { temperature, bounds, ..linear_settings(500) });
            let problem = linear_problem(&[0.25; STEPS], 3);
            let result = plans(&backend, &planning, std::slice::from_ref(&problem)).remove(0);
            let samples: Vec<_> = (0..500).map(|k| planning.controls(&problem, 0, k)).collect();
            (result, samples)
        };
        let (middle, samples) = run(2.0);
        let weights = middle.weights(2.0);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        assert!((middle.effective_samples * squares - 1.0).abs() < 1e-4);
        for t in 0..STEPS {
            let terms = samples.iter().zip(&weights).map(|(v, w)| f64::from(v[t]) * w);
            assert!((terms.sum::<f64>() - f64::from(middle.plan[t])).abs() < 1e-5);
        }
        let least = middle.costs.iter().copied().fold(f32::INFINITY, f32::min);
        assert_eq!((middle.least_cost, middle.costs[middle.best as usize]), (least, least));
        let mean = middle.costs.iter().map(|cost| f64::from(*cost)).sum::<f64>() / 500.0;
        assert!((middle.mean_cost / mean - 1.0).abs() < 1e-5);

        let (cold, samples) = run(1e-9);
        assert_eq!(cold.effective_samples, 1.0);
        for (u, v) in cold.plan.iter().zip(&samples[cold.best as usize]) {
            assert!((u - v).abs() < 1e-6, "the best sample");
        }
        let (hot, samples) = run(1e12);
        assert!((hot.effective_samples - 500.0).abs() < 1e-3);
        for t in 0..STEPS {
            let mean = samples.iter().map(|v| f64::from(v[t])).sum::<f64>() / 500.0;
            assert!((mean - f64::from(hot.plan[t])).abs() < 1e-5, "the mean");
        }
    }
}

fn network(inputs: usize, outputs: usize, scale: f32) -> Mlp {
    let layer = |inputs: usize, outputs: usize, seed: usize| {
        Layer::dense(
            (0..inputs * outputs)
                .map(|i| scale * (((i * 37 + seed * 11) % 41) as f32 / 20.0 - 1.0))
                .collect(),
            (0..outputs).map(|i| 0.1 * (i as f32 - 0.5)).collect(),
        )
    };
    let layers = vec![layer(inputs, 20, 1), layer(20, outputs, 2)];
    Mlp::new(layers, Activation::Relu, Activation::Tanh).unwrap()
}

/// Compares a task with the f64 loop on every backend: the costs, and the plan that the f64 costs
/// and the samples' controls make.
fn compare<S, C, const NX: usize, const NU: usize, const NC: usize>(
    system: &S,
    cost: &C,
    planning: &Planning,
    task: &MppiTask<'_>,
) where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    for backend in backends() {
        let results = backend.prepare_plans(planning).unwrap().improve(task).unwrap();
        assert_eq!(results.len(), task.problems.len());
        for (problem, result) in results.iter().enumerate() {
            let asked = (&task.problems[problem], task.iteration);
            let truth = oracle::truth((system, cost), planning, asked);
            // Terms of either sign cancel, so rounding is relative to the largest cost.
            let scale = truth.costs.iter().fold(1.0_f64, |largest, cost| largest.max(cost.abs()));
            let error = |(cost, truth): (&f32, &f64)| (f64::from(*cost) - truth).abs() / scale;
            let mut errors: Vec<f64> = result.costs.iter().zip(&truth.costs).map(error).collect();
            errors.sort_by(f64::total_cmp);
            // The lane cost jumps where a drone is 0.15 m off: one sample may sit on the edge.
            let worst = errors[errors.len().saturating_sub(2)];
            assert!(worst < 2e-5, "{}, problem {problem}: costs off by {worst}", backend.name());
            assert!(errors[errors.len() - 1] < 1e-2, "{}: {errors:?}", backend.name());
            for (u, mean) in result.plan.iter().zip(&truth.plan) {
                assert!((f64::from(*u) - mean).abs() < 2e-3, "{}: {u} {mean}", backend.name());
            }
        }
    }
}

fn race_problems(horizon: usize) -> Vec<MppiProblem> {
    let start = |i: f32| {
        [
            0.3117 - 0.2 * i,
            0.0531,
            -1.2 - 0.1 * i,
            0.6,
            0.0517,
            -0.0213,
            -0.2,
            0.0,
            -1.0,
            0.4,
            0.1,
            0.0,
        ]
    };
    let context = |i: usize, t: usize| {
        RaceReference {
            position: [0.05 * i as f32, 0.1, -0.05],
            velocity: [-0.1, 0.6 + 0.01 * t as f32, 0.0],
            speed: 0.5 + 0.1 * i as f32,
            last: t + 1 == horizon,
        }
        .context()
    };
    let plan = |i: usize| {
        let step = |t: usize| [0.3 * i as f32 - 0.02 * t as f32, 0.2, -0.1];
        (0..horizon).map(step).collect::<Vec<_>>()
    };
    (0..3)
        .map(|i| {
            let contexts: Vec<_> = (0..horizon).map(|t| context(i, t)).collect();
            let stream = Stream::new(40 + i as u64, Purpose::CONTROL_NOISE, 7 * i as u32);
            MppiProblem::new(start(i as f32), &plan(i), &contexts, stream)
        })
        .collect()
}

fn race_costs() -> [RaceCost; 3] {
    let safety = Safety { weight: 50.0, radius: 0.2, margin: 0.3, cone: SafetyCone::Either };
    let fence = Fence { weight: 20.0, margin: 0.1 };
    let recovery = RecoveryCost { position: 5.0, velocity: 1.0, control: 0.1, safety, fence };
    let lane = LaneCost {
        lane: 25.0,
        speed: 2.0,
        control: 0.001,
        away: 50.0,
        wide: 50.0,
        last: 10.0,
        safety,
        fence,
    };
    let obstacle = Obstacle { states: [0, 2], center: [0.1, -0.9], radius: 0.3, weight: 40.0 };
    let quadratic = QuadraticCost {
        state: [2.0, 0.5, 1.5, 0.25, 2.0, 0.5, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0],
        control: [0.1, 0.2, 0.1],
        last: [8.0, 1.0, 6.0, 1.0, 8.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0],
        obstacle: Some(obstacle),
        safety,
        fence,
    };
    [RaceCost::Recovery(recovery), RaceCost::Lane(lane), RaceCost::Quadratic(quadratic)]
}

fn race_settings(samples: u32, horizon: u32) -> MppiSettings {
    MppiSettings {
        temperature: 10.0,
        sigma: Sigma::PerControl(vec![0.4; 3]),
        ..MppiSettings::new(&DroneRace::default().controls(), samples, horizon)
    }
}

#[test]
fn costs_and_plans_agree_with_an_f64_loop() {
    let system = DroneRace::default();
    let kinds =
        [NoiseKind::Independent, NoiseKind::Colored { time: 5.0 }, NoiseKind::Spline { knots: 5 }];
    for (cost, noise) in race_costs().into_iter().cycle().zip(kinds) {
        let settings = MppiSettings {
            noise,
            antithetic: noise != NoiseKind::Independent,
            noise_cost: noise == NoiseKind::Independent,
            sigma: covariance(COVARIANCE),
            ..race_settings(333, 20)
        };
        let planning = Planning::of(&system, cost, MppiSpec::new(settings).unwrap());
        compare(&system, &cost, &planning, &task(&race_problems(20)));
    }
}

#[test]
fn networks_along_the_rollout_agree_with_an_f64_loop() {
    let system = DroneRace::default();
    let (value, push) = (network(12, 1, 0.3), network(12, 3, 0.3));
    let spec = MppiSpec::new(race_settings(300, 12)).unwrap();
    let problems = race_problems(12);
    let entries = vec![(7, 0.05), (9, 0.04), (11, -0.03)];
    let value = Some(ValueTerm { network: Arc::new(value), weight: 30.0, threshold: 0.4 });
    let disturbance = Some(Disturbance { network: Arc::new(push), entries });
    let asked = MppiTask { iteration: 3, ..task(&problems) };
    for cost in race_costs() {
        let none = Planning::of(&system, cost, spec.clone());
        let valued = Planning { value: value.clone(), ..none.clone() };
        let pushed = Planning { disturbance: disturbance.clone(), ..none };
        let both = Planning { value: value.clone(), ..pushed.clone() };
        for planning in [both, valued, pushed] {
            compare(&system, &cost, &planning, &asked);
        }
    }
}

#[test]
fn small_and_long_problems() {
    let system = DoubleIntegrator::default();
    let obstacle = Obstacle { states: [0, 1], center: [0.3, 0.0], radius: 0.4, weight: 8.0 };
    let cost = Quadratic {
        state: [1.0, 0.1],
        control: [0.01],
        last: [5.0, 1.0],
        obstacle: Some(obstacle),
    };
    for (samples, horizon) in [(1, 1), (1, 5), (7, 1), (65, 512), (257, 33)] {
        let settings = MppiSettings::new(&system.controls(), samples, horizon);
        let spec = MppiSpec::new(MppiSettings { temperature: 20.0, ..settings }).unwrap();
        let context = (0..horizon).map(|t| [0.1, 0.0, f32::from(u8::from(t + 1 == horizon))]);
        let (plan, context) = (vec![[0.1]; horizon as usize], context.collect::<Vec<_>>());
        let stream = Stream::new(5, Purpose::CONTROL_NOISE, 1);
        let problem = MppiProblem::new([0.6, -0.1], &plan, &context, stream);
        let planning = Planning::of::<_, _, 2, 1, 3>(&system, cost.clone(), spec);
        compare::<_, _, 2, 1, 3>(&system, &cost, &planning, &task(&[problem]));
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let system = DroneRace::default();
    let value = Arc::new(network(12, 1, 0.3));
    let spec = MppiSpec::new(race_settings(2000, 20)).unwrap();
    let problems = race_problems(20);
    let plain = Planning::of(&system, race_costs()[0], spec);
    let value = Some(ValueTerm { network: value, weight: 30.0, threshold: 0.4 });
    for planning in [plain.clone(), Planning { value, ..plain }] {
        let [one, two, five] = [1, 2, 5].map(|threads| plans(&cpu(threads), &planning, &problems));
        assert!(one == two && one == five);
        // And each problem by itself.
        for (i, result) in one.iter().enumerate() {
            assert_eq!(plans(&cpu(2), &planning, &problems[i..=i])[0], *result);
        }
    }
}

/// Costs that overflow weigh nothing; where all do, the plan stays and says so.
#[test]
fn costs_that_are_not_finite_weigh_nothing() {
    let cost =
        Quadratic::<2, 1> { state: [1e30; 2], control: [0.0], last: [1e30; 2], obstacle: None };
    let spec = MppiSpec::new(linear_settings(100)).unwrap();
    let planning = Planning::of::<_, _, 2, 1, 3>(&Linear, cost, spec);
    let mut problems = [linear_problem(&[150.0; STEPS], 1)];
    problems[0].start = vec![1e12, 0.0];
    for backend in backends() {
        let result = plans(&backend, &planning, &problems).remove(0);
        assert_eq!((result.non_finite, result.effective_samples), (100, 0.0));
        assert!(
            result.least_cost == f32::INFINITY && result.costs.iter().all(|c| *c == f32::INFINITY)
        );
        assert_eq!(result.plan, [100.0; STEPS], "the nominal plan, clipped");
    }
}

/// Mean, covariance and correlation of the noise, within 5 standard errors.
#[test]
fn the_noise_has_the_moments_that_were_asked_for() {
    let count = 20_000_u32;
    for kind in
        [NoiseKind::Independent, NoiseKind::Colored { time: 4.0 }, NoiseKind::Spline { knots: 6 }]
    {
        let settings =
            MppiSettings { noise: kind, sigma: covariance(COVARIANCE), ..race_settings(count, 12) };
        let spec = MppiSpec::new(settings).unwrap();
        let stream = Stream::new(9, Purpose::CONTROL_NOISE, 0);
        let samples: Vec<_> = (0..count).map(|k| spec.noise().sample(stream, 0, k)).collect();
        let moment = |s: usize, t: usize, i: usize, j: usize| {
            let terms = samples.iter().map(|e| f64::from(e[3 * s + i]) * f64::from(e[3 * t + j]));
            terms.sum::<f64>() / f64::from(count)
        };
        let slack = 5.0 * 0.2 * 2.0_f64.sqrt() / f64::from(count).sqrt();
        for t in 0..12 {
            for i in 0..3 {
                let mean =
                    samples.iter().map(|e| f64::from(e[3 * t + i])).sum::<f64>() / f64::from(count);
                assert!(mean.abs() < 5.0 * 0.45 / f64::from(count).sqrt(), "{kind:?} {mean}");
                for (j, truth) in COVARIANCE[i].into_iter().enumerate() {
                    let truth = f64::from(truth);
                    assert!((moment(t, t, i, j) - truth).abs() < slack, "{kind:?} {t} {i} {j}");
                }
            }
        }
        let correlation = moment(3, 6, 1, 1) / 0.2;
        let expected = match kind {
            NoiseKind::Independent => 0.0..1e-9,
            NoiseKind::Colored { .. } => {
                let truth = (-0.75_f64).exp();
                truth..truth + 1e-9
            }
            // Three steps are 1.4 knots: neighbours still share knots.
            NoiseKind::Spline { .. } => 0.05..0.5,
        };
        let (low, high) = (expected.start - 5.0 / f64::from(count).sqrt(), expected.end + 0.036);
        assert!((low..high).contains(&correlation), "{kind:?}: {correlation}");
    }
}

#[test]
fn antithetic_samples_mirror_each_other() {
    let settings = MppiSettings { antithetic: true, ..race_settings(10, 6) };
    let spec = MppiSpec::new(settings).unwrap();
    let stream = Stream::new(9, Purpose::CONTROL_NOISE, 0);
    for pair in 0..5 {
        let [a, b] = [0, 1].map(|i| spec.noise().sample(stream, 0, 2 * pair + i));
        assert!(a.iter().zip(&b).all(|(a, b)| *a == -*b && *a != 0.0));
    }
    assert_ne!(spec.noise().sample(stream, 0, 0), spec.noise().sample(stream, 1, 0), "iteration");
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let good = race_settings(10, 5);
    let good = || good.clone();
    let sigma = |sigma| MppiSettings { sigma, ..good() };
    let noise = |noise| MppiSettings { noise, ..good() };
    let cases = [
        ("samples", MppiSettings { samples: 0, ..good() }),
        ("samples", MppiSettings { samples: 1_000_001, ..good() }),
        ("horizon", MppiSettings { horizon: 0, ..good() }),
        ("horizon", MppiSettings { horizon: 513, ..good() }),
        ("temperature", MppiSettings { temperature: 0.0, ..good() }),
        ("temperature", MppiSettings { temperature: f32::NAN, ..good() }),
        ("sigma", sigma(Sigma::PerControl(vec![0.4, -0.1, 0.4]))),
        ("sigma", sigma(Sigma::PerControl(vec![0.4; 2]))),
        ("sigma", sigma(Sigma::Covariance(vec![vec![1.0, 0.0, 0.0]]))),
        ("sigma", sigma(covariance([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))),
        ("sigma", sigma(covariance([[1.0, 0.5, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]]))),
        ("bounds", MppiSettings { bounds: vec![[-1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]], ..good() }),
        ("noise.time", noise(NoiseKind::Colored { time: 0.0 })),
        ("noise.knots", noise(NoiseKind::Spline { knots: 6 })),
        ("noise.knots", noise(NoiseKind::Spline { knots: 0 })),
        ("noise_cost", MppiSettings { noise_cost: true, ..noise(NoiseKind::Spline { knots: 3 }) }),
        (
            "noise_cost",
            MppiSettings { noise_cost: true, ..sigma(Sigma::PerControl(vec![0.4, 0.0, 0.4])) },
        ),
    ];
    for (name, settings) in cases {
        let text = MppiSpec::new(settings).expect_err(name).to_string();
        assert!(text.contains(name), "{name}: {text}");
    }
    let spec = MppiSpec::new(good()).unwrap();
    let planning = Planning::of(&DroneRace::default(), race_costs()[0], spec);
    let host = cpu(1);
    let refused = |change: &dyn Fn(&mut MppiProblem)| {
        let mut problems = race_problems(5);
        change(&mut problems[1]);
        let result = host.prepare_plans(&planning).unwrap().improve(&task(&problems));
        result.expect_err("refused").to_string()
    };
    assert!(refused(&|problem| problem.plan.truncate(4)).contains("problem 1 has 4 numbers"));
    assert!(refused(&|problem| problem.context.clear()).contains("problem 1 has 0 numbers"));
    assert!(refused(&|problem| problem.start.truncate(3)).contains("a state has 12"));
    assert!(refused(&|problem| problem.start[3] = f32::NAN).contains("not finite"));
    let refused = |planning: Planning| {
        host.prepare_plans(&planning).map(drop).expect_err("refused").to_string()
    };
    let wrong = Arc::new(network(12, 2, 0.1));
    let value = Some(ValueTerm { network: wrong, weight: 1.0, threshold: 0.0 });
    assert!(refused(Planning { value, ..planning.clone() }).contains("value network"));
    let other = Planning::of::<_, _, 2, 1, 3>(
        &Linear,
        linear_cost(),
        MppiSpec::new(linear_settings(5)).unwrap(),
    );
    assert!(refused(Planning { cost: other.cost, ..planning.clone() }).contains("cost"));
    assert!(refused(Planning { spec: other.spec, ..planning }).contains("bounds of 1 controls"));
}
