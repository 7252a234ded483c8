//! Points inside a period against brute force: each kind of task over fine trajectories integrated here, on every
//! backend, its signs, pairs, distances, margin drops, tubes; and what is refused.

mod common;

use std::path::Path;

use common::{adapter, backends};
use reachcast::Error;
use reachcast::backend::Backend;
use reachcast::backend::gpu::Gpu;
use reachcast::model::{Plant, Task, Window, text};
use reachcast::rollout::drops::Shapes;
use reachcast::rollout::replay::{self, measure_of, pair_margins, states_margins};
use reachcast::rollout::{
    DeviationTask, Keep, NON_FINITE, PairControl, Pairs, Purpose, Query, ReachAvoidTask, Region,
    RolloutSpec, Starts, States, Stream, Tightening,
};
use reachcast::scenario::sampling;
use reachcast::train::settings::Method;
use reachcast::train::soft::{Measured, measure_tape};
use reachcast::tube::Tube;

/// Steps, substeps of each, seconds of a step, discount.
const HORIZON: u32 = 12;
const SUBSTEPS: usize = 8;
const PERIOD: f32 = 0.25;
const GAMMA: f32 = 0.9;
/// Starts of each comparison.
const STARTS: u64 = 1200;
/// Largest distance of f32 from f64.
const BAND: f64 = 2e-4;
/// Points inside a period that are tried.
const BETWEEN: [usize; 2] = [1, 3];
/// Where the state is lost, the target margin is no number, the constraint margin is no number.
const LOST: f32 = 1.2;
const NO_TARGET: f32 = -1.15;
const NO_CONSTRAINT: f32 = -1.5;

/// A point on an ellipse that it goes along in 13 steps, under a force that changes with the time.
const ELLIPSE: &str = r#"
[model]
name = "ellipse"
[model.states]
x = { unit = "m", box = [-1.0, 1.0] }
y = { unit = "m", box = [-1.0, 1.0] }
[model.controls]
push = { unit = "m/s", bounds = [-0.2, 0.2] }
[model.flow]
x = "-1.5 * y + push * (1 + 0.5 * sin(3 * t)) + 0 * log(1.2 - x)"
y = "2.5 * x"
[model.time]
period = 0.25
integrator = "euler"
substeps = 8
"#;
const TARGET: &str = "target = \"0.1 + x + 0.3 * sin(2 * t) + 0 * sqrt(x + 1.15)\"\n";
const CONSTRAINT: &str = "constraint = \"1.2 + y - 0.2 * cos(step) + 0 * sqrt(y + 1.5)\"\n";
const POLICY: &str = "[policy]\nformula = { push = \"-0.3 * y + 0.05 * cos(t)\" }\n";

/// A task with its lines of text.
struct Case {
    task: Task,
    lines: &'static str,
    between: usize,
}

/// Every kind, with and without its times, with few and with many points.
fn cases() -> Vec<Case> {
    let window = |from, to| Window { from, to };
    let kinds = [
        (Task::ReachAvoid(window(0, None)), "kind = \"reach-avoid\"\n"),
        (Task::ReachAvoid(window(3, Some(8))), "kind = \"reach-avoid\"\nfrom = 3\nto = \"2 s\"\n"),
        (Task::Avoid, "kind = \"avoid\"\n"),
        (Task::Reach(window(2, Some(3))), "kind = \"reach\"\nfrom = \"0.5 s\"\nto = 3\n"),
        (Task::Reach(window(4, Some(4))), "kind = \"reach\"\nfrom = 4\nto = 4\n"),
        (Task::ReachStay { by: Some(10) }, "kind = \"reach-stay\"\nby = \"2.5 s\"\n"),
        (Task::ReachStay { by: None }, "kind = \"reach-stay\"\n"),
        (Task::AtEnd, "kind = \"at-end\"\n"),
    ];
    let of = |between| kinds.map(|(task, lines)| Case { task, lines, between });
    BETWEEN.into_iter().flat_map(of).collect()
}

impl Case {
    fn plant(&self) -> Plant {
        let target = if self.task == Task::Avoid { "" } else { TARGET };
        let constraint = if matches!(self.task, Task::Reach(_)) { "" } else { CONSTRAINT };
        let (lines, between) = (self.lines, self.between);
        let text = format!(
            "{ELLIPSE}[model.task]\n{lines}between = {between}\n{target}{constraint}{POLICY}"
        );
        plant(&text).expect("a plant")
    }

