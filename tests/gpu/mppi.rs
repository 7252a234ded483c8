//! MPPI on an adapter against an f64 loop over the same controls, and what its chunks hold.

use std::f32::consts::TAU;
use std::sync::Arc;

use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::cost::{Cost, Obstacle, Quadratic};
use reachcast::policy::{Activation, Mlp};
use reachcast::race::{
    CenterlineCost, DroneRace, Fence, LaneCost, RaceCost, RaceReference, RecoveryCost, Safety,
    SafetyCone,
};
use reachcast::real::Real;
use reachcast::rollout::{
    CostQuery, Disturbance, MppiProblem, MppiResult, MppiSettings, MppiSpec, MppiTask, NoiseKind,
    Planning, Purpose, Sigma, Stream, ValueTerm,
};
use reachcast::system::{DoubleIntegrator, System};

use crate::counts::halved;
use crate::oracle::{differences, truth};
use crate::{gpu, random_network};

fn host() -> Backend {
    Backend::Cpu(Cpu::new(Some(2)).expect("two threads"))
}

fn stream(number: u32) -> Stream {
    Stream::new(0x1_2345_6789, Purpose::CONTROL_NOISE, number)
}

fn task(problems: &[MppiProblem]) -> MppiTask<'_> {
    MppiTask { problems, iteration: 3, costs: CostQuery::Each }
}

fn improve(backend: &Backend, planning: &Planning, task: &MppiTask<'_>) -> Vec<MppiResult> {
    backend.prepare_plans(planning).and_then(|program| program.improve(task)).expect("it runs")
}

/// Runs `problems` on the adapter, if there is one, and holds every problem against f64.
fn agree<S, C, const NX: usize, const NU: usize, const NC: usize>(
    system: &S,
    cost: &C,
    planning: &Planning,
    problems: &[MppiProblem],
) where
    S: System<NX, NU>,
    C: Cost<NX, NU, NC>,
{
    let Some(gpu) = gpu() else { return };
    let task = task(problems);
    let results = improve(&Backend::Gpu(gpu), planning, &task);
    let twins = improve(&host(), planning, &task);
    assert_eq!(results.len(), problems.len());
    for (number, (result, twin)) in results.iter().zip(&twins).enumerate() {
        let truth = truth((system, cost), planning, (&problems[number], task.iteration));
        differences(&truth, result, twin, planning.spec.settings())
            .unwrap_or_else(|e| panic!("problem {number}: {e}"));
    }
}

fn quadratic() -> Quadratic<2, 1> {
    let obstacle = Obstacle { states: [0, 1], center: [0.2, 0.1], radius: 0.5, weight: 3.0 };
    Quadratic { state: [2.0, 0.5], control: [0.1], last: [20.0, 5.0], obstacle: Some(obstacle) }
}

/// A problem of the double integrator with a plan and a reference that differ at every step.
fn integrator_problem(number: u32, horizon: u32) -> MppiProblem {
    let phase = |t: u32| 0.3 * (t + 7 * number) as f32;
    let last = |t: u32| f32::from(u8::from(t + 1 == horizon));
    let start = [0.8 - 0.3 * number as f32, 0.2 * number as f32 - 0.5];
    let plan: Vec<_> = (0..horizon).map(|t| [0.4 * phase(t).sin()]).collect();
    let context: Vec<_> = (0..horizon).map(|t| [0.2 * phase(t).cos(), 0.0, last(t)]).collect();
    MppiProblem::new(start, &plan, &context, stream(number))
}

/// The double integrator under `change`d settings: `problems` problems.
fn integrator(
    (samples, horizon, problems): (u32, u32, u32),
    change: impl FnOnce(&mut MppiSettings),
) {
    let system = DoubleIntegrator::default();
    let mut settings = MppiSettings::new(&system.controls(), samples, horizon);
    settings.temperature = 0.5 + 0.1 * horizon as f32;
    change(&mut settings);
    let spec = MppiSpec::new(settings).expect("settings");
    let problems: Vec<_> = (0..problems).map(|i| integrator_problem(i, horizon)).collect();
    let planning = Planning::of::<_, _, 2, 1, 3>(&system, quadratic(), spec);
    agree::<_, _, 2, 1, 3>(&system, &quadratic(), &planning, &problems);
}

