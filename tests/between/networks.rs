//! Points inside a period under networks, in layers and inside of rollouts, and for plans: against f64, whose
//! rollouts `between` holds to the mathematics.

use std::path::Path;
use std::sync::Arc;

use crate::common::{adapter, backends, cpu};
use crate::models;
use reachcast::backend::Backend;
use reachcast::backend::gpu::{Form, NetworkKernels};
use reachcast::formula::{Expr, Scalar as _, record};
use reachcast::model::{Controller, Law, Model, Plant, StageCost, text};
use reachcast::real::Real;
use reachcast::rollout::replay::{looks, measure, pair_measures};
use reachcast::rollout::{
    CostQuery, DeviationTask, Keep, MppiProblem, MppiSettings, MppiSpec, MppiTask, PairControl,
    Pairs, Planning, Purpose, Query, ReachAvoidTask, Region, RolloutSpec, Starts, Stream,
    Tightening,
};

const HORIZON: u32 = 9;
const STARTS: u64 = 300;

/// A pendulum in a wind that turns, looked at `points - 1` times inside each period.
fn model(lines: &str) -> Model {
    let text = format!(
        r#"
[model]
name = "pendulum"
[model.states]
angle = {{ unit = "rad", box = [-1.0, 1.0] }}
rate = {{ unit = "rad/s", box = [-1.0, 1.0] }}
[model.controls]
torque = {{ unit = "N m", bounds = [-1.0, 1.0] }}
[model.flow]
angle = "rate"
rate = "2 * sin(angle) + torque + 0.3 * cos(2 * t) + 0.02 * step"
[model.time]
period = 0.2
integrator = "rk4"
substeps = 4
[model.task]
kind = "reach-avoid"
{lines}
target = "0.3 - abs(angle) - 0.5 * abs(rate)"
constraint = "1.2 - abs(angle) - 0.1 * sin(5 * t)"
"#
    );
    text::read(&text, "pendulum.toml", Path::new("."))
        .and_then(|text| text.model())
        .expect("a model")
}

/// The pendulum under a network that sees its states, and the time if `clock` says so.
fn plant(clock: bool) -> Plant {
    let model = model("between = 3");
    let inputs = model.inputs();
    let seen = record(inputs, |x| vec![x[0], x[1], x[inputs - 2].sin()]);
    let law = match clock {
        true => Law::Network {
            observe: Some(seen),
            network: Arc::new(models::network(&[3, 20, 20, 1])),
            act: None,
        },
        false => Law::Network {
            observe: None,
            network: Arc::new(models::network(&[2, 20, 20, 1])),
            act: None,
        },
    };
    Plant::new(model, Controller::new("network", law))
}

fn spec() -> RolloutSpec {
    RolloutSpec::new(HORIZON, 0.95).expect("a specification")
}

fn pairs() -> Pairs<'static> {
    let region = Region::new_box([-1.0; 2], [1.0; 2]).expect("a box");
    let stream = |place| Stream::new(3, Purpose::USER, place);
    let nominal = Starts::Drawn { region, stream: stream(0) };
    Pairs { nominal, radius: 0.1, stream: stream(1) }
}

/// The CPU, and an adapter with the network in layers and in forms of its own.
fn ways() -> Vec<(String, Backend)> {
    let mut all = vec![("cpu".to_owned(), cpu(2))];
    let forms = [
        NetworkKernels::Layered,
        NetworkKernels::Form(Form::Rows { trajectories: 8 }),
        NetworkKernels::Form(Form::Tiles { trajectories: 16, neurons: 4, columns: 4 }),
    ];
    for form in forms {
        let gpu = adapter().map(|gpu| Backend::Gpu(gpu.with_networks(form)));
        all.extend(gpu.map(|gpu| (format!("{form:?}"), gpu)));
    }
    all
}

#[test]
fn networks_drive_points_as_in_f64() {
    let (spec, none) = (spec(), Tightening::none(&spec()));
    for clock in [false, true] {
        let plant = plant(clock);
        for (name, backend) in ways() {
            let program = backend.prepare(&plant).expect("prepared");
            let all = |query| {
                let (starts, tightening) = (pairs().nominal, &none);
                let task = ReachAvoidTask { starts, range: 0..STARTS, spec, tightening, query };
                let tally = program.tally(&task, Keep::Measures).expect("run");
                tally.finish(0..STARTS).expect("all").values
            };
            let (measures, signs) = (all(Query::Measure), all(Query::Sign));
            let mut successes = 0;
            for (i, (found, sign)) in (0..).zip(measures.into_iter().zip(signs)) {
                let wanted = measure(&plant, &pairs().nominal.start(i), &spec, &none);
                let near = (f64::from(found) - wanted).abs() < 1e-4;
                assert!(near, "{name}, start {i}: {found}, not {wanted}");
                assert_eq!(found > 0.0, sign > 0.0, "{name}, start {i}: {found} and {sign}");
                successes += u64::from(sign > 0.0);
            }
            assert!(successes > 5 && successes < STARTS - 5, "{name}: {successes}");
        }
    }
}

