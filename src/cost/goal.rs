//! The cost of driving to a goal: distance, yaw, and a map of what lies on the way.

use super::{Cost, CostMap, Lookup};
use crate::real::Real;

/// `distance |p - p_goal| + angle |yaw - yaw_goal|` and the map's cost at p, for a state
/// `(x, y, yaw)`; the difference of the yaws is wrapped to half a turn.
///
/// The context is the goal `(x, y, yaw)` of the stage.
#[derive(Clone, Debug, PartialEq)]
pub struct GoalCost {
    /// Weight of the distance, 1/m.
    pub distance: f32,
    /// Weight of the angle, 1/rad.
    pub angle: f32,
    /// What each place costs besides.
    pub map: CostMap,
}

/// An angle less its nearest multiple of a turn, rad: in `[-pi, pi]`.
#[inline(always)]
fn wrapped<R: Real>(angle: R) -> R {
    let turn = std::f32::consts::TAU;
    let turns = (angle * R::lit(1.0 / turn) + R::lit(0.5)).floor();
    angle - turns * R::lit(turn)
}

impl<const NU: usize> Cost<3, NU, 3> for GoalCost {
    #[inline(always)]
    fn stage<R: Real>(&self, [x, y, yaw]: [R; 3], _: [R; NU], goal: [R; 3]) -> R {
        let [goal_x, goal_y, goal_yaw] = goal;
        let distance = (x - goal_x).hypot(y - goal_y);
        R::lit(self.distance) * distance + R::lit(self.angle) * wrapped(yaw - goal_yaw).abs()
    }

    #[inline(always)]
    fn map<R: Real>(&self, [x, y, _]: [R; 3]) -> Option<Lookup<'_, R>> {
        Some(Lookup { map: &self.map, place: [x, y] })
    }
}
