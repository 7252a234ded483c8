//! What plans cost, as text and from Rust: stages, ends, references and maps against loops in f64, on
//! every backend.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use crate::costs;
use crate::oracle;
use std::path::Path;
use std::sync::Arc;

use crate::common::{adapter, backends, cpu};
use reachcast::backend::Backend;
use reachcast::backend::cpu::Cpu;
use reachcast::cost::Cost;
use reachcast::formula::{Node, record};
use reachcast::model::{StageCost, TermKind, TerminalCost, text};
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::real::Real;
use reachcast::rollout::{
    CostQuery, Disturbance, MppiProblem, MppiResult, MppiSettings, MppiSpec, MppiTask, Planning,
    Purpose, Stream, ValueTerm,
};
use reachcast::system::{DoubleIntegrator, System};

/// One stage, as many as a tile of the update has and some, and more than a submission takes at once.
#[test]
fn costs_of_a_text_agree_with_an_f64_loop() {
    for backend in backends() {
        for horizon in [1, 9, 37] {
            costs::disagreement(&backend, horizon).unwrap_or_else(|error| {
                panic!("{} H = {horizon}: {error}", backend.name());
            });
        }
    }
}

/// The comparison fails where the end is charged twice or not at all, or is told what the last stage was,
/// where references are a step late or held too early, and where a map is another one.
#[test]
fn the_comparison_notices() {
    type Change = fn(&mut StageCost, &mut [MppiProblem]);
    let twice: Change = |cost, _| {
        let formula = &mut cost.terminal.as_mut().unwrap().formula;
        let once = formula.outputs[0];
        formula.nodes.push(Node::Add(once, once));
        formula.outputs = vec![formula.nodes.len() as u32 - 1];
    };
    let never: Change = |cost, problems| {
        cost.terminal = None;
        problems.iter_mut().for_each(|problem| problem.context.truncate(9 * 3));
    };
    let last: Change = |_, problems| {
        problems.iter_mut().for_each(|problem| problem.context.copy_within(8 * 3..9 * 3, 9 * 3));
    };
    let late: Change = |_, problems| {
        problems.iter_mut().for_each(|problem| problem.context.copy_within(..9 * 3, 3));
    };
    let held: Change = |_, problems| problems[1].context[8 * 3 + 1] += 0.25;
    let maps: Change = |cost, _| cost.lookups.as_mut().unwrap().maps.swap(0, 1);
    let clock: Change =
        |_, problems| problems.iter_mut().for_each(|problem| problem.first_step += 1);
    for backend in backends() {
        let all = [twice, never, last, late, held, maps, clock];
        for (number, change) in all.into_iter().enumerate() {
            let found = costs::changed(&backend, 9, change);
            assert!(found.is_err(), "{}: change {number} is not noticed", backend.name());
        }
    }
}

#[test]
fn tapes_of_costs_have_the_same_bits_with_any_instructions() {
    let (planning, all) = costs::skiff(9);
    let problems = [costs::problem(&all, 9, 0), costs::problem(&all, 9, 1)];
    let each = Cpu::each(Some(1)).unwrap().into_iter();
    let each: Vec<_> = each.map(|cpu| improve(&Backend::Cpu(cpu), &planning, &problems)).collect();
    assert!(each.iter().all(|found| *found == each[0]));
}

fn improve(backend: &Backend, planning: &Planning, problems: &[MppiProblem]) -> Vec<MppiResult> {
    let task = MppiTask { problems, iteration: 5, costs: CostQuery::Each };
    backend.prepare_plans(planning).unwrap().improve(&task).unwrap()
}

/// The shares of a state add up to what the cost of a stage and that of an end come to, and references
/// are those of their step.
#[test]
fn shares_add_up_to_the_costs() {
    let (planning, all) = costs::skiff(1);
    let names: Vec<_> = all.terms.iter().map(|term| (term.name.as_str(), term.kind)).collect();
    let stages = ["place", "effort", "ice", "late"].map(|name| (name, TermKind::Stage));
    let ends = ["place", "ground"].map(|name| (name, TermKind::Terminal));
    assert_eq!(names, [&stages[..], &ends[..]].concat());
    for number in 0..3 {
        let (start, first_step) = costs::start(number);
        let problem = costs::problem(&all, 1, number);
        let u = planning.controls(&problem, 2, 7);
        let stage: f32 = all.shares(&start, &u, first_step)[..4].iter().sum();
        let next = planning.model.next(&start, &u, first_step);
        let end: f32 = all.shares(&next, &[0.0, 0.0], first_step + 1)[4..].iter().sum();
        let wanted = costs::truth(start, &u, first_step).unwrap();
        let found = f64::from(stage) + f64::from(end);
        assert!((found - wanted).abs() < 2e-5 * wanted.abs(), "{found} {wanted}");
        // Nobody is told the control of an end.
        assert_eq!(all.shares(&next, &[2.0, 1.0], 3)[4..], all.shares(&next, &[0.0; 2], 3)[4..]);
    }
    // goal_x, goal_y, calm at the steps 19 and 20: the last row is held.
    let rows = all.contexts(19, 1);
    assert_eq!(rows.len(), 6);
    assert_eq!([rows[1], rows[4], rows[2], rows[5]], [0.75, 0.75, 0.3, 0.3]);
    assert!((f64::from(rows[3]) - (1.0_f64.sin() + 0.4)).abs() < 1e-6, "{rows:?}");
}

