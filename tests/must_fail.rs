//! Checks that must fail: a parity check that does not notice a changed kernel proves nothing.
//!
//! Each test changes the composed WGSL in one place and requires the comparison with the f64
//! reference to see it; the comparison itself passes on the kernels as they are.

mod common;
#[path = "oracle/costs.rs"]
mod costs;
#[path = "oracle/drive.rs"]
mod drive;
#[path = "oracle/functions.rs"]
#[allow(dead_code, reason = "the suite has more cases than mutants")]
mod functions;
mod models;
#[path = "oracle/mppi.rs"]
mod oracle;

use std::sync::Arc;

use common::{adapter, race_policy};
use functions::{Case, disagreement};
use reachcast::backend::Backend;
use reachcast::backend::gpu::{Form, Gpu, NetworkKernels};
use reachcast::cost::Quadratic;
use reachcast::formula::Function;
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp, Policy};
use reachcast::race::DroneRace;
use reachcast::real::Real;
use reachcast::rollout::{
    Ball, CostQuery, DeviationTask, Disturbance, MppiProblem, MppiSettings, MppiSpec, MppiTask,
    NON_FINITE, NoiseKind, PairControl, Pairs, Planning, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Sigma, Starts, States, Stream, Tightening, ValueTerm, replay,
};
use reachcast::system::{Axis, BangBang, DoubleIntegrator, System};

/// Starts of each comparison.
const BATCH: u64 = 96;
/// Steps.
const HORIZON: u32 = 20;
/// Largest distance from f64 that parity allows; the suite measures below 2e-5 on this batch.
const BAND: f64 = 1e-3;

/// Losses that differ from step to step and from each other.
fn losses(spec: &RolloutSpec) -> Tightening {
    let steps = 0..=spec.horizon;
    Tightening {
        target: steps.clone().map(|t| 0.05 + 0.01 * t as f32).collect(),
        constraint: steps.map(|t| 0.02 + 0.003 * t as f32).collect(),
        ..Tightening::default()
    }
}

/// Whether the adapter agrees with f64 on measures, signs, pairs and distances of the race and
/// the double integrator; a kernel that no longer compiles does not.
fn parity(gpu: Gpu) -> bool {
    let backend = Backend::Gpu(gpu);
    let race = DroneRace::default();
    let (low, high) = (race.states().map(|a| a.low), race.states().map(|a| a.high));
    let region = Region::new_box(low, high).expect("box");
    let plant = Plant::of(race, race_policy());
    let ball = Region::Ball(Ball {
        center: vec![0.3, 0.0, -1.5, 0.6, 0.0, 0.0, -0.4, 0.0, -2.0, 0.3, 0.0, 0.0],
        radius: 0.4,
        varies: vec![true; 12],
    });
    let simple = Plant::of(DoubleIntegrator::default(), BangBang { acceleration: 1.0 });
    let square = Region::new_box([-1.2, -1.5], [1.2, 1.5]).expect("box");
    measures_agree(&backend, &plant, region.clone())
        && measures_agree(&backend, &plant, ball)
        && measures_agree(&backend, &simple, square)
        && pairs_agree(&backend, &plant, region, PairControl::Replay)
}

/// The same for rollouts that run the race's network themselves, by tiles, pairs in feedback.
fn fused_parity(gpu: Gpu) -> bool {
    let tiles = Form::Tiles { trajectories: 32, neurons: 8, columns: 8 };
    let backend = Backend::Gpu(gpu.with_networks(NetworkKernels::Form(tiles)));
    let race = DroneRace::default();
    let (low, high) = (race.states().map(|a| a.low), race.states().map(|a| a.high));
    let region = Region::new_box(low, high).expect("box");
    let plant = Plant::of(race, race_policy());
    measures_agree(&backend, &plant, region.clone())
        && pairs_agree(&backend, &plant, region, PairControl::ClosedLoop)
}

