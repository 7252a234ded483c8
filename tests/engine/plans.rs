//! Plans as values: parts of the samples merged to the same bits, models and costs without a compiled
//! form, the time of formulas, networks inside them.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use crate::common::{adapter, backends, cpu};
use reachcast::backend::cpu::Cpu;
use reachcast::backend::{Backend, PlanProgram};
use reachcast::control::DriveBenchmark;
use reachcast::formula::{Expr, record};
use reachcast::model::{StageCost, text};
use reachcast::policy::{Activation, Layer, Mlp};
use reachcast::race::{
    DroneRace, Fence, RaceCost, RaceReference, RecoveryCost, Safety, SafetyCone,
};
use reachcast::real::Real;
use reachcast::rollout::{
    CostQuery, Disturbance, MppiProblem, MppiResult, MppiSettings, MppiSpec, MppiTask, NoiseKind,
    PlanTally, Planning, Purpose, Sigma, Stream, ValueTerm,
};
use reachcast::system::System;

const HORIZON: usize = 12;
const SAMPLES: u32 = 700;

fn cost() -> RaceCost {
    let safety = Safety { weight: 50.0, radius: 0.2, margin: 0.3, cone: SafetyCone::Either };
    let fence = Fence { weight: 20.0, margin: 0.1 };
    RaceCost::Recovery(RecoveryCost { position: 5.0, velocity: 1.0, control: 0.1, safety, fence })
}

fn planning(change: impl FnOnce(&mut MppiSettings)) -> Planning {
    let system = DroneRace::default();
    let mut settings = MppiSettings::new(&system.controls(), SAMPLES, HORIZON as u32);
    settings.temperature = 10.0;
    change(&mut settings);
    Planning::of(&system, cost(), MppiSpec::new(settings).unwrap())
}

fn problems() -> Vec<MppiProblem> {
    let start = [0.3, 0.05, -1.2, 0.6, 0.05, -0.02, -0.2, 0.0, -1.0, 0.4, 0.1, 0.0];
    let problem = |number: u32| {
        let plan = [[0.1 * number as f32, 0.2, -0.1]; HORIZON];
        let context = [RaceReference { speed: 0.5, ..RaceReference::default() }.context(); HORIZON];
        MppiProblem::new(start, &plan, &context, Stream::new(7, Purpose::CONTROL_NOISE, number))
    };
    (0..3).map(problem).collect()
}

fn task(problems: &[MppiProblem]) -> MppiTask<'_> {
    MppiTask { problems, iteration: 1, costs: CostQuery::Each }
}

fn improve(backend: &Backend, planning: &Planning, problems: &[MppiProblem]) -> Vec<MppiResult> {
    backend.prepare_plans(planning).unwrap().improve(&task(problems)).unwrap()
}

/// The results of the parts `cut`, put together from the last to the first.
fn in_parts(
    program: &PlanProgram<'_>,
    problems: &[MppiProblem],
    cut: &[Range<u32>],
) -> Vec<MppiResult> {
    let mut all = vec![PlanTally::default(); problems.len()];
    for samples in cut.iter().rev() {
        let parts = program.tally(&task(problems), samples.clone()).unwrap();
        for (all, part) in all.iter_mut().zip(parts) {
            all.merge(part).unwrap();
        }
    }
    let finished = all.into_iter().zip(problems);
    finished.map(|(tally, problem)| program.finish(tally, problem).unwrap()).collect()
}

#[test]
fn samples_cut_into_parts_give_the_bits_of_the_whole() {
    for backend in backends() {
        let planning = planning(|_| {});
        let (program, problems) = (backend.prepare_plans(&planning).unwrap(), problems());
        let whole = program.improve(&task(&problems)).unwrap();
        // Blocks of the CPU are of 256 samples, those of an adapter of 64.
        for cut in
            [vec![0..256, 256..700], vec![0..512, 512..700], vec![0..256, 256..512, 512..700]]
        {
            assert_eq!(in_parts(&program, &problems, &cut), whole, "{} {cut:?}", backend.name());
        }
        // Cut elsewhere, sums are rounded elsewhere, and costs stay what they are.
        let other = in_parts(&program, &problems, &[0..100, 100..700]);
        for (other, whole) in other.iter().zip(&whole) {
            assert_eq!((&other.costs, other.best), (&whole.costs, whole.best));
            let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-5;
            assert!(other.plan.iter().zip(&whole.plan).all(near), "{}", backend.name());
        }
    }
}

