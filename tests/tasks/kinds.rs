//! Tasks against brute force: each kind's measure from its definition over stored trajectories, on every
//! backend, its signs with early exit, its pairs, its margin drops; and kernels that break a rule are caught.

use std::path::Path;

use crate::common::{backends, cpu};
use reachcast::Error;
use reachcast::backend::Backend;
use reachcast::model::{Plant, Task, Window, text};
use reachcast::rollout::drops::Shapes;
use reachcast::rollout::replay::{measure_of, pair_margins, states, states_margins};
use reachcast::rollout::{
    DeviationTask, Keep, NON_FINITE, PairControl, Pairs, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Starts, Stream, Tightening,
};
use reachcast::train::settings::Method;
use reachcast::train::soft::{Measured, measure_tape};
use reachcast::tube::Tube;

/// Steps.
const HORIZON: u32 = 12;
/// Discount.
const GAMMA: f32 = 0.9;
/// Starts of each comparison.
const STARTS: u64 = 1500;
/// Largest distance of f32 from f64.
const BAND: f64 = 1e-4;

/// A point that turns around the origin and leaves it slowly: its state is lost beyond x = 1.5, its target
/// margin is no number below x = -1.4, its constraint margin where y < -1.6.
const TURN: &str = r#"
[model]
name = "turn"
[model.states]
x = { unit = "m", box = [-1.3, 1.3] }
y = { unit = "m", box = [-1.3, 1.3] }
[model.controls]
push = { unit = "m", bounds = [-0.2, 0.2] }
[model.next]
x = "1.02 * (0.8 * x - 0.6 * y) + push + 0 * log(1.5 - x)"
y = "1.02 * (0.6 * x + 0.8 * y)"
[model.time]
period = 0.25
"#;
/// The margins; each changes its sign many times.
const TARGET: &str = "target = \"0.2 + x + 0.3 * sin(2 * step) + 0 * sqrt(x + 1.4)\"\n";
const CONSTRAINT: &str = "constraint = \"1.1 + y - 0.2 * cos(step) + 0 * sqrt(y + 1.6)\"\n";
const POLICY: &str = "[policy]\nformula = { push = \"-0.1 * y\" }\n";

/// A task with its lines of text, in steps and seconds.
struct Case {
    task: Task,
    lines: &'static str,
}

/// Every kind, with and without its times.
fn cases() -> Vec<Case> {
    let window = |from, to| Window { from, to };
    let case = |task, lines| Case { task, lines };
    vec![
        case(Task::ReachAvoid(window(0, None)), "kind = \"reach-avoid\"\n"),
        case(
            Task::ReachAvoid(window(3, Some(8))),
            "kind = \"reach-avoid\"\nfrom = 3\nto = \"2 s\"\n",
        ),
        case(Task::Avoid, "kind = \"avoid\"\n"),
        case(Task::Reach(window(0, None)), "kind = \"reach\"\n"),
        case(Task::Reach(window(4, Some(7))), "kind = \"reach\"\nfrom = \"1.0 s\"\nto = 7\n"),
        case(Task::Reach(window(0, Some(0))), "kind = \"reach\"\nto = 0\n"),
        case(Task::ReachStay { by: Some(9) }, "kind = \"reach-stay\"\nby = \"2.25 s\"\n"),
        case(Task::ReachStay { by: None }, "kind = \"reach-stay\"\n"),
        case(Task::AtEnd, "kind = \"at-end\"\n"),
    ]
}

impl Case {
    fn plant(&self) -> Plant {
        let target = if self.task == Task::Avoid { "" } else { TARGET };
        let constraint = if matches!(self.task, Task::Reach(_)) { "" } else { CONSTRAINT };
        let text = format!("{TURN}[model.task]\n{}{target}{constraint}{POLICY}", self.lines);
        plant(&text).expect("a plant")
    }
}

fn plant(text: &str) -> Result<Plant, Error> {
    let description = text::read(text, "turn.toml", Path::new("."))?;
    Ok(Plant::new(description.model()?, description.controller()?))
}