/// The cost of a landing: near a place along the way, near another one and slow at its end.
#[derive(Clone)]
struct Landing;

impl Cost<2, 1, 2> for Landing {
    #[inline(always)]
    fn stage<R: Real>(&self, [x, v]: [R; 2], [u]: [R; 1], [place, low]: [R; 2]) -> R {
        let off = x - place;
        off * off + R::lit(0.1) * v * v + R::lit(0.05) * u * u + low
    }

    #[inline(always)]
    fn terminal<R: Real>(&self, [x, v]: [R; 2], [place, fast]: [R; 2]) -> Option<R> {
        Some(R::lit(5.0) * (x - place).abs() + fast * v * v)
    }
}

/// A context for each of `rows` rows.
fn contexts(rows: usize) -> Vec<[f32; 2]> {
    (0..rows).map(|t| [0.3 * (t as f32).sin(), 0.5 + 0.1 * t as f32]).collect()
}

fn landing(horizon: u32) -> (Planning, Vec<MppiProblem>) {
    let system = DoubleIntegrator::default();
    let settings = MppiSettings {
        temperature: 5.0,
        noise_cost: true,
        ..MppiSettings::new(&system.controls(), 150, horizon)
    };
    let planning = Planning::of(&system, Landing, MppiSpec::new(settings).unwrap());
    let problem = |number: u32| {
        let (plan, stream) = (vec![[0.4]; horizon as usize], Purpose::CONTROL_NOISE);
        let stream = Stream::new(3, stream, number);
        MppiProblem::new(
            [0.8 - 0.3 * number as f32, -0.2],
            &plan,
            &contexts(horizon as usize + 1),
            stream,
        )
    };
    (planning, (0..3).map(problem).collect())
}

/// Behind value network and disturbance, too: the end is the state that the last push left.
#[test]
fn a_terminal_cost_from_rust_agrees_with_an_f64_loop() {
    let layer = Layer::dense(vec![0.7, -0.9], vec![0.2]);
    let network = Mlp::new(vec![layer], Activation::Tanh, Activation::Tanh).unwrap();
    let network = Arc::new(network);
    for (horizon, networked) in [(1, false), (17, false), (1, true), (17, true)] {
        let (mut planning, problems) = landing(horizon);
        if networked {
            let network = Arc::clone(&network);
            planning.value = Some(ValueTerm { network, weight: 3.0, threshold: 0.4 });
            let network = Arc::clone(planning.value.as_ref().map(|term| &term.network).unwrap());
            planning.disturbance = Some(Disturbance { network, entries: vec![(1, 0.3)] });
        }
        let host = improve(&cpu(2), &planning, &problems);
        let plant = (&DoubleIntegrator::default(), &Landing);
        for backend in backends() {
            let results = improve(&backend, &planning, &problems);
            for ((result, host), problem) in results.iter().zip(&host).zip(&problems) {
                let truth = oracle::truth::<_, _, 2, 1, 2>(plant, &planning, (problem, 5));
                let worst = host.costs.iter().zip(&truth.costs);
                let worst = worst.map(|(cost, truth)| (f64::from(*cost) - truth).abs());
                assert!(worst.fold(0.0, f64::max) < 1e-4, "H = {horizon}");
                oracle::differences(&truth, result, host, planning.spec.settings())
                    .unwrap_or_else(|error| panic!("{} H = {horizon}: {error}", backend.name()));
            }
        }
    }
}

/// Without its compiled form, a cost with an end has the same bits.
#[test]
fn an_interpreted_end_has_the_bits_of_a_compiled_one() {
    let (planning, problems) = landing(17);
    let as_text =
        Planning { cost: Arc::new(planning.cost.as_ref().clone().as_text()), ..planning.clone() };
    let backend = cpu(2);
    assert_eq!(improve(&backend, &as_text, &problems), improve(&backend, &planning, &problems));
    // Another end is another cost, and the compiled one does not stand in for it.
    let own = planning.model.inputs();
    let free = TerminalCost::new(record(own + 2, |x| vec![x[0] - x[0]]));
    let changed = planning.cost.as_ref().clone().with_terminal(Some(free));
    let changed = Planning { cost: Arc::new(changed), ..planning.clone() };
    assert!(improve(&backend, &changed, &problems) != improve(&backend, &planning, &problems));
}

