//! On an adapter: the kernels against the host's starts, the f32 formulas and the f64 oracle.
//!
//! Without an adapter every test says so and passes, unless `REACHCAST_REQUIRE_GPU` is 1.

use std::path::Path;

use reachcast::backend::Backend;
use reachcast::backend::gpu::{AdapterKind, Choice, Gpu, adapters};
use reachcast::policy::{Activation, Layer, Mlp, OutputActivation, Policy};
use reachcast::real::Real;
use reachcast::rollout::{
    Ball, DeviationTask, Farthest, Fold, HUGE, NON_FINITE, PairControl, PairMeasure, Pairs, Plant,
    Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, Stream, Tightening, measure,
    pair_measures, trajectory,
};
use reachcast::system::{Axis, BangBang, DoubleIntegrator, DroneRace, System};
use reachcast::{Error, Result};

/// An adapter of any kind; `None`, said aloud, where there is none.
fn gpu() -> Option<Gpu> {
    match Gpu::open(&Choice::Any) {
        Ok(gpu) => Some(gpu),
        Err(e) if std::env::var("REACHCAST_REQUIRE_GPU").is_ok_and(|value| value == "1") => {
            panic!("REACHCAST_REQUIRE_GPU is 1: {e}")
        }
        Err(_) => {
            println!("SKIPPED: no adapter");
            None
        }
    }
}

/// Whether the adapter rounds every sum and product and contracts none: measured for lavapipe.
fn rounds_like_the_host(gpu: &Gpu) -> bool {
    gpu.adapter().kind == AdapterKind::Software
}

fn reach_avoid<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    gpu: Gpu,
    plant: Plant<'_, S, P>,
    task: &ReachAvoidTask<'_, NX>,
) -> (Gpu, Result<Vec<f32>>) {
    let backend = Backend::Gpu(gpu);
    let mut all = Vec::new();
    let result = backend.reach_avoid(plant, task, &mut |first, values| {
        assert_eq!(
            first,
            task.range.start + all.len() as u64,
            "order of the sink"
        );
        all.extend_from_slice(values);
        Ok(())
    });
    let Backend::Gpu(gpu) = backend else {
        unreachable!("it was made a GPU above")
    };
    (gpu, result.map(|()| all))
}

fn measures<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    gpu: Gpu,
    plant: Plant<'_, S, P>,
    task: &ReachAvoidTask<'_, NX>,
) -> (Gpu, Vec<f32>) {
    let (gpu, all) = reach_avoid(gpu, plant, task);
    let all = all.expect("a batch that runs");
    assert_eq!(all.len() as u64, task.range.end - task.range.start);
    (gpu, all)
}

fn deviation<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    gpu: Gpu,
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_, NX>,
) -> (Gpu, Vec<Farthest>, Vec<PairMeasure>) {
    let backend = Backend::Gpu(gpu);
    let mut all = Vec::new();
    let farthest = backend.deviation(plant, task, &mut |first, values| {
        assert_eq!(
            first,
            task.range.start + all.len() as u64,
            "order of the sink"
        );
        all.extend_from_slice(values);
        Ok(())
    });
    assert_eq!(all.len() as u64, task.range.end - task.range.start);
    let Backend::Gpu(gpu) = backend else {
        unreachable!("it was made a GPU above")
    };
    (gpu, farthest.expect("a batch that runs"), all)
}

/// The measure in f32 on the host, one state after the other.
fn measure_f32<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    start: [f32; NX],
    spec: &RolloutSpec,
    tightening: &Tightening,
) -> f32 {
    let mut fold = Fold::new();
    let states = trajectory::<f32, S, P, NX, NU>(plant, start, spec.horizon);
    for (t, x) in states.into_iter().enumerate() {
        fold.add(
            plant.system.target(x) - tightening.target[t],
            plant.system.constraint(x) - tightening.constraint[t],
            spec.gamma,
        );
    }
    fold.measure()
}

/// A tightening that differs at every step, so that no step can stand in for another.
fn ramp(spec: &RolloutSpec) -> Tightening {
    let steps = 0..=spec.horizon;
    Tightening {
        target: steps.clone().map(|t| 0.01 * t as f32).collect(),
        constraint: steps.map(|t| 0.02 * t as f32).collect(),
    }
}

