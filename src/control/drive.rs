//! The published benchmark of MPPI: a differential drive, a cost map, and plans of two seconds.

use crate::cost::{CostMap, GoalCost, Grid};
use crate::error::Result;
use crate::rollout::{MppiProblem, MppiSettings, MppiSpec, Planning, Purpose, Sigma, Stream};
use crate::system::{DiffDrive, System};

/// Steps of a plan.
const HORIZON: u32 = 100;
/// Where the drive starts: x, y in m, yaw in rad.
const START: [f32; 3] = [1.0, 1.0, 0.0];
/// Its yaw at the goal, rad.
const GOAL_YAW: f32 = 0.0;
/// Side of a cell, m.
const RESOLUTION: f32 = 0.1;
/// Cells along each side of the map.
const CELLS: usize = 110;
/// Width of the band around an obstacle in which the map's cost falls to 0, m.
const INFLATION: f32 = 0.1;
/// Cost of a stage in an obstacle.
const OBSTACLE: f32 = 20.0;

/// The system, cost, settings and first problem of the comparison that MPPI-Generic (Vlahov et al.
/// 2024) publishes against the controller of ROS 2 and torchrl.
///
/// Weights, bounds, noise, temperature, map, start and goal are the published ones. Obstacles are
/// discs within the published squares, of the cost 20 where theirs scales a logarithm, and the
/// controls are forward speed and turn rate as in ROS 2. A lookup takes the cell at the place; it
/// does not interpolate.
#[derive(Clone, Debug)]
pub struct DriveBenchmark {
    /// The drive.
    pub system: DiffDrive,
    /// The cost of a stage.
    pub cost: GoalCost,
    /// Both with the settings.
    pub planning: Planning,
    /// From the published start, with a plan of zeros.
    pub problem: MppiProblem,
}

impl DriveBenchmark {
    /// The benchmark with `samples` rollouts; 16,384 is the largest published number.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] for a number of samples out of range.
    pub fn new(samples: u32) -> Result<Self> {
        let system = DiffDrive::default();
        let settings = MppiSettings {
            temperature: 1.0,
            sigma: Sigma::PerControl(vec![0.2; 2]),
            ..MppiSettings::new(&system.controls(), samples, HORIZON)
        };
        let grid = Grid { origin: system.low, resolution: RESOLUTION, size: [CELLS; 2] };
        let map = CostMap::around(grid, &system.obstacles, INFLATION, OBSTACLE)?;
        let cost = GoalCost { distance: 5.0, angle: 5.0, map };
        let planning = Planning::of(&system, cost.clone(), MppiSpec::new(settings)?);
        let [x, y] = system.goal.center;
        let (plan, goals) = ([[0.0; 2]; HORIZON as usize], [[x, y, GOAL_YAW]; HORIZON as usize]);
        let stream = Stream::new(1, Purpose::CONTROL_NOISE, 0);
        let problem = MppiProblem::new(START, &plan, &goals, stream);
        Ok(Self { system, cost, planning, problem })
    }
}
