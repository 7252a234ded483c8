//! A plant with points inside its periods, its trajectories integrated here and its tasks by their definitions.

use std::path::Path;

use reachcast::Error;
use reachcast::model::{Plant, Task, Window, text};
use reachcast::rollout::{
    NON_FINITE, PairControl, Pairs, Purpose, Region, RolloutSpec, Starts, Stream, Tightening,
};

/// Steps, substeps of each, seconds of a step, discount.
pub(crate) const HORIZON: u32 = 12;
pub(crate) const SUBSTEPS: usize = 8;
const PERIOD: f32 = 0.25;
const GAMMA: f32 = 0.9;
/// Starts of each comparison.
pub(crate) const STARTS: u64 = 1200;
/// Largest distance of f32 from f64.
pub(crate) const BAND: f64 = 2e-4;
/// Points inside a period that are tried.
pub(crate) const BETWEEN: [usize; 2] = [1, 3];
/// Where the state is lost, the target margin is no number, the constraint margin is no number.
const LOST: f32 = 1.2;
const NO_TARGET: f32 = -1.15;
const NO_CONSTRAINT: f32 = -1.5;

/// A point on an ellipse that it goes along in 13 steps, under a force that changes with the time.
pub(crate) const ELLIPSE: &str = r#"
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
pub(crate) const TARGET: &str = "target = \"0.1 + x + 0.3 * sin(2 * t) + 0 * sqrt(x + 1.15)\"\n";
pub(crate) const CONSTRAINT: &str =
    "constraint = \"1.2 + y - 0.2 * cos(step) + 0 * sqrt(y + 1.5)\"\n";
pub(crate) const POLICY: &str = "[policy]\nformula = { push = \"-0.3 * y + 0.05 * cos(t)\" }\n";

/// A task with its lines of text.
pub(crate) struct Case {
    pub(crate) task: Task,
    pub(crate) lines: &'static str,
    pub(crate) between: usize,
}

/// Every kind, with and without its times, with few and with many points.
pub(crate) fn cases() -> Vec<Case> {
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
    pub(crate) fn plant(&self) -> Plant {
        let target = if self.task == Task::Avoid { "" } else { TARGET };
        let constraint = if matches!(self.task, Task::Reach(_)) { "" } else { CONSTRAINT };
        let (lines, between) = (self.lines, self.between);
        let text = format!(
            "{ELLIPSE}[model.task]\n{lines}between = {between}\n{target}{constraint}{POLICY}"
        );
        plant(&text).expect("a plant")
    }

    pub(crate) fn name(&self) -> String {
        format!("{} with {} between", self.task, self.between)
    }
}

pub(crate) fn plant(text: &str) -> Result<Plant, Error> {
    let description = text::read(text, "ellipse.toml", Path::new("."))?;
    Ok(Plant::new(description.model()?, description.controller()?))
}

pub(crate) fn spec() -> RolloutSpec {
    RolloutSpec::new(HORIZON, GAMMA).expect("a specification")
}

/// Losses that differ from step to step and from each other.
pub(crate) fn losses() -> Tightening {
    let of = |first: f32, more: f32| (0..=HORIZON).map(|t| first + more * t as f32).collect();
    Tightening::losing(of(0.02, 0.01), of(0.05, 0.004))
}

pub(crate) fn starts_within(side: f32) -> Starts<'static> {
    let region = Region::new_box([-side; 2], [side; 2]).expect("a box");
    Starts::Drawn { region, stream: Stream::new(11, Purpose::USER, 0) }
}

pub(crate) fn starts() -> Starts<'static> {
    starts_within(1.0)
}

pub(crate) fn pairs() -> Pairs<'static> {
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
pub(crate) fn control([_, y]: [f64; 2], t: usize) -> f64 {
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
pub(crate) fn fine(start: &[f32]) -> Vec<[f64; 2]> {
    driven(start, control)
}

/// Those of a start whose first control is given.
pub(crate) fn fine_after(start: &[f32], push: f32) -> Vec<[f64; 2]> {
    driven(start, |x, t| if t == 0 { lit(push) } else { control(x, t) })
}

/// Those of both rollouts of a pair.
pub(crate) fn fine_pair(
    [nominal, perturbed]: &[Vec<f32>; 2],
    asked: PairControl,
) -> [Vec<[f64; 2]>; 2] {
    let along = fine(nominal);
    let beside = match asked {
        PairControl::Replay => driven(perturbed, |_, t| control(along[t * SUBSTEPS], t)),
        PairControl::ClosedLoop => fine(perturbed),
    };
    [along, beside]
}

/// A state that is looked at, by what the definitions need of it: its time in steps, and r and c as the formulas
/// say after their losses.
pub(crate) struct Seen {
    pub(crate) time: f64,
    pub(crate) finite: bool,
    pub(crate) target: f64,
    pub(crate) constraint: f64,
}

/// The states that are looked at, each with the number of its substeps.
pub(crate) fn looked(
    between: usize,
    states: &[[f64; 2]],
) -> impl Iterator<Item = (usize, [f64; 2])> {
    states.iter().copied().enumerate().step_by(SUBSTEPS / (between + 1))
}

/// The margins at a state after so many substeps, written from the text.
pub(crate) fn seen((substeps, [x, y]): (usize, [f64; 2]), losses: &Tightening) -> Seen {
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
    pub(crate) fn wanted(&self, states: &[[f64; 2]], losses: &Tightening) -> f64 {
        let seen: Vec<Seen> = looked(self.between, states).map(|at| seen(at, losses)).collect();
        brute_force(self.task, &seen)
    }
}

/// Whether f32 may see other numbers lost than f64.
pub(crate) fn is_edge(states: &[[f64; 2]]) -> bool {
    let near = |x: f64, edge: f32| (x - lit(edge)).abs() < BAND;
    let edge = |[x, y]: &[f64; 2]| near(*x, LOST) || near(*x, NO_TARGET) || near(*y, NO_CONSTRAINT);
    states.iter().any(edge)
}