#[test]
fn noise_of_every_kind() {
    integrator((200, 15, 2), |_| {});
    integrator((200, 15, 1), |settings| settings.noise = NoiseKind::Colored { time: 3.0 });
    for knots in [1, 2, 3, 6, 15] {
        integrator((70, 15, 1), |settings| settings.noise = NoiseKind::Spline { knots });
    }
    integrator((200, 15, 1), |settings| settings.antithetic = true);
    integrator((70, 9, 1), |settings| {
        settings.antithetic = true;
        settings.noise = NoiseKind::Spline { knots: 4 };
    });
    integrator((200, 15, 1), |settings| settings.noise_cost = true);
}

#[test]
fn smallest_and_longest() {
    integrator((1, 1, 1), |_| {});
    integrator((65, 1, 3), |_| {});
    integrator((130, 512, 1), |_| {});
    integrator((64, 512, 1), |settings| settings.noise = NoiseKind::Colored { time: 30.0 });
    integrator((64, 512, 1), |settings| settings.noise = NoiseKind::Spline { knots: 40 });
}

const SAFETY: Safety = Safety { weight: 30.0, radius: 0.2, margin: 0.3, cone: SafetyCone::Either };
const FENCE: Fence = Fence { weight: 20.0, margin: 0.2 };

/// Each family, with every term.
fn families() -> [RaceCost; 3] {
    let (safety, fence) = (SAFETY, FENCE);
    let above = Safety { cone: SafetyCone::Above, ..safety };
    let recovery = RecoveryCost { position: 2.0, velocity: 0.7, control: 0.1, safety, fence };
    let centerline = CenterlineCost { lane: 3.0, speed: 1.5, control: 0.1, safety: above, fence };
    let lane = LaneCost {
        lane: 3.0,
        speed: 1.5,
        control: 0.1,
        away: 0.8,
        wide: 5.0,
        last: 9.0,
        safety,
        fence,
    };
    [RaceCost::Recovery(recovery), RaceCost::Centerline(centerline), RaceCost::Lane(lane)]
}

/// A problem of the race close to the gate and to the opponent.
fn race_problem(number: u32, horizon: u32) -> MppiProblem {
    let shift = 0.1 * number as f32;
    let wave = |t: u32, i: u32| 0.3 * (TAU * (t + 5 * i + number) as f32 / 11.0).sin();
    let reference = |t: u32| RaceReference {
        position: [0.1 * shift, -0.1 * t as f32, 0.05],
        velocity: [0.0, 0.8, 0.1],
        speed: 0.9 - shift,
        last: t + 1 == horizon,
    };
    let start = [0.3 - shift, 0.1, -0.9, 0.6, 0.2, -0.1, 0.1, 0.0, -0.7 + shift, 0.4, 0.25, 0.0];
    let plan: Vec<_> = (0..horizon).map(|t| [wave(t, 0), wave(t, 1), wave(t, 2)]).collect();
    let context: Vec<_> = (0..horizon).map(|t| reference(t).context()).collect();
    MppiProblem::new(start, &plan, &context, stream(100 + number))
}

/// The race with `cost`: three problems, with networks where they are given.
fn race(
    cost: &RaceCost,
    (samples, horizon): (u32, u32),
    networks: [Option<&Mlp>; 2],
    change: impl FnOnce(&mut MppiSettings),
) {
    let system = DroneRace::default();
    let mut settings = MppiSettings::new(&system.controls(), samples, horizon);
    settings.temperature = 3.0;
    change(&mut settings);
    let spec = MppiSpec::new(settings).expect("settings");
    let problems: Vec<_> = (0..3).map(|i| race_problem(i, horizon)).collect();
    let [value, disturbance] = networks.map(|network| network.cloned().map(Arc::new));
    let entries = vec![(7, 0.05), (9, 0.1), (11, -0.05)];
    let planning = Planning {
        value: value.map(|network| ValueTerm { network, weight: 4.0, threshold: 0.3 }),
        disturbance: disturbance.map(|network| Disturbance { network, entries }),
        ..Planning::of(&system, *cost, spec)
    };
    agree(&system, cost, &planning, &problems);
}