/// The box of a system's axes.
fn whole_box<S: System<NX, NU>, const NX: usize, const NU: usize>(system: &S) -> Region<NX> {
    let axes = system.states();
    let (low, high) = (
        axes.each_ref().map(|a| a.low),
        axes.each_ref().map(|a| a.high),
    );
    Region::new_box(low, high).expect("the box of a system")
}

fn drawn<const NX: usize>(region: Region<NX>, seed: u64) -> Starts<'static, NX> {
    Starts::Drawn {
        region,
        stream: Stream::new(seed, Purpose::User, 3),
    }
}

fn race_policy() -> Mlp {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    Mlp::load(&root.join("configs/policies/race_policy.safetensors")).expect("the race policy")
}

/// A network with uniform weights of the variance that keeps activations in range.
fn random_network(widths: &[usize], activation: Activation) -> Mlp {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let layers = widths.windows(2).map(|pair| {
        let bound = (3.0 / pair[0] as f32).sqrt();
        Layer {
            weight: (0..pair[0] * pair[1]).map(|_| bound * uniform()).collect(),
            bias: (0..pair[1]).map(|_| 0.1 * uniform()).collect(),
            inputs: pair[0],
            outputs: pair[1],
        }
    });
    Mlp::new(layers.collect(), activation, OutputActivation::Tanh).expect("a whole network")
}

/// Every GPU measure lies within a multiple of the host's worst f32 distance from f64.
///
/// A GPU may contract products and sum a layer in another order, each of which changes rounding
/// by a small factor; hence 8. The floor covers batches in which f32 happens to be exact.
fn assert_close_to_f64<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &ReachAvoidTask<'_, NX>,
    gpu: &[f32],
) {
    let starts = task.range.clone().map(|index| task.starts.start(index));
    let both: Vec<(f64, f64)> = starts
        .map(|start| {
            let oracle = measure(plant, start, &task.spec, task.tightening);
            let host = measure_f32(plant, start, &task.spec, task.tightening);
            (oracle, (f64::from(host) - oracle).abs())
        })
        .collect();
    let worst = both
        .iter()
        .map(|(_, distance)| *distance)
        .fold(0.0, f64::max);
    let band = 8.0 * worst + 1e-6;
    for (i, ((oracle, _), &gpu)) in both.iter().zip(gpu).enumerate() {
        let distance = (f64::from(gpu) - oracle).abs();
        assert!(
            distance <= band,
            "start {i}: gpu {gpu}, f64 {oracle}, band {band}"
        );
    }
}

/// A system whose measure is one coordinate of the start: it leaves for far below at once.
struct Reveal<const NX: usize>(usize);

/// Where [`Reveal`] goes.
const FAR_BELOW: f32 = -1.0e6;