    fn name(&self) -> String {
        format!("{} with {} between", self.task, self.between)
    }
}

fn plant(text: &str) -> Result<Plant, Error> {
    let description = text::read(text, "ellipse.toml", Path::new("."))?;
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

fn starts_within(side: f32) -> Starts<'static> {
    let region = Region::new_box([-side; 2], [side; 2]).expect("a box");
    Starts::Drawn { region, stream: Stream::new(11, Purpose::USER, 0) }
}

fn starts() -> Starts<'static> {
    starts_within(1.0)
}

fn pairs() -> Pairs<'static> {
    Pairs { nominal: starts(), radius: 0.1, stream: Stream::new(11, Purpose::USER, 1) }
}

/// A number of the text as every replay has it.
fn lit(number: f32) -> f64 {
    f64::from(number)
}

/// The seconds after so many substeps of step `t`.
fn seconds(t: usize, substep: usize) -> f64 {
    lit(PERIOD) * (t as f64 + substep as f64 / SUBSTEPS as f64)
}

/// The control at a sample, as the policy has it and within its bounds.
fn control([_, y]: [f64; 2], t: usize) -> f64 {
    (-lit(0.3) * y + lit(0.05) * seconds(t, 0).cos()).clamp(-lit(0.2), lit(0.2))
}

/// The state a substep later: explicit Euler.
fn substep([x, y]: [f64; 2], push: f64, time: f64) -> [f64; 2] {
    let h = lit(PERIOD) / SUBSTEPS as f64;
    let lost = if x < lit(LOST) { 0.0 } else { f64::NAN };
    let slope = -1.5 * y + push * (1.0 + 0.5 * (3.0 * time).sin()) + lost;
    [x + h * slope, y + h * 2.5 * x]
}

/// The states after every substep, those of step t under the control of `driver` at t.
fn driven(start: &[f32], driver: impl Fn([f64; 2], usize) -> f64) -> Vec<[f64; 2]> {
    let mut x = [lit(start[0]), lit(start[1])];
    let mut all = vec![x];
    for t in 0..HORIZON as usize {
        let push = driver(x, t);
        for i in 0..SUBSTEPS {
            x = substep(x, push, seconds(t, i));
            all.push(x);
        }
    }
    all
}

/// The states of a start after every substep.
fn fine(start: &[f32]) -> Vec<[f64; 2]> {
    driven(start, control)
}

/// Those of both rollouts of a pair.
fn fine_pair([nominal, perturbed]: &[Vec<f32>; 2], asked: PairControl) -> [Vec<[f64; 2]>; 2] {
    let along = fine(nominal);
    let beside = match asked {
        PairControl::Replay => driven(perturbed, |_, t| control(along[t * SUBSTEPS], t)),
        PairControl::ClosedLoop => fine(perturbed),
    };
    [along, beside]
}

/// A state that is looked at, by what the definitions need of it: its time in steps, and r and c as the formulas
/// say after their losses.
struct Seen {
    time: f64,
    finite: bool,
    target: f64,
    constraint: f64,
}

/// The states that are looked at, each with the number of its substeps.
fn looked(between: usize, states: &[[f64; 2]]) -> impl Iterator<Item = (usize, [f64; 2])> {
    states.iter().copied().enumerate().step_by(SUBSTEPS / (between + 1))
}

/// The margins at a state after so many substeps, written from the text.
fn seen((substeps, [x, y]): (usize, [f64; 2]), losses: &Tightening) -> Seen {
    let (t, part) = (substeps / SUBSTEPS, substeps % SUBSTEPS);
    let target = lit(0.1) + x + lit(0.3) * (2.0 * seconds(t, part)).sin();
    let constraint = lit(1.2) + y - lit(0.2) * (t as f64).cos();
    let or_lost = |number: f64, lost: bool| if lost { f64::NAN } else { number };
    // What is lost inside a period is what the sample after it loses.
    let sample = substeps.div_ceil(SUBSTEPS);
    Seen {
        time: substeps as f64 / SUBSTEPS as f64,
        finite: x.is_finite() && y.is_finite(),
        target: or_lost(target, x < lit(NO_TARGET)) - lit(losses.target[sample]),
        constraint: or_lost(constraint, y < lit(NO_CONSTRAINT)) - lit(losses.constraint[sample]),
    }
}

