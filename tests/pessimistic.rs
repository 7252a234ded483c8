//! Kernels hold what they promise on an adapter that does the worst that a driver may, and each guard is
//! needed: without it the same check fails.
//!
//! The whole suite runs on such an adapter where `REACHCAST_PESSIMIST` asks for it: see `.ci/pessimist`.

mod common;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::activations::activations;
use common::adapter;
use common::pessimist::{Edit, edited, pessimistic};
use reachcast::backend::Backend;
use reachcast::backend::gpu::{Gpu, NetworkKernels};
use reachcast::cost::Cost;
use reachcast::model::Plant;
use reachcast::policy::{Activation, Layer, Mlp, Policy};
use reachcast::real::Real;
use reachcast::rollout::{
    Ball, CostQuery, Disturbance, MppiProblem, MppiSettings, MppiSpec, MppiTask, NON_FINITE,
    Planning, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, Stream, Tightening,
    ValueTerm,
};
use reachcast::system::{Axis, System};

/// A system whose measure is one coordinate of the start, from which it goes far below.
struct Reveal(usize);

impl System<6, 1> for Reveal {
    fn name(&self) -> &str {
        "reveal"
    }
    fn states(&self) -> [Axis; 6] {
        std::array::from_fn(|_| Axis::new("x", "m", -1.0, 1.0))
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, _: [R; 6], [u]: [R; 1]) -> [R; 6] {
        [R::lit(-1.0e6) + R::lit(0.0) * u; 6]
    }
    fn target<R: Real>(&self, x: [R; 6]) -> R {
        x[self.0]
    }
    fn constraint<R: Real>(&self, _: [R; 6]) -> R {
        R::lit(1.0e6)
    }
}

/// A state that the control moves and that never arrives; the margin is no number below 0.
#[derive(Clone)]
struct Line;

impl System<1, 1> for Line {
    fn name(&self) -> &str {
        "line"
    }
    fn states(&self) -> [Axis; 1] {
        [Axis::new("x", "m", -9.0, 9.0)]
    }
    fn controls(&self) -> [Axis; 1] {
        [Axis::new("u", "m", -1.0, 1.0)]
    }
    fn step<R: Real>(&self, [x]: [R; 1], [u]: [R; 1]) -> [R; 1] {
        [x + u]
    }
    fn target<R: Real>(&self, [x]: [R; 1]) -> R {
        x.sqrt() - R::lit(100.0)
    }
    fn constraint<R: Real>(&self, _: [R; 1]) -> R {
        R::lit(1.0)
    }
}

/// The squares of state and control.
impl Cost<1, 1, 1> for Line {
    fn stage<R: Real>(&self, [x]: [R; 1], [u]: [R; 1], _: [R; 1]) -> R {
        x * x + u * u
    }
}

/// The control is 0.
struct Still;

impl<const NX: usize> Policy<NX, 1> for Still {
    fn name(&self) -> String {
        "still".to_owned()
    }
    fn control<R: Real>(&self, _: [R; NX]) -> [R; 1] {
        [R::lit(0.0)]
    }
}

/// The measures of a batch over one step.
fn measures(gpu: Gpu, plant: &Plant, starts: &Starts<'_>, count: u64) -> Vec<f32> {
    let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
    let task = ReachAvoidTask {
        starts: starts.clone(),
        range: 0..count,
        spec,
        tightening: &Tightening::none(&spec),
        query: Query::Measure,
    };
    let (backend, mut all) = (Backend::Gpu(gpu), Vec::new());
    let program = backend.prepare(plant).expect("it fits");
    let ran = program.reach_avoid(&task, &mut |_, values| {
        all.extend_from_slice(values);
        Ok(())
    });
    ran.expect("the edited kernel runs");
    all
}

/// Whether starts in a ball have the bits that the host draws.
fn starts_are_the_host_s(gpu: Gpu) -> bool {
    let ball =
        Ball { center: vec![0.3, -0.2, 1.0, 0.0, 5.0, -0.7], radius: 0.55, varies: vec![true; 6] };
    let stream = Stream::new(7, Purpose::USER, 3);
    let starts = Starts::Drawn { region: Region::Ball(ball), stream };
    let found = measures(gpu, &Plant::of(Reveal(0), Still), &starts, 4000);
    (0..).zip(found).all(|(index, found)| found.to_bits() == starts.start(index)[0].to_bits())
}

/// Whether a margin that is no number fails its rollout.
fn margins_without_a_number_fail(gpu: Gpu) -> bool {
    let starts = Starts::listed(&[[-4.0], [4.0]]);
    measures(gpu, &Plant::of(Line, Still), &starts, 2) == [NON_FINITE, -98.0]
}

/// A network whose second layer takes infinity from infinity for states of 4 and more.
fn overflowing(activation: Activation, output: Activation) -> Mlp {
    let layer = |weight: Vec<f32>, inputs: usize| {
        let outputs = weight.len() / inputs;
        Layer::dense(weight, vec![0.0; outputs])
    };
    let [first, second, last] =
        [layer(vec![1e38, 1e38], 1), layer(vec![1.0, -1.0], 2), layer(vec![1.0], 1)];
    // What is bounded would make numbers of the infinities.
    let layers = vec![first, second.activated(activation), last.activated(output)];
    Mlp::from_layers(layers).expect("a whole network")
}

