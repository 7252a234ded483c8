//! What the integration tests share: backends, settings, the known reach-avoid set, exact limits.

#![allow(dead_code, reason = "each test file uses a part of it")]

pub(crate) mod activations;
#[path = "../pessimist/mod.rs"]
pub(crate) mod pessimist;

use nalgebra::DMatrix;
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::backend::gpu::{Choice, Gpu};
use reachcast::policy::Mlp;
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{PairControl, RolloutSpec};
use reachcast::scenario::Keys;
use reachcast::scenario::growth_plan::GrowthPlan;
use reachcast::scenario::settings::{
    BoundarySearch, ConstantSettings, DeviationSettings, DeviationSource, GlobalSettings,
    GrowthSettings, Joint, Settings, SliceAxis,
};
use reachcast::system::{DoubleIntegrator, System};
use statrs::distribution::{Binomial, DiscreteCDF};
use std::path::Path;

/// Chance that a test of a true statement fails, for fixed seeds drawn once.
pub(crate) const FALSE_ALARM: f64 = 1e-6;

/// The native CPU with `threads` threads.
pub(crate) fn cpu(threads: usize) -> Backend {
    Backend::Cpu(Cpu::new(Some(threads)).expect("threads start"))
}

/// An adapter, software included, as pessimistic as `REACHCAST_PESSIMIST` asks for; where none opens this is said, and is a failure if
/// `REACHCAST_REQUIRE_GPU` is 1.
pub(crate) fn adapter() -> Option<Gpu> {
    match Gpu::open(&Choice::Any) {
        Ok(gpu) => Some(pessimist::as_asked(gpu)),
        Err(error) if std::env::var("REACHCAST_REQUIRE_GPU").is_ok_and(|value| value == "1") => {
            panic!("REACHCAST_REQUIRE_GPU is 1: {error}")
        }
        Err(_) => {
            println!("SKIPPED: no adapter");
            None
        }
    }
}

/// Every backend of this machine: the CPU, and an adapter where one opens.
pub(crate) fn backends() -> Vec<Backend> {
    std::iter::once(cpu(2)).chain(adapter().map(Backend::Gpu)).collect()
}

/// The trained race policy of the repository.
pub(crate) fn race_policy() -> Mlp {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    Mlp::load(&root.join("configs/policies/race_policy.safetensors")).expect("policy loads")
}

/// Settings over the system's own box: small counts, constants 1, the state at the centre.
pub(crate) fn settings<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    horizon: u32,
) -> Settings {
    let axes = system.states();
    let values = |axis: usize| {
        let (low, high) = (axes[axis].low, axes[axis].high);
        (1..20).map(|i| low + (high - low) * i as f32 / 20.0).collect()
    };
    Settings {
        seed: 1,
        spec: RolloutSpec::new(horizon, 0.95).expect("spec"),
        low: axes.iter().map(|axis| axis.low).collect(),
        high: axes.iter().map(|axis| axis.high).collect(),
        constants: ConstantSettings {
            target: Some(1.0),
            constraint: Some(1.0),
            ..Default::default()
        },
        deviation: DeviationSettings {
            radius: 0.1,
            epsilon: 0.1,
            beta: 1e-3,
            scenarios: 66,
            pilot: 32,
            joint: Joint::FixedShape,
            control: PairControl::Replay,
            source: DeviationSource::Scenario,
        },
        global: GlobalSettings { draws: 600, beta: 1e-3 },
        whole_box: None,
        drops: None,
        enclosed: None,
        deterministic: None,
        slice: Some([0, 1].map(|state| SliceAxis { state, values: values(state) })),
        state: axes.iter().map(|axis| 0.5 * (axis.low + axis.high)).collect(),
        growth: GrowthSettings {
            radius: 0.1,
            rounds: 5,
            scenarios: 81,
            epsilon: 0.1,
            beta: 1e-3,
            split_beta: true,
            varies: vec![true; NX],
            boundary: BoundarySearch::Slice,
            heading: None,
            plan: GrowthPlan::SHRINKING,
        },
        sequential: None,
        attempt: None,
        keys: Keys::Seed,
    }
}

/// A small certificate of the race: constants of the published study's order, a picture of the
/// x-y plane, growth in the ego's x and y.
pub(crate) fn race_settings(system: &DroneRace) -> Settings {
    let mut settings = settings(system, 30);
    settings.constants =
        ConstantSettings { target: Some(14.15), constraint: Some(14.43), ..Default::default() };
    settings.deviation.radius = 0.02;
    let axes = [(0, -0.9, 0.1, 18_u16), (2, -2.6, 0.2, 13)];
    settings.slice = Some(axes.map(|(state, low, step, count)| SliceAxis {
        state,
        values: (0..count).map(|i| low + step * f32::from(i)).collect(),
    }));
    settings.state = vec![0.4, 0.0, -2.2, 0.7, 0.0, 0.0, 0.4, 0.0, -2.2, 0.3, 0.0, 0.0];
    settings.growth.varies = (0..12).map(|i| i == 0 || i == 2).collect();
    settings
}

