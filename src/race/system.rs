//! The two-drone race: an ego that must pass the gate first, and an opponent under linear feedback.

use crate::real::Real;
use crate::system::{Axis, Body, Feature, Parameter, System};

/// Step of the explicit Euler integration, seconds.
const DT: f32 = 0.1;
/// Factor on both margins, from the published study.
const MARGIN_SCALE: f32 = 10.0;
/// Offset of the fences that lead to the gate, metres.
const FENCE: f32 = 0.05;
/// Slowest admissible opponent speed toward the gate that its feedback holds, m/s.
const OPPONENT_SPEED: f32 = 0.3;
/// Feedback gains of the opponent: position across the gate, velocity across, velocity along.
const GAINS: [f32; 3] = [9.1704, 16.8205, 3.1127];

/// Form of the collision cone in the constraint margin, `d` the distance in the x-y plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cone {
    /// `d - 0.2 (1 + max(0, z_o - z_e))`: the study's code, and ours.
    Distance,
    /// `d^2 - 0.2 (1 + max(0, z_o - z_e))`: as printed in the paper.
    Squared,
    /// `d - sqrt(0.2 (1 + max(0, z_o - z_e)))`: the paper's zero set with a small gradient.
    Root,
}

/// The race; state `(x, vx, y, vy, z, vz)` of the ego, then of the opponent, in m and m/s.
///
/// The gate is at the origin and both fly toward +y. Controls are the ego's accelerations as
/// shares of `ego_gain`, clipped to `[-1, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DroneRace {
    /// Acceleration of the ego at full control, m/s^2.
    pub ego_gain: f32,
    /// Factor on the opponent's feedback.
    pub opponent_gain: f32,
    /// Form of the collision cone.
    pub cone: Cone,
    /// Whether the constraint also keeps the ego below 1 m/s toward the gate (the study's code).
    pub speed_limit: bool,
}

impl Default for DroneRace {
    fn default() -> Self {
        Self { ego_gain: 0.5, opponent_gain: 1.0, cone: Cone::Distance, speed_limit: false }
    }
}

impl DroneRace {
    /// Half width of the gate, metres.
    pub const GATE: f32 = 0.3;
    /// Radius of the cone around the opponent at equal height, metres (`distance` form).
    pub const CONE: f32 = 0.2;

    /// Margin to the collision cone, metres (square metres in the squared form): a part of the
    /// constraint margin, before the factor on it.
    #[inline(always)]
    pub fn cone_margin<R: Real>(&self, x: [R; 12]) -> R {
        let [ego_x, _, ego_y, _, ego_z, _, opp_x, _, opp_y, _, opp_z, _] = x;
        let (dx, dy) = (ego_x - opp_x, ego_y - opp_y);
        let radius = R::lit(Self::CONE) * (R::lit(1.0) + (opp_z - ego_z).max(R::lit(0.0)));
        match self.cone {
            Cone::Distance => dx.hypot(dy) - radius,
            Cone::Squared => dx * dx + dy * dy - radius,
            Cone::Root => dx.hypot(dy) - radius.sqrt(),
        }
    }
}

/// A control within its bounds.
#[inline(always)]
fn clip<R: Real>(u: R) -> R {
    u.clamp(R::lit(-1.0), R::lit(1.0))
}

impl System<12, 3> for DroneRace {
    fn name(&self) -> &str {
        "drone-race"
    }

    fn states(&self) -> [Axis; 12] {
        let axis = |name: &str, unit: &str, low, high| Axis::new(name, unit, low, high);
        [
            axis("ego_x", "m", -1.0, 1.0),
            axis("ego_vx", "m/s", -1.0, 1.0),
            axis("ego_y", "m", -3.2, 0.0),
            axis("ego_vy", "m/s", 0.1, 1.0),
            axis("ego_z", "m", -1.0, 1.0),
            axis("ego_vz", "m/s", -1.0, 1.0),
            axis("opp_x", "m", -1.0, 1.0),
            axis("opp_vx", "m/s", -1.0, 1.0),
            axis("opp_y", "m", -3.2, 0.0),
            axis("opp_vy", "m/s", 0.1, 0.5),
            axis("opp_z", "m", -1.0, 1.0),
            axis("opp_vz", "m/s", -1.0, 1.0),
        ]
    }