#[test]
fn race_families() {
    for cost in families() {
        race(&cost, (150, 20), [None; 2], |_| {});
    }
    let covariance = [[0.2, 0.05, -0.03], [0.05, 0.1, 0.02], [-0.03, 0.02, 0.3]];
    let covariance = Sigma::Covariance(covariance.map(|row| row.to_vec()).to_vec());
    race(&families()[2], (150, 20), [None; 2], |settings| {
        settings.sigma = covariance.clone();
        settings.noise_cost = true;
        settings.antithetic = true;
    });
    race(&families()[0], (100, 20), [None; 2], |settings| {
        settings.sigma = covariance;
        settings.noise = NoiseKind::Spline { knots: 6 };
    });
}

#[test]
fn networks_along_the_rollout() {
    let value = random_network(&[12, 20, 1], Activation::Tanh);
    let disturbance = random_network(&[12, 9, 9, 3], Activation::Relu);
    let cost = families()[1];
    race(&cost, (100, 12), [Some(&value), None], |_| {});
    race(&cost, (100, 12), [None, Some(&disturbance)], |settings| {
        settings.noise = NoiseKind::Colored { time: 4.0 };
    });
    race(&cost, (100, 12), [Some(&value), Some(&disturbance)], |settings| {
        settings.noise = NoiseKind::Spline { knots: 5 };
        settings.antithetic = true;
    });
}

/// One control per state, `x' = x + u / 10`; the cost is `|x - context|^2`.
#[derive(Clone)]
struct Drift<const N: usize>;

impl<const N: usize> System<N, N> for Drift<N> {
    fn name(&self) -> &str {
        "drift"
    }
    fn states(&self) -> [reachcast::system::Axis; N] {
        std::array::from_fn(|_| reachcast::system::Axis::new("x", "m", -1.0, 1.0))
    }
    fn controls(&self) -> [reachcast::system::Axis; N] {
        self.states()
    }
    fn step<R: Real>(&self, x: [R; N], u: [R; N]) -> [R; N] {
        std::array::from_fn(|i| x[i] + R::lit(0.1) * u[i])
    }
    fn target<R: Real>(&self, x: [R; N]) -> R {
        x[0]
    }
    fn constraint<R: Real>(&self, x: [R; N]) -> R {
        x[0]
    }
}

impl<const N: usize> Cost<N, N, 1> for Drift<N> {
    fn stage<R: Real>(&self, x: [R; N], _: [R; N], [goal]: [R; 1]) -> R {
        let terms = x.into_iter().map(|x| (x - goal) * (x - goal));
        terms.fold(R::lit(0.0), |sum, term| sum + term)
    }
}

/// 512 steps of 40 controls need more loop iterations than a thread may spend: both kernels are
/// split, and the noise has to survive that.
fn split<const N: usize>(noise: NoiseKind) {
    let system = Drift::<N>;
    let mut settings = MppiSettings::new(&system.controls(), 66, 512);
    settings.temperature = 50.0;
    settings.noise = noise;
    let spec = MppiSpec::new(settings).expect("settings");
    let context: Vec<_> = (0..512).map(|t| [0.3 * (0.01 * t as f32).sin()]).collect();
    let problem = MppiProblem::new([0.4; N], &[[-0.02; N]; 512], &context, stream(9));
    let planning = Planning::of(&system, system.clone(), spec);
    agree(&system, &system, &planning, &[problem]);
}

#[test]
fn plans_split_over_dispatches() {
    split::<40>(NoiseKind::Independent);
    split::<40>(NoiseKind::Colored { time: 20.0 });
    split::<40>(NoiseKind::Spline { knots: 500 });
    split::<1>(NoiseKind::Independent);
}