/// Whether a network without a number fails the rollout that it drives, whatever its activations.
fn networks_without_a_number_fail(gpu: Gpu) -> bool {
    let starts = Starts::listed(&[[4.0], [0.0]]);
    let mut gpu = Some(gpu);
    let mut all = Vec::new();
    for activation in activations() {
        for output in [Activation::Tanh, Activation::Identity] {
            let plant = Plant::of(Line, overflowing(activation, output));
            let backend = Backend::Gpu(gpu.take().expect("it was given back"));
            let spec = RolloutSpec::new(1, 1.0).expect("a horizon");
            let program = backend.prepare(&plant).expect("it fits");
            let starts: Vec<[f32; 1]> = (0..2).map(|i| [starts.start(i)[0]]).collect();
            all.push(program.measures(&starts, &spec).expect("it runs"));
            drop(program);
            let Backend::Gpu(back) = backend else { unreachable!("it was made a GPU above") };
            gpu = Some(back);
        }
    }
    all.iter().all(|found| found[0] == NON_FINITE && found[1] < -90.0)
}

/// The same where the rollouts run the network themselves.
fn fused_networks_without_a_number_fail(gpu: Gpu) -> bool {
    networks_without_a_number_fail(gpu.with_networks(NetworkKernels::Fused))
}

/// Whether samples whose value or whose disturbance is no number weigh nothing.
fn plans_without_a_number_weigh_nothing(gpu: Gpu) -> bool {
    let network = Arc::new(overflowing(Activation::Relu, Activation::Identity));
    let value = ValueTerm { network: Arc::clone(&network), weight: 1.0, threshold: 0.5 };
    let disturbance = Disturbance { network, entries: vec![(0, 0.5)] };
    let settings = MppiSettings::new(&Line.controls(), 70, 3);
    let planning = Planning::of(&Line, Line, MppiSpec::new(settings).expect("settings"));
    let valued = Planning { value: Some(value), ..planning.clone() };
    let disturbed = Planning { disturbance: Some(disturbance), ..planning };
    let stream = Stream::new(7, Purpose::CONTROL_NOISE, 0);
    // The controls move it by 3 at most.
    let problems = [MppiProblem::new([9.0], &[[0.0]; 3], &[[0.0]; 3], stream)];
    let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Summary };
    let backend = Backend::Gpu(gpu);
    [valued, disturbed].iter().all(|planning| {
        let program = backend.prepare_plans(planning).expect("it fits");
        let found = program.improve(&task).expect("the edited kernels run");
        found[0].non_finite == 70
    })
}

/// A text without calls of the recorded function `name` of two numbers: the operator stands there.
fn inlined(text: &str, name: &str, operator: &str) -> String {
    let call = format!(" = {name}(v");
    let line = |line: &str| match line.split_once(&call) {
        Some((value, operands)) => {
            let operands = operands.trim_end_matches(");").replace(", ", &format!(" {operator} "));
            format!("{value} = v{operands};")
        }
        None => line.to_owned(),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// A text whose recorded sums are written out, rounded as before: a driver sees through the call.
fn sums_in_place(text: &str) -> String {
    let line = |line: &str| match line.split_once(" = sum(v") {
        Some((value, operands)) => {
            let operands = operands.trim_end_matches(");").replace(", ", " + ");
            format!("{value} = bitcast<f32>(bitcast<u32>(v{operands}) ^ params.zero);")
        }
        None => line.to_owned(),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Holds that `check` passes on the pessimistic adapter, and not without the guard that `remove` takes
/// out.
fn assert_needed(check: fn(Gpu) -> bool, remove: fn(&str) -> String) {
    let Some(whole) = adapter() else { return };
    assert!(check(pessimistic(whole, &Edit::ALL)), "the check fails with its guard");
    let removed = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&removed);
    let Some(bare) = adapter() else { return };
    let bare = bare.with_shader_edit(move |text| {
        let without = remove(text);
        counter.fetch_add(usize::from(without.trim_end() != text.trim_end()), Ordering::Relaxed);
        edited(&without, &Edit::ALL)
    });
    assert!(!check(bare), "the check does not notice that its guard is gone");
    assert!(removed.load(Ordering::Relaxed) > 0, "there was no such guard");
}

macro_rules! needed {
    ($($name:ident: $check:expr, $remove:expr;)*) => {
        $(
            #[test]
            fn $name() {
                assert_needed($check, $remove);
            }
        )*
    };
}

needed! {
    products_are_kept_apart: starts_are_the_host_s,
        |text| inlined(&sums_in_place(text), "product", "*");
    sums_are_kept_in_order: starts_are_the_host_s, |text| inlined(text, "sum", "+");
    quotients_are_mended: starts_are_the_host_s,
        |text| text.replace("if !(ordinary(a) && ordinary(b)) {", "if true {");
    roots_are_mended: starts_are_the_host_s,
        |text| text.replace("if !ordinary(x) {", "if true {");
    margins_are_judged_by_their_bits: margins_without_a_number_fail,
        |text| text.replace(FINITE, "return abs(value) < 3.4e38;");
    relu_hands_a_nan_on: networks_without_a_number_fail, |text| text.replace(HANDED_ON, "return x;");
    relu_hands_a_nan_on_to_plans: plans_without_a_number_weigh_nothing,
        |text| text.replace(HANDED_ON, "return x;");
    relu_hands_a_nan_on_fused: fused_networks_without_a_number_fail,
        |text| text.replace(HANDED_ON, "return x;");
}

/// How a number is told from what is none.
const FINITE: &str = "return (bitcast<u32>(value) & EXPONENT) != EXPONENT;";
/// How a choice hands a NaN on.
const HANDED_ON: &str = "return select(x, bitcast<f32>(largest), largest > INFINITE);";