fn measures_agree(backend: &Backend, plant: &Plant, region: Region) -> bool {
    let Ok(program) = backend.prepare(plant) else { return false };
    let spec = RolloutSpec::new(HORIZON, 0.9).expect("spec");
    let tightening = losses(&spec);
    let starts = Starts::Drawn { region, stream: Stream::new(3, Purpose::USER, 5) };
    [Query::Measure, Query::Sign].into_iter().all(|query| {
        let task = ReachAvoidTask {
            starts: starts.clone(),
            range: 0..BATCH,
            spec,
            tightening: &tightening,
            query,
        };
        let mut agree = true;
        let ran = program.reach_avoid(&task, &mut |first, values| {
            for (index, value) in (first..).zip(values) {
                let truth = replay::measure(plant, &starts.start(index), &spec, &tightening);
                agree &= match query {
                    Query::Measure => (f64::from(*value) - truth).abs() <= BAND,
                    Query::Sign => truth.abs() <= BAND || (*value > 0.0) == (truth > 0.0),
                };
            }
            Ok(())
        });
        ran.is_ok() && agree
    })
}

fn pairs_agree(backend: &Backend, plant: &Plant, region: Region, control: PairControl) -> bool {
    let Ok(program) = backend.prepare(plant) else { return false };
    let spec = RolloutSpec::new(HORIZON, 0.9).expect("spec");
    let tightening = losses(&spec);
    let pairs = Pairs {
        nominal: Starts::Drawn { region, stream: Stream::new(3, Purpose::USER, 6) },
        radius: 0.1,
        stream: Stream::new(3, Purpose::USER, 7),
    };
    let task = DeviationTask {
        pairs: pairs.clone(),
        range: 0..BATCH,
        spec,
        tightening: &tightening,
        control,
    };
    let mut agree = true;
    let ran = program.deviation(&task, &mut |first, values| {
        for (index, value) in (first..).zip(values) {
            let [nominal, perturbed] = pairs.pair(index);
            let pair = [&nominal[..], &perturbed];
            let (nominal, perturbed) =
                replay::pair_measures(plant, pair, &spec, &tightening, control);
            agree &= (f64::from(value.nominal) - nominal).abs() <= BAND
                && (f64::from(value.perturbed) - perturbed).abs() <= BAND;
        }
        Ok(())
    });
    // The host's own kernel is the reference of the distances: it is tested against f64 apart.
    let cpu = common::cpu(1);
    let host = cpu.prepare(plant).expect("it fits").deviation(&task, &mut |_, _| Ok(()));
    let host = host.expect("host runs");
    agree
        && ran.is_ok_and(|farthest| {
            farthest.iter().zip(&host).all(|(device, host)| {
                f64::from((device.distance - host.distance).abs()) <= BAND
                    && device.pair == host.pair
            })
        })
}

/// Whether the adapter agrees with f64 on a plant whose formulas read parameters and time, driven by
/// a network with an observation and an action, its starts listed, in feedback.
fn drift_parity(gpu: Gpu) -> bool {
    let driver = models::Driver::Wrapped;
    let truth = models::Truth::new(driver, models::VALUES);
    let spec = RolloutSpec::new(HORIZON, 0.9).expect("spec");
    let region = Region::new_box([-1.5, -1.5, -2.0], [1.5, 1.5, 2.0]).expect("box");
    let drawn = Starts::Drawn { region, stream: Stream::new(3, Purpose::USER, 8) };
    let list: Vec<f32> = (0..BATCH).flat_map(|index| drawn.start(index)).collect();
    let task = DeviationTask {
        pairs: Pairs {
            nominal: Starts::Listed(States::new(&list, 3).expect("states of 3")),
            radius: 0.2,
            stream: Stream::new(3, Purpose::USER, 9),
        },
        range: 0..BATCH,
        spec,
        tightening: &losses(&spec),
        control: PairControl::ClosedLoop,
    };
    let backend = Backend::Gpu(gpu);
    let plant = driver.plant(models::VALUES);
    let Ok(program) = backend.prepare(&plant) else { return false };
    let mut agree = true;
    let ran = program.deviation(&task, &mut |first, values| {
        for (index, value) in (first..).zip(values) {
            let [nominal, perturbed] = task.pairs.pair(index);
            let starts = [&nominal[..], &perturbed];
            let [nominal, perturbed] = truth.pair(starts, &spec, task.tightening, task.control);
            agree &= (f64::from(value.nominal) - nominal).abs() <= BAND
                && (f64::from(value.perturbed) - perturbed).abs() <= BAND;
        }
        Ok(())
    });
    ran.is_ok() && agree
}