/// Costs, best and plan of each problem of a large batch against the host's.
fn chunked(problems: u32, samples: u32, value: Option<&Mlp>) {
    let Some(gpu) = gpu() else { return };
    let system = DoubleIntegrator::default();
    let mut settings = MppiSettings::new(&system.controls(), samples, 3);
    settings.temperature = 2.0;
    settings.antithetic = true;
    let spec = MppiSpec::new(settings).expect("settings");
    let problems: Vec<_> = (0..problems).map(|i| integrator_problem(i % 8, 3)).collect();
    let term = |network: &Mlp| ValueTerm {
        network: Arc::new(network.clone()),
        weight: 2.0,
        threshold: 0.5,
    };
    let planning = Planning {
        value: value.map(term),
        ..Planning::of::<_, _, 2, 1, 3>(&system, quadratic(), spec)
    };
    let device = improve(&Backend::Gpu(gpu), &planning, &task(&problems));
    let host = improve(&host(), &planning, &task(&problems));
    assert_eq!(device.len(), problems.len());
    for (number, (device, host)) in device.iter().zip(&host).enumerate() {
        assert_eq!(device.costs.len(), samples as usize);
        for (k, (a, b)) in device.costs.iter().zip(&host.costs).enumerate() {
            // Costs are below 100, of three stages.
            assert!((a - b).abs() <= 1e-4, "problem {number}, sample {k}: {a}, host {b}");
        }
        let best = device.costs[device.best as usize];
        assert_eq!(best, device.costs.iter().copied().fold(f32::INFINITY, f32::min));
        close(device, host, 1e-4);
    }
}

fn close(device: &MppiResult, host: &MppiResult, band: f32) {
    let relative = (device.effective_samples / host.effective_samples - 1.0).abs();
    assert!(relative <= 1e-3, "{} {}", device.effective_samples, host.effective_samples);
    for (a, b) in device.plan.iter().zip(&host.plan) {
        assert!((a - b).abs() <= band, "{a}, host {b}");
    }
}

#[test]
fn chunks_of_samples_and_of_problems() {
    // A network caps a chunk at 16,384 columns, a formula at 262,144.
    let value = random_network(&[2, 4, 1], Activation::Tanh);
    chunked(1, 40_001, Some(&value));
    chunked(5, 6_000, Some(&value));
    chunked(1, 300_000, None);
    chunked(280, 1_000, None);
}

/// A plan whose workgroups take several rounds of samples has the same bits in parts of any size.
#[test]
fn failures_change_no_bits_of_plans() {
    let system = DoubleIntegrator::default();
    let spec = MppiSpec::new(MppiSettings::new(&system.controls(), 140_001, 2)).expect("settings");
    let planning = Planning::of::<_, _, 2, 1, 3>(&system, quadratic(), spec);
    let problems = [integrator_problem(1, 2)];
    let task = MppiTask { costs: CostQuery::Summary, ..task(&problems) };
    let mut found = Vec::new();
    for halvings in [0, 1, 6, 10] {
        let Some(gpu) = gpu() else { return };
        let backend = Backend::Gpu(halved(gpu, halvings));
        found.push(improve(&backend, &planning, &task));
        assert_eq!(backend.events().len() as u64, halvings);
    }
    assert!(found.windows(2).all(|pair| pair[0] == pair[1]), "{found:?}");
}

#[test]
fn summaries_leave_the_costs_away() {
    let Some(gpu) = gpu() else { return };
    let system = DoubleIntegrator::default();
    let spec = MppiSpec::new(MppiSettings::new(&system.controls(), 100, 5)).expect("settings");
    let problems = [integrator_problem(0, 5)];
    let task = MppiTask { costs: CostQuery::Summary, ..task(&problems) };
    let backend = Backend::Gpu(gpu);
    let planning = Planning::of::<_, _, 2, 1, 3>(&system, quadratic(), spec);
    let program = backend.prepare_plans(&planning).expect("a program");
    let run = |task: &MppiTask<'_>| program.improve(task).expect("it runs").swap_remove(0);
    let first = run(&task);
    assert!(first.costs.is_empty());
    close(&first, &improve(&host(), &planning, &task)[0], 1e-5);
    assert_eq!(first, run(&task), "the same bits again");
    let next = run(&MppiTask { iteration: 4, ..task });
    assert_ne!(first.plan, next.plan, "each iteration has noise of its own");
    let none = MppiTask { problems: &[], ..task };
    assert!(program.improve(&none).expect("nothing to do").is_empty());
}