fn spec() -> RolloutSpec {
    RolloutSpec::new(HORIZON, GAMMA).expect("a specification")
}

/// Losses that differ from step to step and from each other.
fn losses() -> Tightening {
    let of = |first: f32, more: f32| (0..=HORIZON).map(|t| first + more * t as f32).collect();
    Tightening::losing(of(0.02, 0.01), of(0.05, 0.004))
}

fn starts() -> Starts<'static> {
    let region = Region::new_box([-1.3; 2], [1.3; 2]).expect("a box");
    Starts::Drawn { region, stream: Stream::new(11, Purpose::USER, 0) }
}

fn pairs() -> Pairs<'static> {
    Pairs { nominal: starts(), radius: 0.1, stream: Stream::new(11, Purpose::USER, 1) }
}

/// A state by what the definitions need of it: r and c as the formulas say, after their losses.
struct Seen {
    finite: bool,
    target: f64,
    constraint: f64,
}

/// The margins of TURN at a state, written from the text.
fn seen(x: &[f64], t: u32, [lost_r, lost_c]: [f32; 2]) -> Seen {
    let step = f64::from(t);
    let (a, b) = (f64::from(0.2_f32), f64::from(0.3_f32));
    let target = a + x[0] + b * (2.0 * step).sin();
    let constraint = f64::from(1.1_f32) + x[1] - a * step.cos();
    let or_lost = |number: f64, lost: bool| if lost { f64::NAN } else { number };
    Seen {
        finite: x.iter().all(|x| x.is_finite()),
        target: or_lost(target, x[0] < -f64::from(1.4_f32)) - f64::from(lost_r),
        constraint: or_lost(constraint, x[1] < -f64::from(1.6_f32)) - f64::from(lost_c),
    }
}

/// The measure of a trajectory by the definition of its task.
fn brute_force(task: Task, seen: &[Seen]) -> f64 {
    let last = seen.len() - 1;
    let discounted = |t: usize, margin: f64| f64::from(GAMMA).powi(t as i32) * margin;
    let r = |t: usize| discounted(t, seen[t].target);
    let c = |t: usize| discounted(t, seen[t].constraint);
    let least = |values: &mut dyn Iterator<Item = f64>| values.fold(1e30, f64::min);
    let safe_until = |t: usize| least(&mut (0..=t).map(c));
    // The first step at which a number that counts is none.
    let lost = |target: &dyn Fn(usize) -> bool, constraint: bool| {
        let broken = |t: &usize| {
            let Seen { finite, target: r, constraint: c } = &seen[*t];
            !finite || (target(*t) && r.is_nan()) || (constraint && c.is_nan())
        };
        (0..=last).find(broken).unwrap_or(usize::MAX)
    };
    let chosen = |window: Window, constrained: bool| {
        let (from, to) = (window.from as usize, window.to.map_or(last, |to| to as usize));
        let lost = lost(&|t| (from..=to).contains(&t), constrained);
        let held = |t: usize| if constrained { safe_until(t).min(r(t)) } else { r(t).min(1e30) };
        let best = (from..=to).filter(|t| *t < lost).map(held).fold(-1e30, f64::max);
        if best <= 0.0 && lost <= to { f64::from(NON_FINITE) } else { best }
    };
    let always = |by: usize| match lost(&|t| t >= by, true) {
        usize::MAX => safe_until(last).min(least(&mut (by..=last).map(r))),
        _ => f64::from(NON_FINITE),
    };
    match task {
        Task::ReachAvoid(window) => chosen(window, true),
        Task::Reach(window) => chosen(window, false),
        Task::Avoid => always(last + 1),
        Task::ReachStay { by } => always(by.map_or(last, |by| by as usize)),
        Task::AtEnd => always(last),
    }
}

