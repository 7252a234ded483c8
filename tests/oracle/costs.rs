//! A skiff as text whose plans have every kind of cost, and the same costs in f64, written from the
//! mathematics: references that move, maps that formulas ask, and what the end of a plan costs.

use std::path::Path;
use std::sync::Arc;

use reachcast::backend::Backend;
use reachcast::files::npy_bytes;
use reachcast::model::{Costs, StageCost, text};
use reachcast::rollout::{
    CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, Planning, Purpose, Sigma, Stream,
};

/// The skiff; its files are `goal.csv`, `ground.npy` and `ice.npy`.
pub(crate) const SKIFF: &str = r#"
[model]
name = "skiff"
[model.states]
x = { unit = "m", box = [-1.0, 1.0] }
y = { unit = "m", box = [-1.0, 1.0] }
heading = { unit = "rad", box = [-0.5, 0.5] }
[model.controls]
speed = { unit = "m/s", bounds = [-1.0, 3.0] }
turn = { unit = "rad/s", bounds = [-2.0, 2.0] }
[model.parameters]
drift = { unit = "m/s", value = 0.3 }
[model.let]
off = "hypot(x - goal_of_nobody, y)"
goal_of_nobody = "0.25 * drift"
[model.next]
x = "x + 0.1 * speed * cos(heading)"
y = "y + 0.1 * (speed * sin(heading) + drift)"
heading = "heading + 0.1 * turn"
[model.time]
period = 0.1
[model.task]
kind = "reach"
target = "0.5 - hypot(x, y)"
[model.costs]
stage.place = { weight = 2.0, formula = "(x - goal_x)^2 + (y - goal_y)^2 * (1 + ground(x, y))" }
stage.effort = { weight = -0.05, formula = "speed^2 + turn^2 - calm" }
stage.ice = { weight = 0.5, formula = "ice(y, x - goal_x)" }
stage.late = { weight = 0.125, formula = "t * off + 0.01 * step" }
terminal.place = { weight = 10.0, formula = "(x - goal_x)^2 + off + 0.1 * t * (y - goal_y)" }
terminal.ground = { weight = 3.0, formula = "ground(x, y) * (1 + 0.02 * step)" }
[model.references]
goal_x = { formula = "sin(0.5 * t) + 0.02 * step" }
goal_y = { file = "goal.csv" }
calm = { value = 0.3 }
[model.maps]
ground = { file = "ground.npy", origin = [-1.1, -0.7], cell = 0.25, outside = 4.0 }
ice = { file = "ice.npy", origin = [-2.1, -1.3], cell = 0.4 }
"#;

/// Rows of `goal.csv`: some plans end behind the last one.
const ROWS: usize = 20;
/// Rows and columns of the maps.
const GROUND: [usize; 2] = [9, 13];
const ICE: [usize; 2] = [7, 5];
/// Distance within which rounding may decide which cell a place is in, m.
const NEAR: f64 = 1e-5;

fn goal_y(row: usize) -> f32 {
    0.25 * (row as f32 % 7.0) - 0.5
}

fn ground(number: usize) -> f32 {
    0.2 * ((number * 37) % 41) as f32
}

fn ice(number: usize) -> f32 {
    0.5 * ((number * 11) % 23) as f32 - 1.0
}

/// Writes the files that the text names.
pub(crate) fn write_files(folder: &Path) {
    let rows: String = (0..ROWS).map(|row| format!("{}\n", goal_y(row))).collect();
    std::fs::write(folder.join("goal.csv"), format!("goal_y\n{rows}")).expect("a file");
    let write = |name: &str, shape: [usize; 2], cell: fn(usize) -> f32| {
        let cells: Vec<f32> = (0..shape[0] * shape[1]).map(cell).collect();
        std::fs::write(folder.join(name), npy_bytes(&cells, shape)).expect("a file");
    };
    write("ground.npy", GROUND, ground);
    write("ice.npy", ICE, ice);
}

/// Plans of `horizon` stages for the skiff, and its costs.
pub(crate) fn skiff(horizon: u32) -> (Planning, Costs) {
    let folder = tempfile::tempdir().expect("a folder");
    write_files(folder.path());
    let description = text::read(SKIFF, "skiff.toml", folder.path()).expect("a description");
    let (model, costs) = (description.model().expect("a model"), description.costs());
    let costs = costs.expect("costs that can be read").expect("costs");
    let settings = MppiSettings {
        temperature: 20.0,
        sigma: Sigma::PerControl(vec![0.8, 1.5]),
        ..MppiSettings::new(&model.controls, 130, horizon)
    };
    let planning = Planning {
        model: Arc::new(model),
        cost: Arc::new(costs.stage.clone()),
        spec: Arc::new(MppiSpec::new(settings).expect("settings")),
        value: None,
        disturbance: None,
    };
    (planning, costs)
}

/// What is outside, cells, where they begin, and how large they are, in f64.
struct Grid {
    outside: f64,
    cells: fn(usize) -> f32,
    shape: [usize; 2],
    origin: [f32; 2],
    side: f32,
}

impl Grid {
    /// What the map says at a place, found by comparing with the sides of its cells; `None` where
    /// rounding decides.
    fn at(&self, place: [f64; 2]) -> Option<f64> {
        let mut column_row = [None; 2];
        for axis in 0..2 {
            let from = place[axis] - f64::from(self.origin[axis]);
            let count = self.shape[1 - axis];
            let sides = (0..=count).map(|i| i as f64 * f64::from(self.side));
            if sides.clone().any(|side| (from - side).abs() < NEAR) {
                return None;
            }
            let below = sides.filter(|side| *side <= from).count();
            column_row[axis] = (1..=count).contains(&below).then(|| below - 1);
        }
        let [column, row] = column_row;
        let inside = column.zip(row).map(|(column, row)| row * self.shape[1] + column);
        Some(inside.map_or(self.outside, |number| f64::from((self.cells)(number))))
    }
}