impl<const NX: usize> System<NX, 1> for Reveal<NX> {
    fn name(&self) -> &str {
        "reveal"
    }
    fn states(&self) -> [Axis; NX] {
        std::array::from_fn(|_| Axis::new("x", "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, _: [R; NX], [u]: [R; 1]) -> [R; NX] {
        [R::lit(FAR_BELOW) + R::lit(0.0) * u; NX]
    }
    fn target<R: Real>(&self, x: [R; NX]) -> R {
        x[self.0]
    }
    fn constraint<R: Real>(&self, _: [R; NX]) -> R {
        R::lit(-FAR_BELOW)
    }
}

/// Counts its steps in the first state; squares the second, which overflows if above 1.
struct Count;

impl System<2, 1> for Count {
    fn name(&self) -> &str {
        "count"
    }
    fn states(&self) -> [Axis; 2] {
        [Axis::new("n", "", 0.0, 1.0), Axis::new("x", "", 0.0, 1.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [n, x]: [R; 2], [u]: [R; 1]) -> [R; 2] {
        [n + R::lit(1.0) + R::lit(0.0) * u, x * x]
    }
    fn target<R: Real>(&self, [n, _]: [R; 2]) -> R {
        n
    }
    fn constraint<R: Real>(&self, _: [R; 2]) -> R {
        R::lit(-FAR_BELOW)
    }
}

/// A formula for any system: the control is 0.
struct Idle;

impl<const NX: usize, const NU: usize> Policy<NX, NU> for Idle {
    fn name(&self) -> String {
        "idle".to_owned()
    }
    fn control<R: Real>(&self, _: [R; NX]) -> [R; NU] {
        [R::lit(0.0); NU]
    }
}

fn bits(values: impl IntoIterator<Item = f32>) -> Vec<u32> {
    values.into_iter().map(f32::to_bits).collect()
}

fn revealed_starts<const NX: usize>(mut gpu: Gpu, starts: &Starts<'_, NX>, first: u64) -> Gpu {
    let spec = RolloutSpec::new(1, 0.5).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = ReachAvoidTask {
        starts: starts.clone(),
        range: first..first + 300,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    for coordinate in 0..NX {
        let system = Reveal::<NX>(coordinate);
        let plant = Plant {
            system: &system,
            policy: &Idle,
        };
        let (back, found) = measures::<_, _, NX, 1>(gpu, plant, &task);
        gpu = back;
        let expected = task.range.clone().map(|i| starts.start(i)[coordinate]);
        assert_eq!(
            bits(found),
            bits(expected),
            "coordinate {coordinate} of {NX}"
        );
    }
    gpu
}

#[test]
fn starts_have_the_host_bits() {
    let Some(mut gpu) = gpu() else { return };
    // Across 2^32, where the index carries into its high word.
    let first = (1 << 32) - 150;
    let low = [-1.5, 0.25, -7.0, 0.1, 2.0];
    let high = [1.5, 0.75, 9.0, 0.1, 2.5];
    let region = Region::new_box(low, high).expect("a box");
    gpu = revealed_starts(gpu, &drawn(region, 0x1234_5678_9abc_def0), first);
    let list: Vec<[f32; 5]> = (0..700)
        .map(|i| [0.1 * i as f32, 1.0, -2.0, 3.0, 0.7])
        .collect();
    gpu = revealed_starts(gpu, &Starts::Listed(&list), 123);
    for varies in [[true; 6], [true, false, true, true, false, true]] {
        let ball = Ball {
            center: [0.3, -0.2, 1.0, 0.0, 5.0, -0.7],
            radius: 0.55,
            varies,
        };
        gpu = revealed_starts(gpu, &drawn(Region::Ball(ball), 7), first);
    }
    let interval = Region::new_box([-1.0], [2.0]).expect("an interval");
    revealed_starts(gpu, &drawn(interval, 7), 0);
}

#[test]
fn pairs_have_the_host_bits() {
    let Some(mut gpu) = gpu() else { return };
    let spec = RolloutSpec::new(1, 0.5).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let pairs = Pairs {
        nominal: drawn(
            Region::new_box([-1.0; 3], [1.0, 2.0, 3.0]).expect("a box"),
            11,
        ),
        radius: 0.1,
        stream: Stream::new(12, Purpose::DeviationPerturbation, 0),
    };
    let task = DeviationTask {
        pairs: pairs.clone(),
        range: 5..305,
        spec,
        tightening: &tightening,
        control: PairControl::Replay,
    };
    for coordinate in 0..3 {
        let system = Reveal::<3>(coordinate);
        let plant = Plant {
            system: &system,
            policy: &Idle,
        };
        let (back, _, found) = deviation::<_, _, 3, 1>(gpu, plant, &task);
        gpu = back;
        let expected = (5..305).map(|i| pairs.load::<1>(i).map(|x| x[coordinate].0[0]));
        let (nominal, perturbed): (Vec<f32>, Vec<f32>) = expected
            .map(|[nominal, perturbed]| (nominal, perturbed))
            .unzip();
        assert_eq!(bits(found.iter().map(|m| m.nominal)), bits(nominal));
        assert_eq!(bits(found.iter().map(|m| m.perturbed)), bits(perturbed));
    }
}

#[test]
fn formula_measures_have_the_host_bits_where_nothing_is_contracted() {
    let Some(gpu) = gpu() else { return };
    let exact = rounds_like_the_host(&gpu);
    let system = DoubleIntegrator::default();
    let policy = BangBang { acceleration: 1.0 };
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(40, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 21),
        range: 0..1000,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, found) = measures(gpu, plant, &task);
    let host = |i| measure_f32(plant, task.starts.start(i), &spec, &tightening);
    let equal = (0..1000).filter(|&i| found[i as usize] == host(i)).count();
    // A contracted product can flip the bang-bang control, but only next to the switch.
    let least = if exact { 1000 } else { 900 };
    assert!(equal >= least, "{equal} of 1000 measures equal the host's");
}

#[test]
fn race_measures_lie_within_a_band_around_f64() {
    let Some(gpu) = gpu() else { return };
    let (system, policy) = (DroneRace::default(), race_policy());
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(30, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 22),
        range: 0..300,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, found) = measures(gpu, plant, &task);
    assert_close_to_f64(plant, &task, &found);
}

#[test]
fn wide_networks_of_every_activation() {
    let Some(mut gpu) = gpu() else { return };
    let system = DroneRace::default();
    let spec = RolloutSpec::new(3, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let cases = [
        (vec![12, 512, 512, 512, 512, 3], Activation::Relu, 40),
        (vec![12, 67, 3], Activation::Tanh, 270),
        (vec![12, 5, 9, 3], Activation::Silu, 270),
        (vec![12, 3], Activation::Relu, 10),
    ];
    for (widths, activation, count) in cases {
        let policy = random_network(&widths, activation);
        let plant = Plant {
            system: &system,
            policy: &policy,
        };
        let task = ReachAvoidTask {
            starts: drawn(whole_box(&system), 23),
            range: 0..count,
            spec,
            tightening: &tightening,
            query: Query::Measure,
        };
        let (back, found) = measures(gpu, plant, &task);
        gpu = back;
        assert_close_to_f64(plant, &task, &found);
    }
}

#[test]
fn sign_query_equals_the_sign_of_the_measure() {
    let Some(gpu) = gpu() else { return };
    let (race, network) = (DroneRace::default(), race_policy());
    let integrator = DoubleIntegrator::default();
    let formula = BangBang { acceleration: 1.0 };
    let gpu = assert_signs(gpu, &race, &network, 30, 700);
    assert_signs(gpu, &integrator, &formula, 100, 3000);
}

fn assert_signs<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    gpu: Gpu,
    system: &S,
    policy: &P,
    horizon: u32,
    count: u64,
) -> Gpu {
    let plant = Plant { system, policy };
    let spec = RolloutSpec::new(horizon, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let mut task = ReachAvoidTask {
        starts: drawn(whole_box(system), 24),
        range: 40..40 + count,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (gpu, dense) = measures(gpu, plant, &task);
    task.query = Query::Sign;
    let (gpu, signs) = measures(gpu, plant, &task);
    let expected: Vec<f32> = dense
        .iter()
        .map(|g| if *g > 0.0 { 1.0 } else { -1.0 })
        .collect();
    assert_eq!(signs, expected);
    let passed = expected.iter().filter(|sign| **sign > 0.0).count();
    assert!(
        passed > 0 && passed < expected.len(),
        "{passed} of {count}: one sign only"
    );
    gpu
}

#[test]
fn deviation_of_the_race_against_f64() {
    let Some(mut gpu) = gpu() else { return };
    let (system, policy) = (DroneRace::default(), race_policy());
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(30, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    for control in [PairControl::Replay, PairControl::ClosedLoop] {
        let task = DeviationTask {
            pairs: Pairs {
                nominal: drawn(whole_box(&system), 25),
                radius: 0.1,
                stream: Stream::new(25, Purpose::DeviationPerturbation, 0),
            },
            range: 100..400,
            spec,
            tightening: &tightening,
            control,
        };
        let (back, farthest, found) = deviation(gpu, plant, &task);
        gpu = back;
        assert_pairs_close_to_f64(plant, &task, &found);
        assert_farthest_close_to_f64(plant, &task, &farthest);
    }
}

/// Errors of an f32 rollout of the race, absolute: its margins are at most about 40, its worst
/// f32 measures lie 1e-5 from f64, and a GPU gets 8 times that.
const RACE_BAND: f64 = 8e-5;

fn assert_pairs_close_to_f64(
    plant: Plant<'_, DroneRace, Mlp>,
    task: &DeviationTask<'_, 12>,
    found: &[PairMeasure],
) {
    for (pair, found) in task.range.clone().zip(found) {
        let starts = task.pairs.load::<1>(pair).map(|x| x.map(|x| x.0[0]));
        let (nominal, perturbed) =
            pair_measures(plant, starts, &task.spec, task.tightening, task.control);
        let gap = (f64::from(found.nominal) - nominal).abs();
        assert!(
            gap <= RACE_BAND,
            "nominal of {pair}: {found:?}, f64 {nominal}"
        );
        let gap = (f64::from(found.perturbed) - perturbed).abs();
        assert!(
            gap <= RACE_BAND,
            "perturbed of {pair}: {found:?}, f64 {perturbed}"
        );
    }
}

/// Distances of a pair at each step, in f64.
fn distances<S: System<NX, NU>, P: Policy<NX, NU>, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_, NX>,
    pair: u64,
) -> Vec<f64> {
    let [mut a, mut b] = task
        .pairs
        .load::<1>(pair)
        .map(|x| x.map(|x| f64::from(x.0[0])));
    let mut all = Vec::new();
    for _ in 0..=task.spec.horizon {
        let square: f64 = a.iter().zip(&b).map(|(a, b)| (b - a).powi(2)).sum();
        all.push(square.sqrt());
        let u = plant.policy.control(a);
        b = match task.control {
            PairControl::Replay => plant.system.step(b, u),
            PairControl::ClosedLoop => plant.system.step(b, plant.policy.control(b)),
        };
        a = plant.system.step(a, u);
    }
    all
}

fn assert_farthest_close_to_f64<S, P, const NX: usize, const NU: usize>(
    plant: Plant<'_, S, P>,
    task: &DeviationTask<'_, NX>,
    farthest: &[Farthest],
) where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let first = task.range.start;
    let all: Vec<Vec<f64>> = task
        .range
        .clone()
        .map(|pair| distances(plant, task, pair))
        .collect();
    assert_eq!(farthest.len(), task.spec.horizon as usize + 1);
    for (t, found) in farthest.iter().enumerate() {
        let largest = all.iter().map(|distances| distances[t]).fold(0.0, f64::max);
        let claimed = all[(found.pair - first) as usize][t];
        let gap = (f64::from(found.distance) - largest).abs();
        assert!(gap <= RACE_BAND, "step {t}: {found:?}, f64 {largest}");
        let gap = (claimed - largest).abs();
        assert!(
            gap <= RACE_BAND,
            "step {t}: pair {} is at {claimed}, {largest}",
            found.pair
        );
    }
}

#[test]
fn equal_distances_go_to_the_first_pair() {
    let Some(gpu) = gpu() else { return };
    let system = Reveal::<3>(0);
    let plant = Plant {
        system: &system,
        policy: &Idle,
    };
    let spec = RolloutSpec::new(40, 0.5).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = DeviationTask {
        pairs: Pairs {
            nominal: drawn(Region::new_box([-1.0; 3], [1.0; 3]).expect("a box"), 11),
            radius: 0.1,
            stream: Stream::new(12, Purpose::DeviationPerturbation, 0),
        },
        range: 77..777,
        spec,
        tightening: &tightening,
        control: PairControl::Replay,
    };
    let (_, farthest, _) = deviation::<_, _, 3, 1>(gpu, plant, &task);
    assert!(farthest[0].distance > 0.09 && farthest[0].distance < 0.1001);
    let together = Farthest {
        distance: 0.0,
        pair: 77,
    };
    assert!(
        farthest[1..].iter().all(|found| *found == together),
        "{farthest:?}"
    );
}

#[test]
fn chunks_join_without_a_seam() {
    let Some(gpu) = gpu() else { return };
    let system = DoubleIntegrator::default();
    let policy = BangBang { acceleration: 1.0 };
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(5, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let mut task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 26),
        range: 0..(1 << 18) + 1000,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (gpu, whole) = measures(gpu, plant, &task);
    task.range = (1 << 18) - 500..(1 << 18) + 1000;
    let (gpu, part) = measures(gpu, plant, &task);
    assert_eq!(part, whole[(1 << 18) - 500..]);

    let (system, policy) = (DroneRace::default(), race_policy());
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(2, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let pairs = |range| DeviationTask {
        pairs: Pairs {
            nominal: drawn(whole_box(&system), 27),
            radius: 0.1,
            stream: Stream::new(27, Purpose::DeviationPerturbation, 0),
        },
        range,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    let (gpu, farthest, whole) = deviation(gpu, plant, &pairs(0..(1 << 14) + 300));
    let (gpu, before, left) = deviation(gpu, plant, &pairs(0..(1 << 14) - 100));
    let (_, after, right) = deviation(gpu, plant, &pairs((1 << 14) - 100..(1 << 14) + 300));
    assert_eq!(whole, [left, right].concat());
    let merged: Vec<Farthest> = before.iter().zip(after).map(|(a, b)| a.merge(b)).collect();
    assert_eq!(farthest, merged);
}

#[test]
fn every_step_of_a_long_horizon_is_taken() {
    let Some(mut gpu) = gpu() else { return };
    let list: Vec<[f32; 2]> = (0..10).map(|i| [i as f32, 0.5]).collect();
    let horizon = 10_000;
    let spec = RolloutSpec::new(horizon, 1.0).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let plant = Plant {
        system: &Count,
        policy: &Idle,
    };
    let task = ReachAvoidTask {
        starts: Starts::Listed(&list),
        range: 0..10,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    // The margin is the number of steps taken, so the measure shows the final state.
    let expected: Vec<f32> = (0..10).map(|i| (i + horizon) as f32).collect();
    let (back, found) = measures::<_, _, 2, 1>(gpu, plant, &task);
    gpu = back;
    assert_eq!(found, expected);
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Listed(&list),
            radius: 0.0,
            stream: Stream::new(1, Purpose::User, 0),
        },
        range: 0..10,
        spec,
        tightening: &tightening,
        control: PairControl::ClosedLoop,
    };
    let (back, farthest, pairs) = deviation::<_, _, 2, 1>(gpu, plant, &task);
    gpu = back;
    assert_eq!(farthest.len(), horizon as usize + 1);
    for (pair, expected) in pairs.iter().zip(&expected) {
        assert_eq!([pair.nominal, pair.perturbed], [*expected; 2]);
    }

    // Under a network, steps are dispatches of their own: cross a submission there too.
    let policy = random_network(&[2, 4, 1], Activation::Relu);
    let plant = Plant {
        system: &Count,
        policy: &policy,
    };
    let spec = RolloutSpec::new(150, 1.0).expect("a horizon");
    let mut target = vec![1000.0; 151];
    target[150] = 0.0;
    let tightening = Tightening {
        constraint: vec![0.0; 151],
        target,
    };
    // Only the last state counts: its margin is 150 above the start's, less 149.5.
    let starts = [[-149.5, 0.5], [-150.5, 0.5]];
    for (query, expected) in [(Query::Measure, [0.5, -0.5]), (Query::Sign, [1.0, -1.0])] {
        let task = ReachAvoidTask {
            starts: Starts::Listed(&starts),
            range: 0..2,
            spec,
            tightening: &tightening,
            query,
        };
        let (back, found) = measures(gpu, plant, &task);
        gpu = back;
        assert_eq!(found, expected);
    }
}

#[test]
fn non_finite_states_fail_unless_the_target_was_reached() {
    let Some(mut gpu) = gpu() else { return };
    // The second state overflows after 7 squarings of 2; the first reaches 0 from -3 before that
    // (a margin of 3 at t = 6), from -20 not.
    let nan = f32::NAN;
    let starts = [
        [-3.0, 2.0],
        [-20.0, 2.0],
        [-20.0, 0.5],
        [nan, 0.5],
        [1.0, f32::INFINITY],
    ];
    let spec = RolloutSpec::new(19, 1.0).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let network = random_network(&[2, 4, 1], Activation::Tanh);
    let dense = [3.0, NON_FINITE, -1.0, NON_FINITE, NON_FINITE];
    let signs = [1.0, NON_FINITE, -1.0, NON_FINITE, NON_FINITE];
    for (query, expected) in [(Query::Measure, dense), (Query::Sign, signs)] {
        let task = ReachAvoidTask {
            starts: Starts::Listed(&starts),
            range: 0..5,
            spec,
            tightening: &tightening,
            query,
        };
        let formula = Plant {
            system: &Count,
            policy: &Idle,
        };
        let (back, found) = measures::<_, _, 2, 1>(gpu, formula, &task);
        assert_eq!(found, expected, "{query:?} under a formula");
        let driven = Plant {
            system: &Count,
            policy: &network,
        };
        let (back, found) = measures(back, driven, &task);
        gpu = back;
        assert_eq!(found, expected, "{query:?} under a network");
    }
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Listed(&starts[..3]),
            radius: 0.01,
            stream: Stream::new(1, Purpose::User, 0),
        },
        range: 0..3,
        spec,
        tightening: &tightening,
        control: PairControl::Replay,
    };
    let plant = Plant {
        system: &Count,
        policy: &Idle,
    };
    let (_, farthest, pairs) = deviation::<_, _, 2, 1>(gpu, plant, &task);
    assert!(pairs[0].nominal == 3.0 && pairs[1].nominal == NON_FINITE);
    assert!(pairs[0].perturbed > 2.9 && pairs[1].perturbed == NON_FINITE);
    assert!(farthest[0].distance <= 0.0101, "{farthest:?}");
    let overflowed = Farthest {
        distance: HUGE,
        pair: 0,
    };
    assert!(
        farthest[8..].iter().all(|found| *found == overflowed),
        "{farthest:?}"
    );
}

#[test]
fn an_error_of_the_sink_stops_the_batch() {
    let Some(gpu) = gpu() else { return };
    let system = DoubleIntegrator::default();
    let policy = BangBang { acceleration: 1.0 };
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(1, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 1),
        range: 0..600_000,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let mut calls = 0;
    let result = Backend::Gpu(gpu).reach_avoid(plant, &task, &mut |_, _| {
        calls += 1;
        Err(Error::Interrupted)
    });
    assert!(matches!(result, Err(Error::Interrupted)), "{result:?}");
    assert_eq!(calls, 1);
}

/// Measures of a small race batch with every kernel's text changed from `old` to `new`.
fn mutated(gpu: Gpu, old: &'static str, new: &'static str) -> Result<Vec<f32>> {
    let (system, policy) = (DroneRace::default(), race_policy());
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(10, 0.95).expect("a horizon");
    let tightening = ramp(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 28),
        range: 0..50,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let gpu = gpu.with_shader_edit(move |text| text.replace(old, new));
    reach_avoid(gpu, plant, &task).1
}

#[test]
fn edited_kernels_are_the_ones_that_run() {
    let Some(first) = gpu() else { return };
    let plain = mutated(first, "no such text", "").expect("kernels as they are");
    let Some(second) = gpu() else { return };
    let edited = mutated(second, "discount * constraint_margin", "constraint_margin");
    assert_ne!(edited.expect("an edited kernel that is valid"), plain);
}

#[test]
fn a_kernel_that_does_not_compile_is_a_device_failure() {
    let Some(gpu) = gpu() else { return };
    let result = mutated(gpu, "fn judge(", "fn judge(,");
    assert!(matches!(&result, Err(Error::DeviceFailed(_))), "{result:?}");
}

#[test]
fn a_network_of_the_wrong_shape_is_refused() {
    let Some(gpu) = gpu() else { return };
    let (system, policy) = (
        DroneRace::default(),
        random_network(&[11, 8, 3], Activation::Relu),
    );
    let plant = Plant {
        system: &system,
        policy: &policy,
    };
    let spec = RolloutSpec::new(1, 0.95).expect("a horizon");
    let tightening = Tightening::none(&spec);
    let task = ReachAvoidTask {
        starts: drawn(whole_box(&system), 1),
        range: 0..1,
        spec,
        tightening: &tightening,
        query: Query::Measure,
    };
    let (_, result) = reach_avoid(gpu, plant, &task);
    let text = result.expect_err("11 inputs for 12 states").to_string();
    assert!(
        text.contains("11 inputs") && text.contains("12 states"),
        "{text}"
    );
}

#[test]
fn adapters_that_are_not_there_are_refused_with_what_is() {
    let name = "no such adapter";
    let error = Gpu::open(&Choice::Named(name.to_owned())).expect_err("a made-up name");
    let Error::Device(text) = error else {
        panic!("{error:?}")
    };
    for adapter in adapters() {
        assert!(
            text.contains(name) && text.contains(&adapter.name),
            "{text}"
        );
    }
    assert!(text.contains("CPU backend"), "{text}");
}