/// Measure of stored states, with what margins lose.
fn of_states(task: Task, states: &[Vec<f64>], tightening: &Tightening) -> f64 {
    let at = |(t, x): (usize, &Vec<f64>)| {
        seen(x, t as u32, [tightening.target[t], tightening.constraint[t]])
    };
    brute_force(task, &states.iter().enumerate().map(at).collect::<Vec<Seen>>())
}

/// Whether f32 may see other numbers lost than f64.
fn is_edge(states: &[Vec<f64>]) -> bool {
    let near = |x: f64, edge: f64| (x - edge).abs() < BAND;
    states.iter().any(|x| near(x[0], 1.5) || near(x[0], -1.4) || near(x[1], -1.6))
}

/// Requires `found` to be `wanted` up to f32.
fn close(found: f32, wanted: f64, about: &str) -> Result<(), String> {
    let near = (f64::from(found) - wanted).abs() <= BAND * wanted.abs().max(1.0);
    near.then_some(()).ok_or_else(|| format!("{about}: {found}, not {wanted}"))
}

fn task_of<'a>(tightening: &'a Tightening, query: Query) -> ReachAvoidTask<'a> {
    ReachAvoidTask { starts: starts(), range: 0..STARTS, spec: spec(), tightening, query }
}

/// Whether measures and signs of a task on `backend` are those of its definition.
fn measures_agree(backend: &Backend, case: &Case) -> Result<(), String> {
    let (plant, losses, Case { task, .. }) = (case.plant(), losses(), case);
    let program = backend.prepare(&plant).map_err(|e| e.to_string())?;
    let all = |query| -> Result<Vec<f32>, String> {
        let tally = program.tally(&task_of(&losses, query), Keep::Measures);
        let found = tally.and_then(|tally| tally.finish(0..STARTS));
        found.map(|found| found.values).map_err(|e| e.to_string())
    };
    let (measures, signs) = (all(Query::Measure)?, all(Query::Sign)?);
    let (mut edges, mut successes) = (0, 0);
    for (i, (measure, sign)) in measures.into_iter().zip(signs).enumerate() {
        let about = format!("{task}, start {i}, {}", backend.name());
        if (measure > 0.0) != (sign > 0.0) {
            return Err(format!("{about}: measure {measure}, sign {sign}"));
        }
        let states = states::<f64>(&plant, &starts().start(i as u64), HORIZON);
        if is_edge(&states) {
            edges += 1;
            continue;
        }
        let wanted = of_states(*task, &states, &losses);
        successes += u64::from(wanted > 0.0);
        close(measure, wanted, &about)?;
    }
    let share = successes as f64 / STARTS as f64;
    println!("{task} on {}: {successes} successes, {edges} at an edge", backend.name());
    let telling = edges < 30 && (0.01..0.99).contains(&share);
    telling.then_some(()).ok_or_else(|| format!("{task}: {share} succeed, {edges} at an edge"))
}

/// Whether both measures of pairs on `backend` are those of the definition.
fn pairs_agree(backend: &Backend, case: &Case, control: PairControl) -> Result<(), String> {
    let (plant, losses, Case { task, .. }) = (case.plant(), losses(), case);
    let (pairs, spec, range) = (pairs(), spec(), 0..STARTS / 5);
    let asked = DeviationTask {
        pairs: pairs.clone(),
        range: range.clone(),
        spec,
        tightening: &losses,
        control,
    };
    let program = backend.prepare(&plant).map_err(|e| e.to_string())?;
    let mut found = Vec::new();
    let mut sink = |_, pairs: &[_]| {
        found.extend_from_slice(pairs);
        Ok(())
    };
    program.deviation(&asked, &mut sink).map_err(|e| e.to_string())?;
    for (i, pair) in (0..).zip(found) {
        let both = pairs.pair(i);
        let [nominal, perturbed] = stored(&plant, &both, control);
        if is_edge(&nominal) || is_edge(&perturbed) {
            continue;
        }
        let about = format!("{task}, pair {i}, {control:?}, {}", backend.name());
        close(pair.nominal, of_states(*task, &nominal, &losses), &about)?;
        close(pair.perturbed, of_states(*task, &perturbed, &Tightening::none(&spec)), &about)?;
    }
    Ok(())
}

