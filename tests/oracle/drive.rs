//! A differential drive on a small cost map: plans that cross its cells and its borders.

use reachcast::backend::Backend;
use reachcast::cost::{CostMap, GoalCost, Grid};
use reachcast::rollout::{
    CostQuery, MppiProblem, MppiSettings, MppiSpec, MppiTask, Purpose, Sigma, Stream,
};
use reachcast::system::DiffDrive;

use super::oracle::{differences, truth};

/// Steps of a plan.
const HORIZON: u32 = 37;

/// Columns and rows: not alike, and unlike every other number of the formulas.
const SIZE: [usize; 2] = [13, 9];

/// A fast drive: its samples cross several cells, and some leave the map.
fn system() -> DiffDrive {
    DiffDrive { speed: [-1.0, 3.0], turn_rate: 4.0, ..DiffDrive::default() }
}

/// Cells whose costs differ from those of their neighbours.
fn cost() -> GoalCost {
    let grid = Grid { origin: [-1.1, -0.7], resolution: 0.25, size: SIZE };
    let costs: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(|i| 0.2 * ((i * 37) % 41) as f32).collect();
    let map = CostMap::new(grid, &costs, 2.5).expect("a map");
    GoalCost { distance: 1.5, angle: 2.5, map }
}

/// A problem that starts in the middle of the map, or on its way across a border.
fn problem(number: u32) -> MppiProblem<3, 2, 3> {
    let starts = [[0.31, 0.23, 0.5], [1.83, 1.17, 0.1], [0.63, 1.31, 1.5], [-0.93, -0.53, -2.3]];
    let start = starts[number as usize];
    let wave = |t: u32| (0.3 * (t + 5 * number) as f32).sin();
    MppiProblem {
        start,
        plan: (0..HORIZON).map(|t| [1.2 + 0.5 * wave(t), 1.5 * wave(2 * t)]).collect(),
        context: (0..HORIZON).map(|t| [1.5 + 0.1 * wave(t), 0.4, 3.0 - 0.05 * t as f32]).collect(),
        stream: Stream::new(11, Purpose::CONTROL_NOISE, number),
    }
}

/// What is wrong with the plans of `backend`, against f64 and, for an adapter, against `host`.
pub(crate) fn disagreement(backend: &Backend, host: &Backend) -> Result<(), String> {
    let (system, cost) = (system(), cost());
    let settings = MppiSettings {
        temperature: 20.0,
        sigma: Sigma::PerControl([0.8, 2.0]),
        noise_cost: true,
        ..MppiSettings::new(&system, 70, HORIZON)
    };
    let spec = MppiSpec::new(settings).expect("settings");
    let problems: Vec<_> = (0..4).map(problem).collect();
    let task = MppiTask {
        spec: &spec,
        problems: &problems,
        iteration: 2,
        value: None,
        disturbance: None,
        costs: CostQuery::Each,
    };
    let run = |backend: &Backend| backend.mppi(&system, &cost, &task).map_err(|e| e.to_string());
    let scales = (settings.temperature, settings.bounds);
    for (number, (result, host)) in run(backend)?.iter().zip(&run(host)?).enumerate() {
        let truth = truth((&system, &cost), &task, number);
        let largest = truth.costs.iter().copied().fold(1.0, f64::max);
        for (cost, truth) in host.costs.iter().zip(&truth.costs) {
            if (f64::from(*cost) - truth).abs() > 1e-5 * largest {
                return Err(format!("problem {number}: the host has {cost}, f64 {truth}"));
            }
        }
        differences(&truth, result, host, scales).map_err(|e| format!("problem {number}: {e}"))?;
    }
    Ok(())
}
