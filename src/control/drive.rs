//! The published benchmark of MPPI: a differential drive, a cost map, and plans of two seconds.

use crate::cost::{CostMap, GoalCost, Grid};
use crate::error::Result;
use crate::rollout::{MppiProblem, MppiSettings, MppiSpec, Purpose, Sigma, Stream};
use crate::system::DiffDrive;

use super::mppi::Planner;

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
    /// Cost and settings; one improvement per plan.
    pub planner: Planner<'static, GoalCost, 2>,
    /// From the published start, with a plan of zeros.
    pub problem: MppiProblem<3, 2, 3>,
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
            sigma: Sigma::PerControl([0.2; 2]),
            ..MppiSettings::new(&system, samples, HORIZON)
        };
        let grid = Grid { origin: system.low, resolution: RESOLUTION, size: [CELLS; 2] };
        let map = CostMap::around(grid, &system.obstacles, INFLATION, OBSTACLE)?;
        let planner = Planner {
            spec: MppiSpec::new(settings)?,
            cost: GoalCost { distance: 5.0, angle: 5.0, map },
            iterations: 1,
            value: None,
            disturbance: None,
        };
        let [x, y] = system.goal.center;
        let problem = MppiProblem {
            start: START,
            plan: vec![[0.0; 2]; HORIZON as usize],
            context: vec![[x, y, GOAL_YAW]; HORIZON as usize],
            stream: Stream::new(1, Purpose::CONTROL_NOISE, 0),
        };
        Ok(Self { system, planner, problem })
    }
}