#[test]
fn pairs_under_networks_are_those_of_f64() {
    let (spec, none) = (spec(), Tightening::none(&spec()));
    let plant = plant(true);
    for (name, backend) in ways() {
        let program = backend.prepare(&plant).expect("prepared");
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            let (pairs, range, tightening) = (pairs(), 0..60, &none);
            let task = DeviationTask { pairs: pairs.clone(), range, spec, tightening, control };
            let mut found = Vec::new();
            let mut sink = |_, pairs: &[_]| {
                found.extend_from_slice(pairs);
                Ok(())
            };
            program.deviation(&task, &mut sink).expect("run");
            for (i, pair) in (0..).zip(found) {
                let both = pairs.pair(i);
                let both = [&*both[0], &*both[1]];
                let (nominal, perturbed) = pair_measures(&plant, both, &spec, &none, control);
                let near = |found: f32, wanted: f64| (f64::from(found) - wanted).abs() < 1e-4;
                let held = near(pair.nominal, nominal) && near(pair.perturbed, perturbed);
                assert!(held, "{name}, {control:?}, pair {i}: {pair:?}");
            }
        }
    }
}

/// Networks inside formulas and points: the CPU does it, an adapter refuses it by name.
#[test]
fn networks_inside_formulas_and_points_are_the_cpu_s() {
    let mut model = model("between = 3");
    let network = Arc::new(models::network(&[2, 8, 1]));
    let step = model.step.clone();
    model.step = record(model.inputs(), |inputs| {
        let mut next = step.eval(inputs);
        next[1] = next[1] + Expr::lit(0.1) * Expr::call(&network, &inputs[..2])[0];
        next
    });
    let law = Law::Formula(record(model.inputs(), |x| vec![-x[0]]));
    let plant = Plant::new(model, Controller::new("formula", law));
    let (spec, none) = (spec(), Tightening::none(&spec()));
    let cpu = cpu(2);
    let program = cpu.prepare(&plant).expect("prepared");
    let starts: Vec<[f32; 2]> = (0..20).map(|i| [0.05 * i as f32 - 0.5, 0.2]).collect();
    for (x, found) in starts.iter().zip(program.measures(&starts, &spec).expect("run")) {
        let wanted = measure(&plant, x, &spec, &none);
        assert!((f64::from(found) - wanted).abs() < 1e-4, "{x:?}: {found}, not {wanted}");
    }
    let Some(gpu) = adapter() else { return };
    let found = Backend::Gpu(gpu).prepare(&plant).map(drop).expect_err("refused").to_string();
    assert!(found.contains("model.task.between: adapters do not look at points"), "{found}");
}

/// Plans look at samples: with points or without, the same step, and up to a time that is counted otherwise the
/// same numbers.
#[test]
fn plans_of_a_model_with_points_are_those_of_its_whole_step() {
    let planning = |lines: &str| {
        let model = model(lines);
        let stage = record(model.inputs(), |x| vec![x[0] * x[0] + Expr::lit(0.1) * x[1] * x[1]]);
        let settings = MppiSettings::new(&model.controls, 128, 12);
        Planning {
            model: Arc::new(model),
            cost: Arc::new(StageCost::new(stage, 0, None)),
            spec: Arc::new(
                MppiSpec::new(MppiSettings { temperature: 0.1, ..settings }).expect("settings"),
            ),
            value: None,
            disturbance: None,
        }
    };
    let none: [[f32; 0]; 12] = [[]; 12];
    let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
    let problem = MppiProblem::new([0.4, 0.1], &[[0.0]; 12], &none, stream).at_step(7);
    for backend in backends() {
        let [whole, parts] = ["", "between = 3"].map(|lines| {
            let planning = planning(lines);
            let program = backend.prepare_plans(&planning).expect("prepared");
            let problems = std::slice::from_ref(&problem);
            let task = MppiTask { problems, iteration: 0, costs: CostQuery::Each };
            program.improve(&task).expect("run").remove(0)
        });
        for (a, b) in whole.costs.iter().zip(&parts.costs) {
            assert!((a - b).abs() <= 1e-4 * a.abs(), "{}: {a} and {b}", backend.name());
        }
        for (a, b) in whole.plan.iter().zip(&parts.plan) {
            assert!((a - b).abs() <= 1e-3, "{}: {a} and {b}", backend.name());
        }
    }
    let planning = planning("between = 3");
    let (states, u) = (planning.states(&problem, 0, 0), planning.controls(&problem, 0, 0));
    let parts = planning.model.parts(&states[3], &u[3..4], 10);
    assert_eq!(parts.len(), 4);
    assert_eq!(parts[3], states[4]);
    let free = Law::Formula(record(planning.model.inputs(), |_| vec![Expr::lit(0.0)]));
    let plant = Plant::new(Model::clone(&planning.model), Controller::new("free", free));
    assert_eq!(looks::<f32>(&plant, &[0.4, 0.1], 5).len(), 21);
}