/// The scalar `literal` as the systems see it: an f32, held in f64.
pub(crate) fn literal(value: f32) -> f64 {
    <f64 as Real>::lit(value)
}

/// The double integrator's reach-avoid set in closed form.
///
/// Let p be at least 0 (the other half is its mirror image). Every control u >= -a leaves the
/// position at each step at least as high as full braking does, so braking is best for the target
/// `p < target` and for the constraint `p < corridor` at once, and bang-bang brakes as long as
/// p >= 0. By summation of the Euler steps `p += dt v, v -= dt a`,
///     p_t = p + q_t(v),   q_t(v) = t dt v - a dt^2 t (t - 1) / 2.
/// With margins that lose `loss_t`, the start succeeds at step t if `p + q_t < target - loss_t` and
/// `p + q_s < corridor - loss_s` for all s <= t: that is, p lies below
///     reach(v) = max over t <= T of min(target - loss_t - q_t, min over s <= t of corridor - loss_s - q_s).
/// This needs that no step leaps over the tightened target: the first position below
/// `target - loss_t` comes from above it, so it is in the target unless the step is longer than its
/// width. From |v| <= 1.5 m/s, braking over at most 0.75 m leaves |v| below 2.1 m/s, a step is
/// below 0.21 m, and the tightened targets of these tests are wider.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClosedForm {
    /// Step of the integration.
    pub(crate) dt: f64,
    /// Bound on the acceleration.
    pub(crate) acceleration: f64,
    /// Half width of the target.
    pub(crate) target: f64,
    /// Half width of the corridor.
    pub(crate) corridor: f64,
}

impl ClosedForm {
    /// That of the default double integrator, whose step is the f32 nearest to 0.1 s.
    pub(crate) fn of(system: &DoubleIntegrator) -> Self {
        Self {
            dt: literal(0.1),
            acceleration: literal(system.acceleration),
            target: literal(system.target),
            corridor: literal(system.corridor),
        }
    }

    /// `reach(v)`: a start `(p, v)` with p >= 0 succeeds iff p lies below it. `loss` is `[T + 1]`.
    pub(crate) fn reach(&self, velocity: f64, loss: &[f64]) -> f64 {
        let (mut safe, mut best) = (f64::INFINITY, f64::NEG_INFINITY);
        for (t, loss) in loss.iter().enumerate() {
            let t = t as f64;
            let shift = t * self.dt * velocity
                - 0.5 * self.acceleration * self.dt * self.dt * t * (t - 1.0);
            safe = f64::min(safe, self.corridor - loss - shift);
            best = f64::max(best, f64::min(safe, self.target - loss - shift));
        }
        best
    }

    /// Whether `(p, v)` reaches the target safely.
    pub(crate) fn contains(&self, [position, velocity]: [f64; 2], loss: &[f64]) -> bool {
        let velocity = if position < 0.0 { -velocity } else { velocity };
        position.abs() < self.reach(velocity, loss)
    }

    /// Share of the box `|p| <= width, |v| <= speed` that succeeds: the set's two halves mirror
    /// each other, so it is the mean of `reach(v) / width`, clipped to [0, 1].
    pub(crate) fn share(&self, width: f64, speed: f64, loss: &[f64]) -> f64 {
        const NODES: usize = 20_000;
        let node = |i: usize| {
            let velocity = speed * ((2 * i + 1) as f64 / NODES as f64 - 1.0);
            (self.reach(velocity, loss) / width).clamp(0.0, 1.0)
        };
        (0..NODES).map(node).sum::<f64>() / NODES as f64
    }
}

/// The exact supremum of the deviation over a ball, `radius * sigma_max(A^t)` for t = 0..=horizon.
///
/// A by columns: the step from each unit vector minus the step from 0, in f64, with no control.
pub(crate) fn supremum<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    radius: f64,
    horizon: u32,
) -> Vec<f64> {
    let origin = system.step([0.0_f64; NX], [0.0; NU]);
    let mut matrix = DMatrix::zeros(NX, NX);
    for column in 0..NX {
        let unit: [f64; NX] = std::array::from_fn(|i| f64::from(u8::from(i == column)));
        let image = system.step(unit, [0.0; NU]);
        for row in 0..NX {
            matrix[(row, column)] = image[row] - origin[row];
        }
    }
    let mut power = DMatrix::identity(NX, NX);
    let mut bound = Vec::new();
    for _ in 0..=horizon {
        bound.push(radius * power.singular_values().max());
        power = &matrix * power;
    }
    bound
}

/// The most successes of `trials` that a chance of at most `p` explains: a larger number has
/// probability at most [`FALSE_ALARM`].
pub(crate) fn binomial_limit(trials: u64, p: f64) -> u64 {
    let count = Binomial::new(p, trials).expect("binomial");
    let (mut low, mut high) = (0, trials);
    while low < high {
        let middle = low + (high - low) / 2;
        if count.sf(middle) <= FALSE_ALARM {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}