/// The measure of a trajectory by the definition of its task.
fn brute_force(task: Task, seen: &[Seen]) -> f64 {
    let end = f64::from(HORIZON);
    let discounted =
        |at: &Seen, margin: f64| f64::from(GAMMA).powi(at.time.floor() as i32) * margin;
    let safe_until = |time: f64| {
        let before = seen.iter().filter(|at| at.time <= time);
        before.map(|at| discounted(at, at.constraint)).fold(1e30, f64::min)
    };
    let target_within = |from: f64, to: f64| {
        seen.iter()
            .filter(move |at| (from..=to).contains(&at.time))
            .map(|at| (at.time, discounted(at, at.target)))
    };
    // When a number that counts is none for the first time.
    let lost = |from: f64, to: f64, constraint: bool| {
        let broken = |at: &&Seen| {
            let counts = (from..=to).contains(&at.time);
            !at.finite || (counts && at.target.is_nan()) || (constraint && at.constraint.is_nan())
        };
        seen.iter().find(broken).map_or(f64::INFINITY, |at| at.time)
    };
    let chosen = |window: Window, constrained: bool| {
        let [from, to] = [window.from, window.to.unwrap_or(HORIZON)].map(f64::from);
        let lost = lost(from, to, constrained);
        let held = |(time, r): (f64, f64)| if constrained { safe_until(time).min(r) } else { r };
        let before = target_within(from, to).filter(|(time, _)| *time < lost);
        let best = before.map(held).fold(-1e30, f64::max);
        if best <= 0.0 && lost <= to { f64::from(NON_FINITE) } else { best }
    };
    let always = |by: f64| match lost(by, end, true) {
        f64::INFINITY => target_within(by, end).fold(safe_until(end), |least, (_, r)| least.min(r)),
        _ => f64::from(NON_FINITE),
    };
    match task {
        Task::ReachAvoid(window) => chosen(window, true),
        Task::Reach(window) => chosen(window, false),
        Task::Avoid => always(end + 1.0),
        Task::ReachStay { by } => always(f64::from(by.unwrap_or(HORIZON))),
        Task::AtEnd => always(end),
    }
}

impl Case {
    /// The measure of states after every substep.
    fn wanted(&self, states: &[[f64; 2]], losses: &Tightening) -> f64 {
        let seen: Vec<Seen> = looked(self.between, states).map(|at| seen(at, losses)).collect();
        brute_force(self.task, &seen)
    }
}

/// Whether f32 may see other numbers lost than f64.
fn is_edge(states: &[[f64; 2]]) -> bool {
    let near = |x: f64, edge: f32| (x - lit(edge)).abs() < BAND;
    let edge = |[x, y]: &[f64; 2]| near(*x, LOST) || near(*x, NO_TARGET) || near(*y, NO_CONSTRAINT);
    states.iter().any(edge)
}

/// Requires `found` to be `wanted` up to f32.
fn close(found: f32, wanted: f64, about: &str) -> Result<(), String> {
    let near = (f64::from(found) - wanted).abs() <= BAND * wanted.abs().max(1.0);
    near.then_some(()).ok_or_else(|| format!("{about}: {found}, not {wanted}"))
}

fn task_of<'a>(tightening: &'a Tightening, query: Query) -> ReachAvoidTask<'a> {
    ReachAvoidTask { starts: starts(), range: 0..STARTS, spec: spec(), tightening, query }
}

/// The measures or signs of all starts.
fn found(backend: &Backend, plant: &Plant, query: Query) -> Result<Vec<f32>, String> {
    let losses = losses();
    let program = backend.prepare(plant).map_err(|e| e.to_string())?;
    let tally = program.tally(&task_of(&losses, query), Keep::Measures);
    let found = tally.and_then(|tally| tally.finish(0..STARTS));
    found.map(|found| found.values).map_err(|e| e.to_string())
}