/// What does not fit is refused by what it is.
#[test]
fn ends_that_do_not_fit_are_refused() {
    let (planning, mut problems) = landing(4);
    let program = cpu(1);
    let program = program.prepare_plans(&planning).unwrap();
    problems[1].context.truncate(8);
    let task = MppiTask { problems: &problems, iteration: 0, costs: CostQuery::Summary };
    let refused = program.improve(&task).unwrap_err().to_string();
    assert!(refused.contains("problem 1 has 8 numbers, expected 5 steps of 2"), "{refused}");
    let own = planning.model.inputs();
    let refused = |terminal: TerminalCost| {
        let cost = planning.cost.as_ref().clone().with_terminal(Some(terminal));
        let planning = Planning { cost: Arc::new(cost), ..planning.clone() };
        cpu(1).prepare_plans(&planning).map(drop).unwrap_err().to_string()
    };
    let short = refused(TerminalCost::new(record(own, |x| vec![x[0]])));
    assert!(short.contains("the terminal cost takes"), "{short}");
    let driven = refused(TerminalCost::new(record(own + 2, |x| vec![x[2]])));
    let name = &planning.model.controls[0].name;
    assert!(driven.contains(&format!("reads the control `{name}`")), "{driven}");
}

/// A place that is no number costs no number: such a sample weighs nothing.
#[test]
fn a_map_hands_a_nan_on() {
    let folder = tempfile::tempdir().unwrap();
    costs::write_files(folder.path());
    let begin = costs::SKIFF.split("[model.costs]").next().unwrap();
    let text = format!(
        "{begin}[model.costs]\nstage.ground = {{ weight = 1.0, formula = \"ground(log(x), y)\" }}\n\
         [model.maps]\nground = {{ file = \"ground.npy\", origin = [-1.1, -0.7], cell = 0.25 }}\n"
    );
    let description = text::read(&text, "skiff.toml", folder.path()).unwrap();
    let cost = Arc::new(description.costs().unwrap().unwrap().stage);
    let model = Arc::new(description.model().unwrap());
    let spec = Arc::new(MppiSpec::new(MppiSettings::new(&model.controls, 70, 1)).unwrap());
    let planning = Planning { model, cost, spec, value: None, disturbance: None };
    let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
    let problem = |x: f32| MppiProblem::new([x, 0.0, 0.0], &[[0.0; 2]], &[[0.0; 0]], stream);
    for backend in backends() {
        let found = improve(&backend, &planning, &[problem(-0.5), problem(0.5)]);
        let failed: Vec<u32> = found.iter().map(|result| result.non_finite).collect();
        assert_eq!(failed, [70, 0], "{}", backend.name());
    }
}

/// A cost that is learned in part: the CPU plans by it; an adapter leaves it to the CPU, or refuses.
#[test]
fn costs_may_call_networks_on_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let layer = Layer::dense(vec![-0.5], vec![0.25]);
    let line = Mlp::new(vec![layer], Activation::Relu, Activation::Identity).unwrap();
    std::fs::write(folder.path().join("line.safetensors"), line.to_bytes()).unwrap();
    let begin = costs::SKIFF.split("[model.costs]").next().unwrap();
    let planning = |formula: &str| {
        let text = format!(
            "{begin}[model.costs]\nstage.effort = {{ weight = 1.0, formula = \"speed^2\" }}\n\
             terminal.line = {{ weight = 2.0, formula = \"{formula}\" }}\n"
        );
        let description = text::read(&text, "skiff.toml", folder.path()).unwrap();
        assert!(
            description.networks(|_, _| unreachable!()).unwrap().is_empty(),
            "the plant calls none"
        );
        let cost: StageCost = description.costs().unwrap().unwrap().stage;
        let model = Arc::new(description.model().unwrap());
        let spec = MppiSpec::new(MppiSettings::new(&model.controls, 70, 5)).unwrap();
        let spec = Arc::new(spec);
        Planning { model, cost: Arc::new(cost), spec, value: None, disturbance: None }
    };
    let [called, written] = ["net('line.safetensors', x)[0]", "0.25 - 0.5 * x"].map(planning);
    let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
    let problems = [MppiProblem::new([0.3, 0.0, 0.0], &[[1.0, 0.5]; 5], &[[0.0; 0]; 6], stream)];
    let costs = |planning: &Planning| improve(&cpu(1), planning, &problems)[0].costs.clone();
    for (a, b) in costs(&called).iter().zip(costs(&written)) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    let Some(gpu) = adapter() else { return };
    let refused = Backend::Gpu(gpu).prepare_plans(&called).map(drop).unwrap_err().to_string();
    assert!(refused.contains("call networks") && refused.contains("native CPU"), "{refused}");
}

/// Costs are no part of the plant: with and without them it has the same text.
#[test]
fn costs_are_no_part_of_a_plant() {
    let begin = costs::SKIFF.split("[model.costs]").next().unwrap();
    let policy = "[policy]\nformula = { speed = \"1\", turn = \"-heading\" }\n";
    // The files that the costs name are not there.
    let plant = |text: String| {
        let description = text::read(&text, "skiff.toml", Path::new("nowhere")).unwrap();
        description.plant().unwrap().text()
    };
    assert_eq!(plant(format!("{begin}{policy}")), plant(format!("{}{policy}", costs::SKIFF)));
}