/// What a sample costs in f64, stage by stage and at its end; `None` where rounding decides the cell of a
/// place.
pub(crate) fn truth(start: [f32; 3], controls: &[f32], first_step: u32) -> Option<f64> {
    let shared =
        Grid { outside: 4.0, cells: ground, shape: GROUND, origin: [-1.1, -0.7], side: 0.25 };
    let largest = (0..ICE[0] * ICE[1]).map(ice).fold(f32::MIN, f32::max);
    let slick = Grid {
        outside: f64::from(largest),
        cells: ice,
        shape: ICE,
        origin: [-2.1, -1.3],
        side: 0.4,
    };
    let (drift, tenth) = (f64::from(0.3_f32), f64::from(0.1_f32));
    let goals = |step: f64| {
        let x = (0.5 * step * tenth).sin() + f64::from(0.02_f32) * step;
        [x, f64::from(goal_y((step as usize).min(ROWS - 1)))]
    };
    let off = |x: f64, y: f64| (x - 0.25 * drift).hypot(y);
    let ([mut x, mut y, mut heading], mut total) = (start.map(f64::from), 0.0);
    let mut step = f64::from(first_step);
    for u in controls.as_chunks::<2>().0 {
        let ([speed, turn], [goal_x, goal_y]) = (u.map(f64::from), goals(step));
        total += 2.0 * ((x - goal_x).powi(2) + (y - goal_y).powi(2) * (1.0 + shared.at([x, y])?));
        total -= f64::from(0.05_f32) * (speed * speed + turn * turn - f64::from(0.3_f32));
        total += 0.5 * slick.at([y, x - goal_x])?;
        total += 0.125 * (step * tenth * off(x, y) + f64::from(0.01_f32) * step);
        x += tenth * speed * heading.cos();
        y += tenth * (speed * heading.sin() + drift);
        heading += tenth * turn;
        step += 1.0;
    }
    let [goal_x, goal_y] = goals(step);
    let lean = tenth * (step * tenth) * (y - goal_y);
    total += 10.0 * ((x - goal_x).powi(2) + off(x, y) + lean);
    Some(total + 3.0 * shared.at([x, y])? * (1.0 + f64::from(0.02_f32) * step))
}

/// Where problem `number` starts, and at which step.
pub(crate) fn start(number: usize) -> ([f32; 3], u32) {
    let starts = [([0.31, 0.23, 0.5], 0), ([1.83, 1.17, 0.1], 14), ([-0.93, -0.53, -2.3], 37)];
    starts[number]
}

/// The problem `number` of plans of `horizon` stages.
pub(crate) fn problem(costs: &Costs, horizon: u32, number: usize) -> MppiProblem {
    let ((start, first_step), stages) = (start(number), horizon as usize);
    let wave = |t: usize| (0.3 * (t + 5 * number) as f32).sin();
    let plan = (0..stages).flat_map(|t| [1.2 + 0.5 * wave(t), 1.5 * wave(2 * t)]).collect();
    let stream = Stream::new(11, Purpose::CONTROL_NOISE, number as u32);
    MppiProblem {
        start: start.to_vec(),
        plan,
        context: costs.contexts(first_step, stages),
        first_step,
        stream,
    }
}

/// What is wrong with the costs of the plans of `backend` against f64.
pub(crate) fn disagreement(backend: &Backend, horizon: u32) -> Result<(), String> {
    changed(backend, horizon, |_, _| {})
}

/// The same of plans and problems that `change` has changed, f64 has not.
pub(crate) fn changed(
    backend: &Backend,
    horizon: u32,
    change: impl Fn(&mut StageCost, &mut [MppiProblem]),
) -> Result<(), String> {
    let (mut planning, costs) = skiff(horizon);
    let mut cost = planning.cost.as_ref().clone();
    let mut problems: Vec<_> = (0..3).map(|number| problem(&costs, horizon, number)).collect();
    change(&mut cost, &mut problems);
    planning.cost = Arc::new(cost);
    let task = MppiTask { problems: &problems, iteration: 2, costs: CostQuery::Each };
    let program = backend.prepare_plans(&planning).map_err(|e| e.to_string())?;
    let results = program.improve(&task).map_err(|e| e.to_string())?;
    let (mut compared, mut worst) = (0, 0.0_f64);
    for (number, (result, problem)) in results.iter().zip(&problems).enumerate() {
        for (k, cost) in (0..).zip(&result.costs) {
            let controls = planning.controls(problem, 2, k);
            let Some(wanted) = truth(start(number).0, &controls, problem.first_step) else {
                continue;
            };
            let apart = (f64::from(*cost) - wanted).abs() / wanted.abs().max(1.0);
            // NaN is as far apart as can be.
            if apart.is_nan() || apart > 2e-5 {
                return Err(format!("problem {number}, sample {k}: {cost}, f64 {wanted}"));
            }
            (compared, worst) = (compared + 1, worst.max(apart));
        }
    }
    println!("{} H = {horizon}: {compared} samples, apart by {worst:.1e} at most", backend.name());
    if compared >= 360 { Ok(()) } else { Err(format!("{compared} samples compared alone")) }
}