/// Whether measures and signs of a task on `backend` are those of its definition.
fn measures_agree(backend: &Backend, case: &Case) -> Result<(), String> {
    let (plant, losses) = (case.plant(), losses());
    let measures = found(backend, &plant, Query::Measure)?;
    let signs = found(backend, &plant, Query::Sign)?;
    let (mut edges, mut successes) = (0, 0);
    for (i, (measure, sign)) in measures.into_iter().zip(signs).enumerate() {
        let about = format!("{}, start {i}, {}", case.name(), backend.name());
        if (measure > 0.0) != (sign > 0.0) {
            return Err(format!("{about}: measure {measure}, sign {sign}"));
        }
        let states = fine(&starts().start(i as u64));
        if is_edge(&states) {
            edges += 1;
            continue;
        }
        let wanted = case.wanted(&states, &losses);
        successes += u64::from(wanted > 0.0);
        close(measure, wanted, &about)?;
    }
    let share = successes as f64 / STARTS as f64;
    println!("{} on {}: {successes} succeed, {edges} at an edge", case.name(), backend.name());
    let telling = edges < 60 && (0.01..0.99).contains(&share);
    telling.then_some(()).ok_or_else(|| format!("{}: {share} succeed, {edges}", case.name()))
}

/// Whether both measures of pairs on `backend` are those of the definition.
fn pairs_agree(backend: &Backend, case: &Case, control: PairControl) -> Result<(), String> {
    let (plant, losses) = (case.plant(), losses());
    let (pairs, spec, range) = (pairs(), spec(), 0..STARTS / 5);
    let (tightening, range_of) = (&losses, range.clone());
    let asked = DeviationTask { pairs: pairs.clone(), range: range_of, spec, tightening, control };
    let program = backend.prepare(&plant).map_err(|e| e.to_string())?;
    let mut found = Vec::new();
    let mut sink = |_, pairs: &[_]| {
        found.extend_from_slice(pairs);
        Ok(())
    };
    program.deviation(&asked, &mut sink).map_err(|e| e.to_string())?;
    for (i, pair) in range.zip(found) {
        let [nominal, perturbed] = fine_pair(&pairs.pair(i), control);
        if is_edge(&nominal) || is_edge(&perturbed) {
            continue;
        }
        let about = format!("{}, pair {i}, {control:?}, {}", case.name(), backend.name());
        close(pair.nominal, case.wanted(&nominal, &losses), &about)?;
        close(pair.perturbed, case.wanted(&perturbed, &Tightening::none(&spec)), &about)?;
    }
    Ok(())
}

/// The distance of a pair at each step: the largest of its sample and of the points before it.
fn apart(between: usize, [along, beside]: &[Vec<[f64; 2]>; 2]) -> Vec<f64> {
    let mut most = vec![0.0_f64; HORIZON as usize + 1];
    for ((substeps, x), (_, y)) in looked(between, along).zip(looked(between, beside)) {
        let distance = (x[0] - y[0]).hypot(x[1] - y[1]);
        let most = &mut most[substeps.div_ceil(SUBSTEPS)];
        *most = distance.max(*most);
    }
    most
}

/// Whether the distances on `backend` are those of fine trajectories, pair by pair.
fn distances_agree(backend: &Backend, between: usize, asked: PairControl) -> Result<(), String> {
    let case = Case { task: Task::AtEnd, lines: "kind = \"at-end\"\n", between };
    let (plant, spec) = (case.plant(), spec());
    let none = Tightening::none(&spec);
    // Far from where anything is lost.
    let pairs = Pairs { nominal: starts_within(0.5), ..pairs() };
    let program = backend.prepare(&plant).map_err(|e| e.to_string())?;
    let mut inside = 0;
    for i in 0..30 {
        let (tightening, pairs_of) = (&none, pairs.clone());
        let task =
            DeviationTask { pairs: pairs_of, range: i..i + 1, spec, tightening, control: asked };
        let found = program.deviation(&task, &mut |_, _| Ok(())).map_err(|e| e.to_string())?;
        let states = fine_pair(&pairs.pair(i), asked);
        let (wanted, samples) = (apart(between, &states), apart(0, &states));
        for (t, (found, wanted)) in found.into_iter().zip(&wanted).enumerate() {
            let about = format!("{between} between, pair {i}, step {t}, {}", backend.name());
            close(found.distance, *wanted, &about)?;
            if found.pair != i {
                return Err(format!("{about}: found at pair {}", found.pair));
            }
            inside += u64::from(*wanted > samples[t] + BAND);
        }
    }
    let telling = inside > 10;
    telling.then_some(()).ok_or_else(|| format!("{inside} distances are largest inside"))
}