/// The states of both rollouts of a pair.
fn stored(
    plant: &Plant,
    [nominal, perturbed]: &[Vec<f32>; 2],
    control: PairControl,
) -> [Vec<Vec<f64>>; 2] {
    let nominal = states::<f64>(plant, nominal, HORIZON);
    let mut all = vec![perturbed.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>()];
    for step in 0..HORIZON {
        let at = step as usize;
        let seen = match control {
            PairControl::Replay => &nominal[at],
            PairControl::ClosedLoop => &all[at],
        };
        let next = plant.model.next(&all[at], &plant.control(seen, step), step);
        all.push(next);
    }
    [nominal, all]
}

fn agree(backend: &Backend) -> Result<(), String> {
    cases().iter().try_for_each(|case| {
        measures_agree(backend, case)?;
        pairs_agree(backend, case, PairControl::Replay)?;
        pairs_agree(backend, case, PairControl::ClosedLoop)
    })
}

#[test]
fn every_kind_is_its_definition_on_every_backend() {
    for backend in backends() {
        agree(&backend).unwrap_or_else(|problem| panic!("{problem}"));
    }
}

#[test]
fn every_kind_is_its_definition_in_f64() {
    let (spec, losses) = (spec(), losses());
    for case in cases() {
        let (plant, task) = (case.plant(), case.task);
        assert_eq!(plant.model.task, task, "{}", case.lines);
        for i in 0..STARTS {
            let start = starts().start(i);
            let found = reachcast::rollout::replay::measure(&plant, &start, &spec, &losses);
            let wanted = of_states(task, &states(&plant, &start, HORIZON), &losses);
            let near = (found - wanted).abs() <= 1e-5 * wanted.abs().max(1.0);
            assert!(near, "{task}, start {i}: {found}, not {wanted}");
        }
    }
}

/// The proof of margin drops, pair by pair: a pair whose drops are at most lambda, and whose nominal start is
/// certified at lambda, succeeds.
#[test]
fn a_nominal_start_certified_at_the_drop_of_its_pair_has_a_perturbed_one_that_succeeds() {
    let shape = |a: f64, b: f64| (0..=HORIZON).map(|t| a + b * f64::from(t)).collect();
    // So that the drops of either margin decide the level of some pairs.
    let sets = [[0.03, 0.3], [0.3, 0.03]].map(|[target, constraint]| Shapes {
        target: shape(target, 0.001),
        constraint: shape(constraint, 0.002),
    });
    let (spec, pairs) = (spec(), pairs());
    for case in cases() {
        let (plant, task) = (case.plant(), case.task);
        let (mut certified, mut tight) = (0, 0);
        for i in 0..8 * STARTS {
            let shapes = &sets[(i % 2) as usize];
            let both = pairs.pair(i);
            let of = [&*both[0], &*both[1]];
            let margins = pair_margins(&plant, of, &spec, PairControl::Replay);
            let level = shapes.largest(&margins).max(0.0);
            if level == f64::INFINITY {
                continue;
            }
            let check = |level| measure_of(&margins.nominal, &spec, &shapes.tightening(level));
            let [_, perturbed] = stored(&plant, &both, PairControl::Replay);
            let measure = of_states(task, &perturbed, &Tightening::none(&spec));
            if check(level) > 0.0 {
                certified += 1;
                assert!(measure > 0.0, "{task}, pair {i}: {measure} at level {level}");
            }
            // Some of those that fail are certified at a lower level: the drops that count are needed.
            tight += u64::from(measure <= 0.0 && check(0.5 * level) > 0.0);
        }
        println!("{task}: {certified} certified, {tight} that only half the level certifies");
        // Hardly a start fails to be in the target at some step.
        let telling = tight > 0 || task == cases()[3].task;
        assert!(certified > 50 && telling, "{task}: {certified} certified, {tight} tight");
    }
}