#[test]
fn parts_that_overlap_or_are_missing_are_refused() {
    let (backend, planning, problems) = (cpu(1), planning(|_| {}), problems());
    let program = backend.prepare_plans(&planning).unwrap();
    let part = |samples: Range<u32>| program.tally(&task(&problems), samples).unwrap().remove(0);
    let mut tally = part(0..256);
    let before = tally.clone();
    let refused = tally.merge(part(200..300)).unwrap_err().to_string();
    assert!(refused.contains("200..300") && refused.contains("0..256"), "{refused}");
    assert!(tally == before && tally.samples() == 256);
    let missing = |tally: PlanTally| program.finish(tally, &problems[0]).unwrap_err().to_string();
    assert!(missing(tally.clone()).contains("sample 256 of 700 is missing"));
    tally.merge(part(300..700)).unwrap();
    assert!(missing(tally).contains("sample 256 of 700 is missing"));
    for samples in [0..0, 600..701, 701..800] {
        assert!(program.tally(&task(&problems), samples).is_err());
    }
}

/// Numbers of another plan look like any others: only what they are of tells them apart.
#[test]
fn parts_of_different_plans_are_refused() {
    let (one, two) = (cpu(1), cpu(2));
    let (planning, problems) = (planning(|_| {}), problems());
    let part = |planning: &Planning, task: MppiTask<'_>, samples: Range<u32>| {
        one.prepare_plans(planning).unwrap().tally(&task, samples).unwrap().remove(0)
    };
    let first = part(&planning, task(&problems), 0..256);
    let refused = |other: PlanTally, words: &str| {
        let mut tally = first.clone();
        let message = tally.merge(other).unwrap_err().to_string();
        assert!(message.contains(words), "no `{words}` in: {message}");
        assert_eq!(tally, first, "{words}: changed");
    };
    refused(part(&planning, task(&problems[1..]), 256..700), "another plan");
    let later = problems.iter().map(|problem| problem.clone().at_step(3)).collect::<Vec<_>>();
    refused(part(&planning, task(&later), 256..700), "another first step");
    let next = MppiTask { iteration: 2, ..task(&problems) };
    refused(part(&planning, next, 256..700), "of the iterations 1 and 2");
    let summary = MppiTask { costs: CostQuery::Summary, ..task(&problems) };
    refused(part(&planning, summary, 256..700), "with the cost of each sample");
    let cooler = self::planning(|settings| settings.temperature = 1.0);
    refused(part(&cooler, task(&problems), 256..700), "another specification of the samples");
    let value = ValueTerm { network: network(1), weight: 1.0, threshold: 0.0 };
    let valued = Planning { value: Some(value), ..planning.clone() };
    refused(part(&valued, task(&problems), 256..700), "another value network");
    let mut pushed = (*planning.model).clone();
    pushed.parameters.iter_mut().for_each(|parameter| parameter.value += 0.1);
    let pushed = Planning { model: Arc::new(pushed), ..planning.clone() };
    refused(part(&pushed, task(&problems), 256..700), "another model");
    let short = self::planning(|settings| settings.horizon = 3);
    let cut = |numbers: &[f32]| numbers[..numbers.len() / HORIZON * 3].to_vec();
    let cut = |problem: &MppiProblem| MppiProblem {
        plan: cut(&problem.plan),
        context: cut(&problem.context),
        ..problem.clone()
    };
    refused(part(&short, task(&[cut(&problems[0])]), 256..700), "another horizon");

    // Who runs it makes no difference.
    let mut whole = first.clone();
    let program = two.prepare_plans(&self::planning(|_| {})).unwrap();
    whole.merge(program.tally(&task(&problems), 256..700).unwrap().remove(0)).unwrap();
    let finished = program.finish(whole.clone(), &problems[0]).unwrap();
    assert_eq!(finished, program.improve(&task(&problems)).unwrap()[0]);
    let of_another = program.finish(whole.clone(), &problems[1]).unwrap_err().to_string();
    assert!(of_another.contains("of two problems: another plan"), "{of_another}");
    let elsewhere = one.prepare_plans(&cooler).unwrap().finish(whole, &problems[0]);
    assert!(elsewhere.unwrap_err().to_string().contains("of two programs"));
}

#[test]
fn models_whose_step_does_not_fit_are_refused() {
    let planning = planning(|_| {});
    let inputs = planning.model.inputs();
    for (inputs, outputs) in [(inputs, 1), (inputs, 13), (1, 12)] {
        let step = record(inputs, |x| vec![x[0]; outputs]);
        let mut model = (*planning.model).clone();
        model.step = step;
        let planning = Planning { model: Arc::new(model), ..planning.clone() };
        let refused = cpu(1).prepare_plans(&planning).err().unwrap().to_string();
        assert!(refused.contains("model.step"), "{refused}");
        assert!(refused.contains(&format!("{inputs} inputs and gives {outputs}")), "{refused}");
    }
}