fn agree(backend: &Backend) -> Result<(), String> {
    for case in cases() {
        measures_agree(backend, &case)?;
        pairs_agree(backend, &case, PairControl::Replay)?;
        pairs_agree(backend, &case, PairControl::ClosedLoop)?;
    }
    for between in BETWEEN {
        distances_agree(backend, between, PairControl::Replay)?;
        distances_agree(backend, between, PairControl::ClosedLoop)?;
    }
    Ok(())
}

#[test]
fn every_kind_is_its_definition_on_every_backend() {
    for backend in backends() {
        agree(&backend).unwrap_or_else(|problem| panic!("{problem}"));
    }
}

/// Requires f64 to be the brute force up to the rounding of literals to f32.
fn near(found: f64, wanted: f64) -> bool {
    (found - wanted).abs() <= 1e-5 * wanted.abs().max(1.0)
}

#[test]
fn every_kind_is_its_definition_in_f64() {
    let (spec, losses, mut inside) = (spec(), losses(), 0);
    for case in cases() {
        let (plant, name) = (case.plant(), case.name());
        assert_eq!((plant.model.task, plant.model.points), (case.task, case.between as u32 + 1));
        for i in 0..STARTS {
            let start = starts().start(i);
            let states = fine(&start);
            let found = replay::measure(&plant, &start, &spec, &losses);
            let wanted = case.wanted(&states, &losses);
            assert!(near(found, wanted), "{name}, start {i}: {found}, not {wanted}");
            let samples = Case { between: 0, ..case };
            inside += u64::from((samples.wanted(&states, &losses) > 0.0) != (wanted > 0.0));
        }
        for control in [PairControl::Replay, PairControl::ClosedLoop] {
            for i in 0..STARTS / 10 {
                let both = pairs().pair(i);
                let of = [&*both[0], &*both[1]];
                let (nominal, perturbed) =
                    replay::pair_measures(&plant, of, &spec, &losses, control);
                let [along, beside] = fine_pair(&both, control);
                let wanted = case.wanted(&along, &losses);
                assert!(near(nominal, wanted), "{name}, pair {i}: {nominal}, not {wanted}");
                let wanted = case.wanted(&beside, &Tightening::none(&spec));
                assert!(near(perturbed, wanted), "{name}, pair {i}: {perturbed}, not {wanted}");
            }
        }
    }
    println!("{inside} starts succeed by their samples alone or not at all");
    assert!(inside > 100, "{inside}");
}

/// The samples of a rollout are those of the model without points.
#[test]
fn samples_are_those_of_the_whole_step() {
    let case = &cases()[0];
    let whole = |between: usize| Case { between, ..*case }.plant();
    for (i, plant) in BETWEEN.map(whole).iter().enumerate() {
        let start = starts().start(i as u64);
        let states = fine(&start);
        let samples = replay::states::<f64>(plant, &start, HORIZON);
        let looks = replay::looks::<f64>(plant, &start, HORIZON);
        assert_eq!(looks.len(), plant.model.looks(HORIZON));
        for (t, x) in samples.iter().enumerate() {
            assert_eq!(*x, looks[t * plant.model.points as usize]);
            let wanted = states[t * SUBSTEPS];
            assert!(near(x[0], wanted[0]) && near(x[1], wanted[1]), "{x:?}, not {wanted:?}");
        }
    }
}