/// The score is the level at which a start ceases to be certified, whatever the task.
#[test]
fn a_start_is_certified_below_its_score_alone() {
    let shape = |a: f64, b: f64| (0..=HORIZON).map(|t| a + b * f64::from(t)).collect();
    let shapes = Shapes { target: shape(0.05, 0.01), constraint: shape(0.08, 0.005) };
    let spec = spec();
    for case in cases() {
        let (plant, mut positive) = (case.plant(), 0);
        for i in 0..300 {
            let margins = states_margins(&plant, &starts().start(i), &spec);
            let score = shapes.score(&margins);
            let check = |level| measure_of(&margins, &spec, &shapes.tightening(level));
            assert_eq!(score > 0.0, check(0.0) > 0.0, "{}, start {i}: {score}", case.task);
            if score > 0.0 {
                positive += 1;
                assert!(check(score * (1.0 - 1e-5)) > 0.0 && check(score * (1.0 + 1e-5)) <= 0.0);
            }
        }
        assert!(positive > 5, "{}: {positive} scores above 0", case.task);
    }
}

/// What a tube certifies of any task, no perturbation breaks; its measure is nowhere above theirs.
#[test]
fn what_a_tube_certifies_holds_of_every_perturbed_start() {
    let (spec, control) = (spec(), PairControl::Replay);
    let none = Tightening::none(&spec);
    let pairs = Pairs { radius: 0.02, ..pairs() };
    for case in cases() {
        let (plant, mut certified, mut refused) = (case.plant(), 0, 0);
        let tube = Tube::new(&plant, spec, control);
        for i in 0..400 {
            let both = pairs.pair(i);
            let nominal = tube.nominal(&both[0]);
            // A start of the pair lies within its radius up to f32.
            let below = tube.measure(&nominal, 0.0201);
            assert_eq!(tube.certifies(&nominal, 0.0201), below > 0.0, "{}, {i}", case.task);
            let lipschitz = tube.lipschitz_measure(&nominal, 0.0201);
            let states = stored(&plant, &both, control);
            for states in states.iter().filter(|states| !is_edge(states)) {
                let measure = of_states(case.task, states, &none);
                // What was lost has no size; it is no success.
                let sized = measure > f64::from(NON_FINITE);
                let most = if sized { measure + 1e-6 } else { 0.0 };
                assert!(
                    below.max(lipschitz) <= most,
                    "{}, {i}: {below} and {lipschitz}, not {measure}",
                    case.task
                );
                refused += u64::from(measure <= 0.0);
            }
            certified += u64::from(below > 0.0);
        }
        println!("{}: {certified} certified, {refused} rollouts fail", case.task);
        assert!(certified > 3 && refused > 3, "{}: {certified}, {refused}", case.task);
    }
}

/// What training ascends tends to the measure of the task as the temperature falls.
#[test]
fn the_softened_measure_tends_to_that_of_the_task() {
    let (spec, losses, temperature) = (spec(), losses(), 1e-4);
    for case in cases() {
        let (plant, mut compared) = (case.plant(), 0);
        let tape = measure_tape(
            &plant.model,
            Measured { spec: &spec, tightening: Some(&losses), unit: None },
        );
        for i in 0..200 {
            let states = states::<f64>(&plant, &starts().start(i), HORIZON);
            let wanted = of_states(case.task, &states, &losses);
            // Training has no rule for what is no number.
            let number = |(t, x): (u32, &Vec<f64>)| {
                let Seen { finite, target, constraint } = seen(x, t, [0.0; 2]);
                finite && !target.is_nan() && !constraint.is_nan()
            };
            if !(0..).zip(&states).all(number) {
                continue;
            }
            let mut values = Vec::new();
            tape.forward(&states.concat(), temperature, &mut values);
            let found = tape.read(&values).nth(1).expect("the tightened measure");
            assert!((found - wanted).abs() < 2e-3, "{}, {i}: {found}, not {wanted}", case.task);
            compared += 1;
        }
        assert!(compared > 20, "{}: {compared}", case.task);
    }
}