/// A network from the states.
fn network(outputs: usize) -> Arc<Mlp> {
    let layer = |inputs: usize, outputs: usize, seed: usize| {
        Layer::dense(
            (0..inputs * outputs).map(|i| ((i * 37 + seed) % 41) as f32 / 60.0 - 0.3).collect(),
            vec![0.05; outputs],
        )
    };
    let layers = vec![layer(12, 20, 1), layer(20, outputs, 2)];
    Arc::new(Mlp::new(layers, Activation::Relu, Activation::Tanh).unwrap())
}

/// Without their compiled form, model and cost give the same numbers to the last bit.
#[test]
fn interpreted_plans_have_the_bits_of_compiled_ones() {
    let value = || Some(ValueTerm { network: network(1), weight: 30.0, threshold: 0.4 });
    let entries = vec![(7, 0.05), (9, 0.04), (11, -0.03)];
    let push = || Some(Disturbance { network: network(3), entries: entries.clone() });
    let covariance = [[0.16, 0.05, 0.0], [0.05, 0.2, -0.02], [0.0, -0.02, 0.1]];
    let noisy = planning(|settings| {
        settings.noise_cost = true;
        settings.antithetic = true;
        settings.sigma = Sigma::Covariance(covariance.map(Vec::from).to_vec());
    });
    let plain = planning(|settings| settings.noise = NoiseKind::Spline { knots: 5 });
    let networked = Planning { value: value(), disturbance: push(), ..plain.clone() };
    for compiled in [plain, noisy, networked] {
        let as_text = Planning {
            model: Arc::new(compiled.model.as_ref().clone().as_text()),
            cost: Arc::new(compiled.cost.as_ref().clone().as_text()),
            ..compiled.clone()
        };
        let backend = cpu(2);
        let wanted = improve(&backend, &compiled, &problems());
        assert_eq!(improve(&backend, &as_text, &problems()), wanted);
        let half = Planning { cost: as_text.cost, ..compiled };
        assert_eq!(improve(&backend, &half, &problems()), wanted, "a compiled system alone");
    }
}

/// Whatever instructions the processor has, compiled or interpreted.
#[test]
fn plans_have_the_same_bits_with_any_instructions() {
    let compiled = planning(|settings| settings.noise = NoiseKind::Colored { time: 4.0 });
    let as_text =
        Planning { cost: Arc::new(compiled.cost.as_ref().clone().as_text()), ..compiled.clone() };
    for planning in [compiled, as_text] {
        let each = Cpu::each(Some(1)).unwrap().into_iter().map(|cpu| {
            let name = cpu.instructions();
            (name, improve(&Backend::Cpu(cpu), &planning, &problems()))
        });
        let each: Vec<_> = each.collect();
        for (name, plans) in &each {
            assert_eq!(*plans, each[0].1, "{name}");
        }
    }
}

#[test]
fn an_interpreted_map_has_the_bits_of_a_compiled_one() {
    let DriveBenchmark { planning, problem, .. } = DriveBenchmark::new(600).unwrap();
    let as_text =
        Planning { cost: Arc::new(planning.cost.as_ref().clone().as_text()), ..planning.clone() };
    let problems = [problem];
    assert_eq!(improve(&cpu(2), &as_text, &problems), improve(&cpu(2), &planning, &problems));
}

/// A text has no compiled form at all, and its formulas may read the time and parameters.
const CART: &str = r#"
[model]
name = "cart"
[model.states]
place = { unit = "m", box = [-1.0, 1.0] }
speed = { unit = "m/s", box = [-1.0, 1.0] }
[model.controls]
force = { unit = "N", bounds = [-2.0, 2.0] }
[model.parameters]
wind = { unit = "N", value = 0.7 }
[model.flow]
place = "speed"
speed = "force + wind * sin(3 * t) + 0.01 * step"
[model.time]
period = 0.1
integrator = "rk4"
substeps = 2
[model.task]
kind = "reach-avoid"
target = "0.1 - abs(place)"
constraint = "2 - abs(place)"
[policy]
formula = { force = "0" }
"#;

/// The cost of a stage: far from a place that moves, `x^2 + 0.1 u^2 + t`, with the place as context.
fn cart_cost(inputs: usize) -> StageCost {
    let time = inputs - 2;
    let stage = record(inputs + 1, |x| {
        let off = x[0] - x[inputs];
        vec![off * off + Expr::lit(0.1) * x[2] * x[2] + x[time]]
    });
    StageCost::new(stage, 1, None)
}