/// The proof of margin drops, pair by pair: a pair whose drops are at most lambda, and whose nominal start is
/// certified at lambda, succeeds.
#[test]
fn a_nominal_start_certified_at_the_drop_of_its_pair_has_a_perturbed_one_that_succeeds() {
    let shape = |a: f64, b: f64| (0..=HORIZON).map(|t| a + b * f64::from(t)).collect();
    let sets = [[0.03, 0.3], [0.3, 0.03]].map(|[target, constraint]| Shapes {
        target: shape(target, 0.001),
        constraint: shape(constraint, 0.002),
    });
    let (spec, pairs) = (spec(), pairs());
    for case in cases() {
        let (plant, name) = (case.plant(), case.name());
        let (mut certified, mut tight) = (0, 0);
        for i in 0..6 * STARTS {
            let shapes = &sets[(i % 2) as usize];
            let both = pairs.pair(i);
            let margins = pair_margins(&plant, [&*both[0], &*both[1]], &spec, PairControl::Replay);
            let level = shapes.largest(&margins).max(0.0);
            if level == f64::INFINITY {
                continue;
            }
            let check = |level| measure_of(&margins.nominal, &spec, &shapes.tightening(level));
            let [_, perturbed] = fine_pair(&both, PairControl::Replay);
            let measure = case.wanted(&perturbed, &Tightening::none(&spec));
            if check(level) > 0.0 {
                certified += 1;
                assert!(measure > 0.0, "{name}, pair {i}: {measure} at level {level}");
            }
            tight += u64::from(measure <= 0.0 && check(0.5 * level) > 0.0);
        }
        println!("{name}: {certified} certified, {tight} that only half the level certifies");
        assert!(certified > 50 && tight > 0, "{name}: {certified} certified, {tight} tight");
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
            assert_eq!(score > 0.0, check(0.0) > 0.0, "{}, start {i}: {score}", case.name());
            if score > 0.0 {
                positive += 1;
                assert!(check(score * (1.0 - 1e-5)) > 0.0 && check(score * (1.0 + 1e-5)) <= 0.0);
            }
        }
        assert!(positive > 5, "{}: {positive} scores above 0", case.name());
    }
}

/// What a tube certifies no perturbation breaks, and its measure is nowhere above theirs; its sets hold every
/// state that is looked at.
#[test]
fn what_a_tube_certifies_holds_of_every_perturbed_start() {
    let spec = spec();
    let none = Tightening::none(&spec);
    let pairs = Pairs { radius: 0.02, ..pairs() };
    for (case, control) in
        cases().iter().zip([PairControl::Replay, PairControl::ClosedLoop].into_iter().cycle())
    {
        let (plant, name) = (case.plant(), case.name());
        let (mut certified, mut refused, mut by_constants) = (0, 0, 0);
        let tube = Tube::new(&plant, spec, control);
        for i in 0..300 {
            let both = pairs.pair(i);
            let nominal = tube.nominal(&both[0]);
            // A start of the pair lies within its radius up to f32.
            let below = tube.measure(&nominal, 0.0201);
            assert_eq!(tube.certifies(&nominal, 0.0201), below > 0.0, "{name}, {i}");
            let lipschitz = tube.lipschitz_measure(&nominal, 0.0201);
            let sides = tube.states(&nominal, 0.0201);
            let states = fine_pair(&both, control);
            for states in states.iter().filter(|states| !is_edge(states)) {
                for ((substeps, x), sides) in looked(case.between, states).zip(&sides) {
                    for (x, side) in x.iter().zip(sides) {
                        let held = side.low - 1e-6 <= *x && *x <= side.high + 1e-6;
                        assert!(held, "{name}, {i}, {substeps}: {x} outside of {side:?}");
                    }
                }
                let measure = case.wanted(states, &none);
                let sized = measure > f64::from(NON_FINITE);
                let most = if sized { measure + 1e-6 } else { 0.0 };
                assert!(
                    below.max(lipschitz) <= most,
                    "{name}, {i}: {below} and {lipschitz}, not {measure}"
                );
                refused += u64::from(measure <= 0.0);
            }
            certified += u64::from(below > 0.0);
            by_constants += u64::from(lipschitz > 0.0);
        }
        println!("{name}: {certified} certified, {by_constants} by constants, {refused} fail");
        assert!(certified > 3 && refused > 3, "{name}: {certified}, {refused}");
    }
}