/// A critic that knows no time refuses a task whose steps differ, by name.
#[test]
fn a_critic_without_a_time_refuses_tasks_with_one() {
    let window = Window { from: 2, to: None };
    for task in [Task::AtEnd, Task::ReachStay { by: None }, Task::Reach(window)] {
        let found = Method::Ddpg.check_task(&task).expect_err("refused").to_string();
        let words = ["train.method", &format!("this task is `{task}`"), "`analytic`"];
        words.iter().for_each(|word| assert!(found.contains(word), "no `{word}` in: {found}"));
    }
    for task in [Task::default(), Task::Avoid, Task::Reach(Window::default())] {
        Method::Ddpg.check_task(&task).expect("timeless");
    }
    for method in [Method::Analytic, Method::Value, Method::ActionValue, Method::Ppo] {
        method.check_task(&Task::AtEnd).expect("any task");
    }
}

/// A rollout that stops once it is decided has the sign of the whole, and stops: the steps that it takes are
/// fewer than those of the measure.
#[test]
fn signs_end_with_the_window() {
    let lines = "kind = \"reach\"\nto = 2\n";
    let case = Case { task: Task::Reach(Window { from: 0, to: Some(2) }), lines };
    let (plant, spec) = (case.plant(), spec());
    let short = RolloutSpec::new(2, GAMMA).expect("a specification");
    for backend in backends() {
        let program = backend.prepare(&plant).expect("prepared");
        let all = |spec: RolloutSpec, query| {
            let tightening = Tightening::none(&spec);
            let task = ReachAvoidTask { spec, ..task_of(&tightening, query) };
            program
                .tally(&task, Keep::Measures)
                .expect("run")
                .finish(0..STARTS)
                .expect("all")
                .values
        };
        for query in [Query::Measure, Query::Sign] {
            assert_eq!(all(spec, query), all(short, query), "{query:?} on {}", backend.name());
        }
    }
}

#[test]
fn a_task_with_times_beyond_the_horizon_is_refused() {
    let lines = "kind = \"reach-stay\"\nby = 13\n";
    let plant = Case { task: Task::ReachStay { by: Some(13) }, lines }.plant();
    let backend = cpu(1);
    let program = backend.prepare(&plant).expect("prepared");
    let none = Tightening::none(&spec());
    let found = program.tally(&task_of(&none, Query::Measure), Keep::Counts).err();
    let found = found.expect("refused").to_string();
    let words = "model.task.by: step 13 lies beyond the horizon of 12 steps";
    assert!(found.contains(words), "{found}");
}

/// Whoever has another task has another text, and so other samples; the open reach-avoid task says nothing.
#[test]
fn a_task_is_part_of_what_a_certificate_hashes() {
    let mut texts: Vec<String> = cases().iter().map(|case| case.plant().text()).collect();
    assert!(!texts[0].contains("task") && texts[1].contains("// task reach-avoid from 3 to 8\n"));
    let count = texts.len();
    texts.sort();
    texts.dedup();
    assert_eq!(texts.len(), count);
}

mutants! {
    agree;
    a_constraint_that_need_not_hold: "(role & CONSTRAINT) != 0u" => "false";
    a_constraint_where_there_is_none: "(role & CONSTRAINT) != 0u" => "true";
    a_target_that_need_not_hold: "(role & REQUIREMENT) != 0u" => "false";
    a_chance_at_every_step: "(role & CHANCE) != 0u" => "true";
    a_conclusion_at_every_step: "(role & CONCLUSION) != 0u" => "true";
    no_conclusion: "(role & CONCLUSION) != 0u" => "false";
    a_task_that_never_ends: "(role & LIVE) == 0u" => "false";
    margins_that_count_at_every_step: "(role & marks) != 0u" => "true";
    perturbed_rollouts_without_a_role: "f32(u32(row.w) & ~MULTIPLIED)" => "14.0";
}