/// The cost of a sample in f64, from the mathematics: rk4 in halves of a period, force held.
fn truth(controls: &[f32], first_step: u32) -> f64 {
    let (wind, period) = (f64::from(0.7_f32), f64::from(0.1_f32));
    let (mut x, mut total) = ([0.4, -0.3], 0.0);
    for (i, u) in controls.iter().enumerate() {
        let (u, step) = (f64::from(*u), f64::from(first_step) + i as f64);
        let t = step * period;
        let goal = 0.05 * i as f64;
        total += (x[0] - goal).powi(2) + 0.1 * u * u + t;
        let slope = |x: [f64; 2], t: f64| [x[1], u + wind * (3.0 * t).sin() + 0.01 * step];
        for half in 0..2 {
            let (h, t) = (0.5 * period, t + 0.5 * period * f64::from(half));
            let at = |k: [f64; 2], s: f64| [x[0] + s * k[0], x[1] + s * k[1]];
            let k1 = slope(x, t);
            let k2 = slope(at(k1, 0.5 * h), t + 0.5 * h);
            let k3 = slope(at(k2, 0.5 * h), t + 0.5 * h);
            let k4 = slope(at(k3, h), t + h);
            x = [0, 1].map(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
    }
    total
}

#[test]
fn plans_of_a_text_see_its_time_and_parameters() {
    let plant = text::read(CART, "cart.toml", Path::new(".")).unwrap().plant().unwrap();
    let settings = MppiSettings::new(&plant.model.controls, 130, 9);
    let planning = Planning {
        cost: Arc::new(cart_cost(plant.model.inputs())),
        model: plant.model,
        spec: Arc::new(MppiSpec::new(settings).unwrap()),
        value: None,
        disturbance: None,
    };
    let context: Vec<[f32; 1]> = (0..9).map(|t| [0.05 * t as f32]).collect();
    let stream = Stream::new(5, Purpose::CONTROL_NOISE, 0);
    let problem = |step| MppiProblem::new([0.4, -0.3], &[[0.2]; 9], &context, stream).at_step(step);
    let problems = [problem(0), problem(23)];
    for backend in backends() {
        for (result, problem) in improve(&backend, &planning, &problems).iter().zip(&problems) {
            for (k, cost) in (0..).zip(&result.costs) {
                let wanted = truth(&planning.controls(problem, 1, k), problem.first_step);
                let band = 2e-5 * wanted.abs().max(1.0);
                assert!(
                    (f64::from(*cost) - wanted).abs() < band,
                    "{} {cost} {wanted}",
                    backend.name()
                );
            }
        }
    }
}

/// A dynamics that is learned in part: the CPU plans through it, an adapter leaves it to the CPU and
/// says so, or refuses.
#[test]
fn networks_inside_formulas_are_planned_through_on_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let layer = Layer::dense(vec![-0.5], vec![0.0]);
    let drag = Mlp::new(vec![layer], Activation::Relu, Activation::Identity).unwrap();
    std::fs::write(folder.path().join("drag.safetensors"), drag.to_bytes()).unwrap();
    let written = CART.replace("wind * sin(3 * t) + 0.01 * step", "-0.5 * speed");
    let called =
        CART.replace("wind * sin(3 * t) + 0.01 * step", "net('drag.safetensors', speed)[0]");
    let read = |text: &str| text::read(text, "cart.toml", folder.path()).unwrap().plant().unwrap();
    let [written, called] = [written, called].map(|text| {
        let model = read(&text).model;
        let settings = MppiSettings::new(&model.controls, 200, 9);
        let cost = Arc::new(cart_cost(model.inputs()));
        let spec = Arc::new(MppiSpec::new(settings).unwrap());
        Planning { model, cost, spec, value: None, disturbance: None }
    });
    let stream = Stream::new(5, Purpose::CONTROL_NOISE, 0);
    let problems = [MppiProblem::new([0.4, -0.3], &[[0.2]; 9], &[[0.0]; 9], stream)];
    let (wanted, found) =
        (improve(&cpu(2), &written, &problems), improve(&cpu(2), &called, &problems));
    for (a, b) in wanted[0].costs.iter().zip(&found[0].costs) {
        assert!((a - b).abs() <= 1e-5 * a.abs(), "{a} {b}");
    }
    let Some(gpu) = adapter() else { return };
    let Backend::Cpu(host) = cpu(2) else { panic!("the CPU") };
    let gpu = gpu.with_fallback(host);
    let backend = Backend::Gpu(gpu);
    assert_eq!(improve(&backend, &called, &problems), found);
    assert!(backend.events()[0].to_string().contains("networks"), "{:?}", backend.events());
    let Some(gpu) = adapter() else { return };
    let refused = Backend::Gpu(gpu).prepare_plans(&called).map(drop).unwrap_err().to_string();
    assert!(refused.contains("native CPU backend"), "{refused}");
}