/// What training ascends tends to the measure of the task as the temperature falls.
#[test]
fn the_softened_measure_tends_to_that_of_the_task() {
    let (spec, losses, temperature) = (spec(), losses(), 1e-4);
    for case in cases() {
        let (plant, mut compared) = (case.plant(), 0);
        let (spec, tightening, unit) = (&spec, Some(&losses), None);
        let tape = measure_tape(&plant.model, Measured { spec, tightening, unit });
        for i in 0..100 {
            let states = fine(&starts().start(i));
            let wanted = case.wanted(&states, &losses);
            let looks: Vec<(usize, [f64; 2])> = looked(case.between, &states).collect();
            // Training has no rule for what is no number.
            let number = |at: &(usize, [f64; 2])| {
                let Seen { finite, target, constraint, .. } = seen(*at, &losses);
                finite && !target.is_nan() && !constraint.is_nan()
            };
            if !looks.iter().all(number) {
                continue;
            }
            let numbers: Vec<f64> = looks.iter().flat_map(|(_, x)| *x).collect();
            let mut values = Vec::new();
            tape.forward(&numbers, temperature, &mut values);
            let found = tape.read(&values).nth(1).expect("the tightened measure");
            assert!((found - wanted).abs() < 2e-3, "{}, {i}: {found}, not {wanted}", case.name());
            compared += 1;
        }
        assert!(compared > 20, "{}: {compared}", case.name());
    }
}

/// A body that goes 1 m/s, and a wall of 0.1 m across its way.
fn walled(task: &str) -> Plant {
    let text = format!(
        r#"
[model]
name = "wall"
[model.states]
x = {{ unit = "m", box = [0.0, 0.1] }}
y = {{ unit = "m", box = [0.0, 1.0] }}
[model.controls]
push = {{ unit = "m/s", bounds = [-1.0, 1.0] }}
[model.flow]
x = "push"
y = "0"
[model.time]
period = 0.5
integrator = "euler"
substeps = 10
[model.task]
kind = "avoid"
constraint = "abs(x - 0.25) - 0.05"
{task}
[policy]
formula = {{ push = "1" }}
"#
    );
    plant(&text).expect("a plant")
}

#[test]
fn a_thin_wall_is_jumped_without_points_and_seen_with_them() {
    let starts = [[0.05_f32, 0.0], [0.08, 0.5]];
    let spec = RolloutSpec::new(2, 1.0).expect("a specification");
    for (task, succeeds) in [("", true), ("between = 4", false), ("between = 1", true)] {
        let plant = walled(task);
        for backend in backends() {
            let program = backend.prepare(&plant).expect("prepared");
            let measures = program.measures(&starts, &spec).expect("run");
            for (x, measure) in starts.iter().zip(measures) {
                assert_eq!(measure > 0.0, succeeds, "{x:?}, `{task}`: {measure}");
                let in_f64 = replay::measure(&plant, x, &spec, &Tightening::none(&spec));
                assert_eq!(in_f64 > 0.0, succeeds, "{x:?}, `{task}`: {in_f64}");
            }
        }
        let words = sampling::sampling(&plant, States::from(&starts), 2).join(" ");
        let expected = match task {
            "" => ["only at the samples,", "moves up to 0.5001 m in a step"],
            "between = 1" => ["at 1 further point of each period,", "moves up to 0.25"],
            _ => ["at 4 further points of each period,", "m from one to the next"],
        };
        for part in expected {
            assert!(words.contains(part), "no `{part}` in: {words}");
        }
    }
}

#[test]
fn points_that_there_cannot_be_are_refused() {
    let with = |lines: &str| {
        let text =
            format!("{ELLIPSE}[model.task]\nkind = \"avoid\"\n{lines}\n{CONSTRAINT}{POLICY}");
        plant(&text).map(|plant| plant.model.points)
    };
    assert_eq!(with("between = 7").expect("all substeps"), 8);
    for (lines, words) in [
        ("between = 0", "model.task.between: 0; expected a number of points"),
        ("between = -1", "model.task.between: -1; expected a number of points"),
        ("between = 2", "cut a period into 3 parts, and 8 substeps cannot be shared evenly"),
        ("between = 15", "take a multiple of 16 for `model.time.substeps`"),
        ("between = 4294967295", "4294967295; expected a number of points"),
        ("between = 1.5", "expected a whole number"),
    ] {
        let found = with(lines).expect_err(words).to_string();
        assert!(found.contains(words), "no `{words}` in: {found}");
    }
    let next = ELLIPSE
        .replace("[model.flow]", "[model.next]")
        .replace("integrator = \"euler\"\nsubsteps = 8\n", "");
    let text = format!("{next}[model.task]\nkind = \"avoid\"\nbetween = 1\n{CONSTRAINT}{POLICY}");
    let found = plant(&text).expect_err("refused").to_string();
    assert!(
        found.contains("model.task.between: points inside a period need `model.flow`"),
        "{found}"
    );
}