/// Infinite where a control is above the context.
#[derive(Clone)]
struct Cliff;

impl Cost<2, 1, 1> for Cliff {
    fn stage<R: Real>(&self, x: [R; 2], [u]: [R; 1], [edge]: [R; 1]) -> R {
        let far = R::lit(2e19) + R::lit(0.0) * x[0];
        edge.if_lt(u, far * far * far, u * u)
    }
}

#[test]
fn costs_that_are_not_finite_have_no_weight() {
    let Some(gpu) = gpu() else { return };
    let backend = Backend::Gpu(gpu);
    let system = DoubleIntegrator::default();
    let spec = MppiSpec::new(MppiSettings::new(&system.controls(), 100, 4)).expect("settings");
    let problem = |number, edge: f32| {
        MppiProblem::new([0.1, 0.0], &[[0.05]; 4], &[[edge]; 4], stream(number))
    };
    // Some above the edge, all above it, none.
    let problems = [problem(0, 0.2), problem(1, -2.0), problem(2, 2.0)];
    let (task, planning) = (task(&problems), Planning::of(&system, Cliff, spec));
    let device = improve(&backend, &planning, &task);
    for (number, result) in device.iter().enumerate() {
        let over = |k: u32| {
            let edge = problems[number].context[0];
            planning.controls(&problems[number], 3, k).iter().any(|u| *u > edge)
        };
        let lost: Vec<bool> = (0..100).map(over).collect();
        let infinite: Vec<bool> = result.costs.iter().map(|cost| cost.is_infinite()).collect();
        assert_eq!(infinite, lost, "problem {number}");
        assert_eq!(result.non_finite as usize, lost.iter().filter(|lost| **lost).count());
        assert!(result.plan.iter().all(|u| u.is_finite()));
    }
    assert!((1..100).contains(&device[0].non_finite), "{}", device[0].non_finite);
    assert_eq!(device[1].plan, problems[1].plan, "the nominal plan is kept");
    assert_eq!((device[1].effective_samples, device[1].best), (0.0, 0));
    assert!(device[1].least_cost.is_infinite());
    let host = improve(&host(), &planning, &task);
    close(&device[0], &host[0], 1e-5);
}

/// The cost is finite, and too large to count.
#[derive(Clone)]
struct Huge;

impl Cost<2, 1, 1> for Huge {
    fn stage<R: Real>(&self, x: [R; 2], [u]: [R; 1], _: [R; 1]) -> R {
        u.if_lt(R::lit(0.0), R::lit(2e30), R::lit(1.0)) + R::lit(0.0) * x[0]
    }
}

#[test]
fn huge_costs_count_as_infinite_on_both_backends() {
    let system = DoubleIntegrator::default();
    let spec = MppiSpec::new(MppiSettings::new(&system.controls(), 100, 1)).expect("settings");
    let problems = [MppiProblem::new([0.0; 2], &[[0.0]], &[[0.0]], stream(5))];
    let planning = Planning::of(&system, Huge, spec);
    let backends = std::iter::once(host()).chain(gpu().map(Backend::Gpu));
    for backend in backends {
        let result = improve(&backend, &planning, &task(&problems)).swap_remove(0);
        let infinite = result.costs.iter().filter(|cost| cost.is_infinite()).count();
        assert_eq!(infinite, result.non_finite as usize, "{}", backend.name());
        assert!((1..100).contains(&infinite));
        let weights = result.weights(1.0);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{}", backend.name());
    }
}