    fn controls(&self) -> [Axis; 3] {
        ["accel_x", "accel_y", "accel_z"].map(|name| Axis::new(name, "share", -1.0, 1.0))
    }

    #[inline(always)]
    fn step<R: Real>(&self, x: [R; 12], u: [R; 3]) -> [R; 12] {
        let [ego_x, ego_vx, ego_y, ego_vy, ego_z, ego_vz, ..] = x;
        let [.., opp_x, opp_vx, opp_y, opp_vy, opp_z, opp_vz] = x;
        let [ux, uy, uz] = [clip(u[0]), clip(u[1]), clip(u[2])];
        let dt = R::lit(DT);
        let gain = dt * R::parameter("ego_gain", self.ego_gain);
        let scale = dt * R::parameter("opponent_gain", self.opponent_gain);
        let position = scale * R::lit(GAINS[0]);
        let velocity = scale * R::lit(GAINS[1]);
        let along = scale * R::lit(GAINS[2]);
        [
            ego_x + dt * ego_vx,
            ego_vx + gain * ux,
            ego_y + dt * ego_vy,
            ego_vy + gain * uy,
            ego_z + dt * ego_vz,
            ego_vz + gain * uz,
            opp_x + dt * opp_vx,
            opp_vx - (position * opp_x + velocity * opp_vx),
            opp_y + dt * opp_vy,
            opp_vy + along * (R::lit(OPPONENT_SPEED) - opp_vy),
            opp_z + dt * opp_vz,
            opp_vz - (position * opp_z + velocity * opp_vz),
        ]
    }

    #[inline(always)]
    fn target<R: Real>(&self, x: [R; 12]) -> R {
        let [ego_x, _, ego_y, ego_vy, ego_z, _, _, _, opp_y, opp_vy, _, _] = x;
        let gate = R::lit(Self::GATE);
        let ahead = (ego_y - opp_y).min(ego_vy - opp_vy);
        let across = (ego_x + gate).min(gate - ego_x);
        let height = (ego_z + gate).min(gate - ego_z);
        R::lit(MARGIN_SCALE) * ahead.min(across).min(height)
    }

    #[inline(always)]
    fn constraint<R: Real>(&self, x: [R; 12]) -> R {
        let [ego_x, _, ego_y, ego_vy, ego_z, ..] = x;
        let room = R::lit(FENCE) - ego_y;
        let fences = (room + ego_x).min(room - ego_x).min((room + ego_z).min(room - ego_z));
        let margin = self.cone_margin(x).min(fences);
        let margin = if self.speed_limit { margin.min(R::lit(1.0) - ego_vy) } else { margin };
        R::lit(MARGIN_SCALE) * margin
    }

    fn parameters(&self) -> Vec<Parameter> {
        let parameter = Parameter::new;
        vec![
            parameter("ego_gain", "m/s^2", self.ego_gain),
            parameter("opponent_gain", "", self.opponent_gain),
        ]
    }

    fn bodies(&self) -> Vec<Body> {
        let body = |name: &str, x| Body { name: name.to_owned(), x, y: x + 2 };
        vec![body("ego", 0), body("opponent", 6)]
    }

    fn smallest_feature(&self) -> Option<Feature> {
        let radius = match self.cone {
            Cone::Distance => Self::CONE,
            Cone::Squared | Cone::Root => Self::CONE.sqrt(),
        };
        Some(Feature { name: "the cone around the opponent".to_owned(), width: 2.0 * radius })
    }
}