/// The same, the network run by the rollouts.
fn fused_drift_parity(gpu: Gpu) -> bool {
    drift_parity(gpu.with_networks(NetworkKernels::Fused))
}

/// A system whose margins become infinite, or no number, where the second state says so.
struct Walls;

impl System<2, 1> for Walls {
    fn name(&self) -> &str {
        "walls"
    }
    fn states(&self) -> [Axis; 2] {
        ["n", "kind"].map(|name| Axis::new(name, "", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [n, kind]: [R; 2], _: [R; 1]) -> [R; 2] {
        [n + R::lit(1.0), kind]
    }
    fn target<R: Real>(&self, [n, kind]: [R; 2]) -> R {
        // Kind 1: infinite from the fourth state on, kind 4: no number then.
        let late = kind.if_lt(R::lit(4.0), infinite(n), infinite(n) - infinite(n));
        let late = R::lit(3.0).if_lt(n, late, n - R::lit(10.0));
        let concerned = (kind - R::lit(2.5)).abs();
        R::lit(1.0).if_lt(concerned, late, n - R::lit(10.0))
    }
    fn constraint<R: Real>(&self, [n, kind]: [R; 2]) -> R {
        // Kind 2: minus infinity from the fourth state on, kind 3: no number then.
        let late = kind.if_lt(R::lit(3.0), -infinite(n), infinite(n) - infinite(n));
        let late = R::lit(3.0).if_lt(n, late, R::lit(2.0));
        let concerned = (kind - R::lit(2.5)).abs();
        concerned.if_lt(R::lit(1.0), late, R::lit(2.0))
    }
}

/// Infinite, in a way that no compiler sees.
fn infinite<R: Real>(n: R) -> R {
    let large = R::lit(1.0e30) + R::lit(0.0) * n;
    large * large
}

/// Whether the adapter says of infinite margins what they mean.
fn walls_parity(gpu: Gpu) -> bool {
    let backend = Backend::Gpu(gpu);
    let Ok(program) = backend.prepare(&Plant::of(Walls, Still)) else { return false };
    let starts = [[0.0, 1.0], [0.0, 2.0], [0.0, 3.0], [0.0, 4.0]];
    let spec = RolloutSpec::new(6, 1.0).expect("spec");
    let task = ReachAvoidTask {
        starts: Starts::listed(&starts),
        range: 0..4,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let mut all = Vec::new();
    let ran = program.reach_avoid(&task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    });
    ran.is_ok() && all == [2.0, -7.0, NON_FINITE, NON_FINITE]
}

/// The control is 0.
struct Still;

impl Policy<2, 1> for Still {
    fn name(&self) -> String {
        "still".to_owned()
    }
    fn control<R: Real>(&self, _: [R; 2]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// A problem of the double integrator that differs from the others and from step to step.
fn mppi_problem(number: u32) -> MppiProblem {
    let shift = 0.1 * number as f32;
    let step = |t: u32| 0.7 * (t as f32 + shift).sin();
    let plan: Vec<_> = (0..MPPI_HORIZON).map(|t| [step(t)]).collect();
    let context = (0..MPPI_HORIZON).map(|t| [0.1 * step(t), shift, t as f32 / 9.0]);
    let stream = Stream::new(3, Purpose::CONTROL_NOISE, number);
    MppiProblem::new([0.8 - shift, shift - 0.3], &plan, &context.collect::<Vec<_>>(), stream)
}

/// Steps of a plan: not a whole number of tiles of the update.
const MPPI_HORIZON: u32 = 37;

/// A layer with weights of both signs.
fn mppi_network() -> Mlp {
    let layer = Layer::dense(vec![0.7, -0.9], vec![0.2]);
    Mlp::new(vec![layer], Activation::Tanh, Activation::Tanh).expect("a network")
}

/// Whether the adapter agrees with f64 on plans of the double integrator under each kind of noise,
/// with and without networks, clipped and antithetic.
fn mppi_parity(gpu: Gpu) -> bool {
    let backend = Backend::Gpu(gpu);
    let network = Arc::new(mppi_network());
    let value = ValueTerm { network: Arc::clone(&network), weight: 3.0, threshold: 0.4 };
    let disturbance = Disturbance { network, entries: vec![(1, 0.1)] };
    let kinds =
        [NoiseKind::Independent, NoiseKind::Colored { time: 3.0 }, NoiseKind::Spline { knots: 9 }];
    let problems: Vec<_> = (0..2).map(mppi_problem).collect();
    kinds.into_iter().enumerate().all(|(number, noise)| {
        let networked = number > 0;
        let planning = Planning {
            value: networked.then(|| value.clone()),
            disturbance: networked.then(|| disturbance.clone()),
            ..Planning::of::<_, _, 2, 1, 3>(
                &DoubleIntegrator::default(),
                mppi_cost(),
                mppi_spec(noise, number == 0),
            )
        };
        plans_agree(&backend, &planning, &problems)
    })
}

/// Three workgroups of samples and some; the noise reaches far beyond the bounds.
fn mppi_spec(noise: NoiseKind, antithetic: bool) -> MppiSpec {
    let settings = MppiSettings {
        noise,
        antithetic,
        sigma: Sigma::PerControl(vec![1.0]),
        temperature: 20.0,
        ..MppiSettings::new(&DoubleIntegrator::default().controls(), 150, MPPI_HORIZON)
    };
    MppiSpec::new(settings).expect("settings")
}

fn mppi_cost() -> Quadratic<2, 1> {
    Quadratic { state: [2.0, 0.5], control: [0.3], last: [9.0, 4.0], obstacle: None }
}

fn plans_agree(backend: &Backend, planning: &Planning, problems: &[MppiProblem]) -> bool {
    let task = MppiTask { problems, iteration: 5, costs: CostQuery::Each };
    let run = |backend: &Backend| backend.prepare_plans(planning)?.improve(&task);
    let host = run(&common::cpu(1)).expect("the host runs");
    let Ok(results) = run(backend) else { return false };
    let plant = (&DoubleIntegrator::default(), &mppi_cost());
    results.iter().zip(&host).zip(problems).all(|((result, host), problem)| {
        let truth = oracle::truth::<_, _, 2, 1, 3>(plant, planning, (problem, 5));
        oracle::differences(&truth, result, host, planning.spec.settings()).is_ok()
    })
}

/// Whether the adapter agrees with f64 on plans across a cost map.
fn map_parity(gpu: Gpu) -> bool {
    drive::disagreement(&Backend::Gpu(gpu), &common::cpu(1)).is_ok()
}

/// Whether the adapter agrees with f64 on costs with an end, references and maps inside formulas.
fn costs_parity(gpu: Gpu) -> bool {
    costs::disagreement(&Backend::Gpu(gpu), 9).is_ok()
}

/// What marks the outputs of a formula, and the same without it.
const MARK: [&str; 2] =
    ["select(bitcast<u32>(x), 0x7fc00000u, lost)", "select(bitcast<u32>(x), 0x7fc00000u, false)"];

/// [`caught`] where no output is marked: a NaN is kept by its bits and by the mark, and either is to be
/// missed where the other is gone.
fn caught_unmarked(parity: fn(Gpu) -> bool, old: &'static str, new: &'static str) {
    let Some(gpu) = adapter() else { return };
    let unmarked = move |text: &str| text.replace(MARK[0], MARK[1]);
    assert!(parity(gpu.with_shader_edit(unmarked)), "the bits alone keep it");
    let Some(gpu) = adapter() else { return };
    let edited = move |text: &str| text.replace(MARK[0], MARK[1]).replace(old, new);
    assert!(
        !parity(gpu.with_shader_edit(edited)),
        "`{old}` changed to `{new}` and nothing noticed"
    );
    assert!(include_str!("../shaders/choices.wgsl").contains(old), "no kernel has `{old}`");
}

/// Whether what a driver makes 0 of is NaN all the same: the root of a negative number, times what
/// comes to 0.
fn mark_parity(gpu: Gpu) -> bool {
    let backend = Backend::Gpu(gpu);
    let Ok(program) = backend.prepare(&Plant::of(Rooted, Still)) else { return false };
    let spec = RolloutSpec::new(1, 1.0).expect("spec");
    let starts = [[-0.5, 0.3], [0.5, 0.3]];
    program.measures(&starts, &spec).is_ok_and(|found| found == [NON_FINITE, 2.0])
}

/// Its target margin is 2, and the root of its first state times what comes to 0.
#[derive(Clone)]
struct Rooted;

impl System<2, 1> for Rooted {
    fn name(&self) -> &str {
        "rooted"
    }
    fn states(&self) -> [Axis; 2] {
        ["x", "y"].map(|name| Axis::new(name, "", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, x: [R; 2], _: [R; 1]) -> [R; 2] {
        x
    }
    fn target<R: Real>(&self, [x, y]: [R; 2]) -> R {
        #[expect(clippy::eq_op, reason = "a zero that only a driver knows")]
        let zero = y - y;
        R::lit(2.0) + zero * x.sqrt()
    }
    fn constraint<R: Real>(&self, _: [R; 2]) -> R {
        R::lit(3.0)
    }
}

/// Requires that `parity` fails once `old` is replaced by `new`, and that the text had `old`.
fn caught(parity: fn(Gpu) -> bool, old: &'static str, new: &'static str) {
    let Some(gpu) = adapter() else { return };
    let seen = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let found = seen.clone();
    let gpu = gpu.with_shader_edit(move |text| {
        found.fetch_or(text.contains(old), std::sync::atomic::Ordering::Relaxed);
        text.replace(old, new)
    });
    assert!(!parity(gpu), "`{old}` changed to `{new}` and nothing noticed");
    assert!(seen.load(std::sync::atomic::Ordering::Relaxed), "no kernel has `{old}`");
}

#[test]
fn kernels_as_they_are_agree() {
    if let Some(gpu) = adapter() {
        assert!(parity(gpu));
    }
    if let Some(gpu) = adapter() {
        assert!(fused_parity(gpu));
    }
    for parity in [drift_parity, fused_drift_parity, walls_parity, mark_parity] {
        if let Some(gpu) = adapter() {
            assert!(parity(gpu));
        }
    }
    if let Some(gpu) = adapter() {
        assert!(mppi_parity(gpu));
    }
    if let Some(gpu) = adapter() {
        assert!(map_parity(gpu));
    }
    if let Some(gpu) = adapter() {
        assert!(costs_parity(gpu));
    }
}

macro_rules! mutants {
    ($parity:ident: $($name:ident: $old:expr => $new:expr;)*) => {
        $(
            #[test]
            fn $name() {
                caught($parity, $old, $new);
            }
        )*
    };
}

mutants! {
    parity:
    one_step_too_few: "if t < params.horizon {" => "if t + 1u < params.horizon {";
    one_state_too_many: "t < params.step + params.steps;" => "t <= params.step + params.steps;";
    last_state_not_judged: "t < params.step + params.steps;" => "t + 1u < params.step + params.steps;";
    constraint_not_discounted: "discount * constraint_margin" => "constraint_margin";
    target_not_discounted: "discount * target_margin" => "target_margin";
    target_without_constraint: "min(safe, discount * target_margin)" => "discount * target_margin";
    constraint_forgotten: "min(fold.safe, discount * constraint_margin)" => "discount * constraint_margin";
    losses_swapped: "target_at(x, t), row.y" => "target_at(x, t), row.z";
    loss_added: "select(margin - number," => "select(margin + number,";
    early_exit_on_safety: "fold.best > 0.0 || fold.safe <= 0.0" => "fold.best > 0.0 || fold.safe > 0.0";
    survivors_mixed_up: "kept_origin[place] = origin[column];" => "kept_origin[place] = origin[place];";
    largest_is_smallest: "b.x > a.x ||" => "b.x < a.x ||";
    perturbed_is_nominal: "perturbed = advance(perturbed, replayed, t);" => "perturbed = advance(nominal, replayed, t);";
    states_swapped: "let v1 = x[1];" => "let v1 = x[0];";
    branches_turned: "a < b)" => "a > b)";
}

mutants! {
    mark_parity:
    outputs_not_marked: "select(bitcast<u32>(x), 0x7fc00000u, lost)" => "bitcast<u32>(x)";
    births_not_noted: "< 0.0);" => "< -9.0);";
}

mutants! {
    fused_parity:
    one_fused_step_too_few: "if t < params.horizon {" => "if t + 1u < params.horizon {";
    one_layer_too_few: "i < 3u;" => "i + 1u < 3u;";
    last_layer_like_the_others: "vec4<f32>(output_activation(s0.x)" => "vec4<f32>(hidden_activation(s0.x)";
    inputs_replaced_too_early: "    // All inputs are read before the first is replaced.\n    workgroupBarrier();\n" => "";
    states_of_a_neighbour: "put_inputs(lane, observed(x, t));" => "put_inputs((lane + 1u) % COLUMNS, observed(x, t));";
    neurons_of_another_tile: "let down = lane / PITCH;" => "let down = lane % PITCH;";
    one_tile_in_four_left_out: "let across = lane % PITCH;" => "let across = lane % (PITCH - 1u);";
    controls_of_a_neighbour: "outputs_at(lane % COLUMNS)" => "outputs_at((lane + 1u) % COLUMNS)";
    biases_forgotten: "let bias_0 = weights[layer.offset + 0u * span + min(down, span - 1u)];" => "let bias_0 = vec4<f32>(0.0);";
    perturbed_controls_are_nominal: "drive(lane, second, perturbed, t)" => "replayed";
}

mutants! {
    drift_parity:
    time_of_the_next_step: "return f32(t) * " => "return f32(t + 1u) * ";
    step_of_the_next_state: ", f32(t));" => ", f32(t + 1u));";
    parameters_swapped: "(values[0].x, values[0].y" => "(values[0].y, values[0].x";
    fifth_parameter_is_the_first: "values[1].x" => "values[0].x";
    network_sees_the_first_time: "observed(load_state(column), params.step)" => "observed(load_state(column), 0u)";
    action_of_the_first_step: "return acted(x, array<f32, SAID>(v0.x, v0.y, v0.z), t);" => "return acted(x, array<f32, SAID>(v0.x, v0.y, v0.z), 0u);";
    output_of_another_neuron: "array<f32, SAID>(v0.x, v0.y, v0.z)" => "array<f32, SAID>(v0.x, v0.z, v0.y)";
    list_of_a_neighbour: "u * params.columns + column]" => "u * params.columns + (column ^ 1u)]";
}

mutants! {
    fused_drift_parity:
    fused_network_sees_the_first_time: "observed(x, t)" => "observed(x, 0u)";
    fused_action_of_the_first_step: "acted(x, outputs_at(lane % COLUMNS), t)" => "acted(x, outputs_at(lane % COLUMNS), 0u)";
}

mutants! {
    walls_parity:
    infinite_margins_fail: "(bits & MAGNITUDE) == EXPONENT" => "false";
    minus_infinity_fails: "(bits & MAGNITUDE) == EXPONENT" => "bits == EXPONENT";
    largest_number_of_the_other_sign: "bits - 1u)" => "(bits - 1u) ^ 0x80000000u)";
    a_target_that_is_no_number_counts: "finite(target_margin)" => "true";
    a_constraint_that_is_no_number_counts: "finite(constraint_margin)" => "true";
}

mutants! {
    mppi_parity:
    controls_not_clipped: "recorded_control(nominal[0], z[0])" => "nominal[0] + z[0]";
    antithetic_sign_lost: "select(1.0, -1.0, sample % 2u == 1u)" => "1.0";
    antithetic_index_kept: "source.index = sample / 2u;" => "source.index = sample;";
    plan_of_the_next_step: "plan_at(stage)" => "plan_at(stage + 1u)";
    context_of_the_first_step: "context_at(stage)" => "context_at(problem * params.horizon)";
    last_stage_not_charged: "t < params.step + params.steps;" => "t + 1u < params.step + params.steps;";
    weights_without_the_minimum: "(least - cost)" => "(0.0 - cost)";
    weighed_with_the_noise_of_another: "params.first_low + place + ahead);" => "params.first_low + place + ahead + 2u);";
    rolled_with_the_noise_of_another: "open_source(problem, params.first_low + place);" => "open_source(problem, params.first_low + place + 2u);";
    stream_of_the_first_problem: "streams[problem]" => "streams[0]";
    iteration_ignored: "params.iteration, block" => "0u, block";
    least_is_largest: "b.cost < a.cost ||" => "b.cost > a.cost ||";
    squares_are_weights: "weight * weight, 0.0, 0.0" => "weight, 0.0, 0.0";
    last_tile_not_summed: "first < end; first += TILE_STEPS" => "first + TILE_STEPS <= end; first += TILE_STEPS";
    padding_weighed: "place + ahead < params.samples && counts(cost)" => "counts(cost)";
    value_forgotten: "total = charge_value(column, total);" => "";
    disturbance_forgotten: "x = disturb(column, x);" => "";
    noise_not_correlated: "correlated = recurrence(correlated, fresh);" => "correlated = fresh;";
    correlation_lost_between_dispatches: "if params.step > 0u {" => "if params.step > params.horizon {";
    a_knot_too_far: "next_knot < row.first + SUPPORT" => "next_knot <= row.first + SUPPORT";
}

// The map has 13 columns and 9 rows: with its border, 15 and 11.
mutants! {
    map_parity:
    map_forgotten: " + map_cost(x, t)" => "";
    rows_and_columns_swapped: "cells[min(u32(cell_at(x, t))" => "cells[min(u32(cell_at(array<f32, NX>(x[1], x[0], x[2]), t))";
    rows_of_the_map_without_border: "= 15.0f;" => "= 13.0f;";
    one_cell_off: "min(u32(cell_at(x, t)), CELLS - 1u)" => "min(u32(cell_at(x, t)) + 1u, CELLS - 1u)";
    columns_not_clamped: "= 14.0f;" => "= 1000.0f;";
    beyond_the_last_row_as_in_it: "= 10.0f;" => "= 9.0f;";
    map_of_the_next_state: "total = charge(total, x, u, stage, nominal, first_step + t);" => "total = charge(total, advance(x, u, first_step + t), u, stage, nominal, first_step + t);";
    contexts_of_the_stage_before: "context_at(stage)" => "context_at(max(stage, 1u) - 1u)";
}

mutants! {
    costs_parity:
    end_charged_twice: "totals[column] += terminal_of(" => "totals[column] += 2.0 * terminal_of(";
    end_not_charged: "totals[column] += terminal_of(" => "totals[column] += 0.0 * terminal_of(";
    end_of_the_first_step: "streams[problem].w + params.horizon" => "streams[problem].w";
    end_a_step_late: "streams[problem].w + params.horizon" => "streams[problem].w + params.horizon + 1u";
    end_told_the_last_stage: "stages + problem, t" => "(problem + 1u) * params.horizon - 1u, t";
    end_told_of_another_problem: "stages + problem, t" => "stages, t";
    end_of_a_neighbour: "load_state(column), stages" => "load_state(column ^ 1u), stages";
    stage_told_the_next_one: "context_at(stage)" => "context_at(stage + 1u)";
    asked_the_first_map: "cells[first + " => "cells[";
    asked_the_next_cell: "min(u32(cell), count - 1u)" => "min(u32(cell) + 1u, count - 1u)";
}

/// A mutant of what is printed of one function.
macro_rules! function_mutants {
    ($($name:ident: $case:expr, $old:expr => $new:expr;)*) => {
        $(
            #[test]
            fn $name() {
                if let Some(gpu) = adapter() {
                    disagreement(&Backend::Gpu(gpu), $case).unwrap_or_else(|error| panic!("{error}"));
                }
                caught(|gpu| disagreement(&Backend::Gpu(gpu), $case).is_ok(), $old, $new);
            }
        )*
    };
}

function_mutants! {
    sine_reduced_by_too_little: Case::Of(Function::Sin), "= 6.28125f;" => "= 6.28f;";
    tangent_reduced_by_too_little: Case::Of(Function::Tan), "= 1.5703125f;" => "= 1.57f;";
    arc_sine_of_another_series: Case::Of(Function::Asin), "= 0.16666752f;" => "= 0.17f;";
    arc_cosine_not_turned: Case::Of(Function::Acos), "= 3.1415927f;" => "= 3.0f;";
    arc_tangent_not_moved: Case::Of(Function::Atan), "= 0.7853982f;" => "= 0.7853f;";
    angle_not_turned: Case::Angle, "= 3.1415927f;" => "= 3.0f;";
    angle_of_a_steep_point: Case::AngleBehind, "= 1.5707964f;" => "= 1.57f;";
    wrapped_by_too_little: Case::Of(Function::Wrap), "= 6.28125f;" => "= 6.28f;";
    exponential_held_too_low: Case::Of(Function::Exp), "= 89.0f;" => "= 6.0f;";
    logarithm_of_another_base: Case::Of(Function::Ln), "= 0.69314575f;" => "= 0.6931f;";
    logarithm_below_zero: Case::Of(Function::Ln), "bitcast<f32>(b" => "0.0 * f32(b";
    sigmoid_of_another_base: Case::Of(Function::Sigmoid), "= 0.69314575f;" => "= 0.6931f;";
    tangent_held_too_low: Case::Of(Function::Tanh), "= 8.2f;" => "= 2.0f;";
    power_of_another_exponent: Case::Power(1.5), "= 1.5f;" => "= 1.4f;";
    product_forgotten: Case::Whole(3), "* v" => "+ v";
    sign_turned: Case::Sign, "1.0, 0.0 < x" => "1.0, 0.0 > x";
    smaller_is_larger: Case::Smaller, "select(b, a, a < b)" => "select(a, b, a < b)";
    larger_is_smaller: Case::Larger, "select(b, a, b < a)" => "select(a, b, b < a)";
    not_held_below: Case::Held, "select(x, low, x < low)" => "x";
    not_held_above: Case::Held, "select(floored, high, high < floored)" => "floored";
}

/// The same of what keeps a NaN by its bits.
macro_rules! nan_mutants {
    ($($name:ident: $case:expr, $old:expr => $new:expr;)*) => {
        $(
            #[test]
            fn $name() {
                caught_unmarked(|gpu| disagreement(&Backend::Gpu(gpu), $case).is_ok(), $old, $new);
            }
        )*
    };
}

nan_mutants! {
    nan_lost_in_a_minimum: Case::Smaller, "largest > INFINITE" => "largest > ~0u";
    nan_lost_in_a_maximum: Case::Larger, "largest > INFINITE" => "largest > ~0u";
    nan_lost_in_a_bound: Case::HeldBelow, "largest > INFINITE" => "largest > ~0u";
    nan_lost_in_a_condition: Case::Less, "largest > INFINITE" => "largest > ~0u";
    nan_lost_in_a_comparison: Case::Equal, "largest > INFINITE" => "largest > ~0u";
    nan_of_the_first_lost: Case::Smaller, "max(size_of(a), size_of(b))" => "size_of(b)";
    nan_of_the_second_lost: Case::LessBehind, "max(size_of(a), size_of(b))" => "size_of(a)";
    nan_of_the_bounds_lost: Case::HeldBelow, "max(size_of(x), bounds)" => "size_of(x)";
}