/// A method that looks at samples alone refuses points by name.
#[test]
fn methods_that_look_at_samples_alone_refuse_points() {
    for method in [Method::ActionValue, Method::Ddpg, Method::Ppo] {
        method.check_points(1).expect("samples");
        let found = method.check_points(4).expect_err("refused").to_string();
        let words = ["train.method", method.name(), "at 3 points", "`analytic`"];
        words.iter().for_each(|word| assert!(found.contains(word), "no `{word}` in: {found}"));
    }
    for method in [Method::Analytic, Method::Value] {
        method.check_points(4).expect("any model");
    }
}

/// Whoever looks at other points has another text, and so other samples.
#[test]
fn points_are_part_of_what_a_certificate_hashes() {
    let text = |between: &str| walled(between).text();
    assert!(!text("").contains("between"));
    assert!(text("between = 4").contains("// between 4\n"));
    assert_ne!(text("between = 4"), text("between = 9"));
}

/// A trajectory that leaves its lane for another takes its time along: signs of plants whose dynamics and policy
/// read the time are those of their measures.
#[test]
fn signs_of_plants_that_change_with_the_time_are_those_of_measures() {
    let lines = "kind = \"reach-avoid\"\n";
    let text = format!("{ELLIPSE}[model.task]\n{lines}{TARGET}{CONSTRAINT}{POLICY}");
    let plant = plant(&text.replace("0.5 * sin(3 * t)", "5 * sin(3 * t)")).expect("a plant");
    for backend in backends() {
        let of = |query| found(&backend, &plant, query).expect("run");
        let signs: Vec<bool> = of(Query::Sign).iter().map(|sign| *sign > 0.0).collect();
        let measures: Vec<bool> = of(Query::Measure).iter().map(|measure| *measure > 0.0).collect();
        assert_eq!(signs, measures, "{}", backend.name());
    }
}

/// Requires that a kernel in which `old` is replaced by `new` is noticed.
fn caught(old: &'static str, new: &'static str) {
    let Some(gpu) = adapter() else { return };
    let seen = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let found = seen.clone();
    let gpu: Gpu = gpu.with_shader_edit(move |text| {
        found.fetch_or(text.contains(old), std::sync::atomic::Ordering::Relaxed);
        text.replace(old, new)
    });
    let problem = agree(&Backend::Gpu(gpu)).expect_err("a broken rule is noticed");
    assert!(seen.load(std::sync::atomic::Ordering::Relaxed), "no kernel has `{old}`");
    println!("{problem}");
}

macro_rules! mutants {
    ($($name:ident: $old:expr => $new:expr;)*) => {
        $(
            #[test]
            fn $name() {
                caught($old, $new);
            }
        )*
    };
}

mutants! {
    a_point_left_out: "point < POINTS; point += 1u" => "point + 1u < POINTS; point += 1u";
    points_with_the_row_of_their_sample: "schedule[2u * t + 1u]" => "schedule[2u * t]";
    points_with_the_row_of_the_next_sample: "schedule[2u * t + 1u]" => "schedule[2u * t + 2u]";
    points_at_the_time_of_their_sample: "shares[t % POINTS]" => "0.0";
    points_at_the_number_of_the_next_sample: "f32(t / POINTS))" => "f32(t / POINTS + min(t % POINTS, 1u)))";
    parts_that_begin_late: "moment + point - 1u" => "moment + point";
    pairs_whose_parts_begin_late: "at - 1u" => "at";
    distances_of_samples_alone: "max(farthest_between, gap(nominal, perturbed))" => "0.0";
    distances_of_the_last_point_alone: "max(farthest_between, gap(nominal, perturbed))" => "gap(nominal, perturbed)";
    perturbed_rollouts_that_are_not_looked_at: "judge(perturbed_fold, perturbed, at, without_loss(between))" => "perturbed_fold";
}
