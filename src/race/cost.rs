//! The costs of the drone race: recovery (family A), centre line (A'), lane (B), and a quadratic.

use serde::{Deserialize, Serialize};

use crate::cost::{Cost, Obstacle, Quadratic, hinge, square};
use crate::real::Real;

/// Numbers of context per stage, see [`RaceReference::context`].
pub const RACE_CONTEXT: usize = 8;

/// What a stage of a race is measured against.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RaceReference {
    /// Position of the ego to steer toward, m.
    pub position: [f32; 3],
    /// Velocity of the ego to keep, m/s.
    pub velocity: [f32; 3],
    /// Speed toward the gate to keep, m/s.
    pub speed: f32,
    /// Whether the stage is the plan's last.
    pub last: bool,
}

impl RaceReference {
    /// The context of the stage: position, velocity, speed, 1 at the last stage.
    pub fn context(&self) -> [f32; RACE_CONTEXT] {
        let Self { position: [x, y, z], velocity: [vx, vy, vz], speed, last } = *self;
        [x, y, z, vx, vy, vz, speed, f32::from(u8::from(last))]
    }
}

/// A cost of the race, by family.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "family", rename_all = "kebab-case", deny_unknown_fields)]
pub enum RaceCost {
    /// Family A: steer toward a point at the velocities of a reference.
    Recovery(RecoveryCost),
    /// Family A': hold the centre line and a speed, nothing else.
    Centerline(CenterlineCost),
    /// Family B: hold the lane and the speed through the gate.
    Lane(LaneCost),
    /// The generic quadratic around the reference, with an obstacle.
    Quadratic(QuadraticCost),
}

/// Family A: `position |p - p_ref|^2 + velocity |v - v_ref|^2 + control |u|^2`, safety, fences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecoveryCost {
    /// Weight of the squared distance to the recovery point, 1/m^2.
    pub position: f32,
    /// Weight of the squared velocity error, s^2/m^2.
    pub velocity: f32,
    /// Weight of the squared control.
    pub control: f32,
    /// The opponent's cone.
    pub safety: Safety,
    /// The fences of the gate.
    pub fence: Fence,
}

/// Family A': `lane (x^2 + z^2) + speed (vy - speed_ref)^2 + control |u|^2`, safety, fences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CenterlineCost {
    /// Weight of the squared distance from the centre line, 1/m^2.
    pub lane: f32,
    /// Weight of the squared speed error, s^2/m^2.
    pub speed: f32,
    /// Weight of the squared control.
    pub control: f32,
    /// The opponent's cone.
    pub safety: Safety,
    /// The fences of the gate.
    pub fence: Fence,
}

/// Family B: the centre line with terms against moving away from it, against being far from it,
/// and at the last stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaneCost {
    /// Weight of the squared distance from the centre line, 1/m^2.
    pub lane: f32,
    /// Weight of the squared speed error, s^2/m^2.
    pub speed: f32,
    /// Weight of the squared control.
    pub control: f32,
    /// Weight of the squared velocity across, on each axis where it leads away, s^2/m^2.
    pub away: f32,
    /// Weight of `(max(|x|, |z|) - 0.05)^2` where either is above 0.15 m, 1/m^2.
    pub wide: f32,
    /// Further weight of the squared distance from the centre line at the last stage, 1/m^2.
    pub last: f32,
    /// The opponent's cone.
    pub safety: Safety,
    /// The fences of the gate.
    pub fence: Fence,
}

/// [`Quadratic`] around the reference position and velocity of the ego, the opponent's states
/// against 0; with an obstacle, safety, fences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuadraticCost {
    /// Weights of the squared errors of the twelve states.
    pub state: [f32; 12],
    /// Weights of the squared controls.
    pub control: [f32; 3],
    /// Weights of the states at the last stage, in place of `state`.
    pub last: [f32; 12],
    /// A disc in the plane of two states to keep away from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacle: Option<Obstacle>,
    /// The opponent's cone.
    pub safety: Safety,
    /// The fences of the gate.
    pub fence: Fence,
}

/// `weight max(0, margin - m)^2` with the distance margin
/// `m = |p_e - p_o| - radius (1 + max(0, height difference))`, three-dimensional.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Safety {
    /// Weight, 1/m^2; 0 for none.
    pub weight: f32,
    /// Radius of the cone at equal height, m.
    pub radius: f32,
    /// Distance margin below which it costs, m; 0 in the study.
    pub margin: f32,
    /// Which height difference widens the cone.
    pub cone: SafetyCone,
}

/// Which height difference widens the cone of the safety term.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SafetyCone {
    /// `z_o - z_e`, as in the constraint: wider where the opponent is above.
    Above,
    /// `|z_o - z_e|`: covers the constraint and the study's judge, whose sign is the opposite.
    Either,
}

/// `weight max(0, margin - f)^2` for the nearer fence of each axis, `f = 0.05 - y - |x|` and
/// `f = 0.05 - y - |z|`, short of the gate's plane: past it there are no fences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fence {
    /// Weight, 1/m^2; 0 for none.
    pub weight: f32,
    /// Distance margin below which it costs, m.
    pub margin: f32,
}

/// Offset of the fences, m.
const FENCE: f32 = 0.05;
/// Distance from the centre line up to which being wide costs nothing more, m.
const WIDE_FREE: f32 = 0.05;
/// Distance from the centre line from which being wide costs, m.
const WIDE_FROM: f32 = 0.15;

impl Safety {
    /// None.
    pub const NONE: Self = Self { weight: 0.0, radius: 0.2, margin: 0.0, cone: SafetyCone::Above };

    #[inline(always)]
    fn cost<R: Real>(&self, x: &[R; 12]) -> R {
        if self.weight == 0.0 {
            return R::lit(0.0);
        }
        let [ego_x, _, ego_y, _, ego_z, _, opp_x, _, opp_y, _, opp_z, _] = *x;
        let higher = opp_z - ego_z;
        let widening = match self.cone {
            SafetyCone::Above => higher.max(R::lit(0.0)),
            SafetyCone::Either => higher.abs(),
        };
        let gap = square(ego_x - opp_x) + square(ego_y - opp_y) + square(higher);
        let radius = R::lit(self.radius) * (R::lit(1.0) + widening);
        R::lit(self.weight) * hinge((R::lit(self.margin) + radius) - gap.sqrt())
    }
}

impl Fence {
    /// None.
    pub const NONE: Self = Self { weight: 0.0, margin: 0.0 };

    #[inline(always)]
    fn cost<R: Real>(&self, x: &[R; 12]) -> R {
        if self.weight == 0.0 {
            return R::lit(0.0);
        }
        let [ego_x, _, ego_y, _, ego_z, ..] = *x;
        let short = R::lit(self.margin - FENCE) + ego_y;
        let cost = R::lit(self.weight) * (hinge(short + ego_x.abs()) + hinge(short + ego_z.abs()));
        ego_y.if_lt(R::lit(0.0), cost, R::lit(0.0))
    }
}

/// `x^2 + z^2` of the ego.
#[inline(always)]
fn off_center<R: Real>(x: &[R; 12]) -> R {
    square(x[0]) + square(x[4])
}

/// `|u|^2`.
#[inline(always)]
fn effort<R: Real>(u: &[R; 3]) -> R {
    square(u[0]) + square(u[1]) + square(u[2])
}

impl RecoveryCost {
    #[inline(always)]
    fn stage<R: Real>(&self, x: &[R; 12], u: &[R; 3], context: &[R; RACE_CONTEXT]) -> R {
        let [px, py, pz, vx, vy, vz, ..] = *context;
        let position = square(x[0] - px) + square(x[2] - py) + square(x[4] - pz);
        let velocity = square(x[1] - vx) + square(x[3] - vy) + square(x[5] - vz);
        R::lit(self.position) * position
            + R::lit(self.velocity) * velocity
            + R::lit(self.control) * effort(u)
            + (self.safety.cost(x) + self.fence.cost(x))
    }
}

impl CenterlineCost {
    #[inline(always)]
    fn stage<R: Real>(&self, x: &[R; 12], u: &[R; 3], context: &[R; RACE_CONTEXT]) -> R {
        R::lit(self.lane) * off_center(x)
            + R::lit(self.speed) * square(x[3] - context[6])
            + R::lit(self.control) * effort(u)
            + (self.safety.cost(x) + self.fence.cost(x))
    }
}

impl LaneCost {
    #[inline(always)]
    fn stage<R: Real>(&self, x: &[R; 12], u: &[R; 3], context: &[R; RACE_CONTEXT]) -> R {
        let [ego_x, ego_vx, _, ego_vy, ego_z, ego_vz, ..] = *x;
        let zero = R::lit(0.0);
        // v^2 where the velocity leads away from the centre line: p v > 0.
        let away = |p: R, v: R| zero.if_lt(p * v, square(v), zero);
        let widest = ego_x.abs().max(ego_z.abs());
        let wide = R::lit(WIDE_FROM).if_lt(widest, square(widest - R::lit(WIDE_FREE)), zero);
        let lane = R::lit(self.lane) + context[7] * R::lit(self.last);
        lane * off_center(x)
            + R::lit(self.speed) * square(ego_vy - context[6])
            + R::lit(self.away) * (away(ego_x, ego_vx) + away(ego_z, ego_vz))
            + R::lit(self.wide) * wide
            + R::lit(self.control) * effort(u)
            + (self.safety.cost(x) + self.fence.cost(x))
    }
}

impl QuadraticCost {
    #[inline(always)]
    fn stage<R: Real>(&self, x: &[R; 12], u: &[R; 3], context: &[R; RACE_CONTEXT]) -> R {
        let [px, py, pz, vx, vy, vz, _, last] = *context;
        let zero = R::lit(0.0);
        let Self { state, control, obstacle, .. } = *self;
        let quadratic = Quadratic { state, control, last: self.last, obstacle };
        let reference = [px, vx, py, vy, pz, vz, zero, zero, zero, zero, zero, zero, last];
        quadratic.stage(*x, *u, reference) + (self.safety.cost(x) + self.fence.cost(x))
    }
}

impl Cost<12, 3, RACE_CONTEXT> for RaceCost {
    #[inline(always)]
    fn stage<R: Real>(&self, x: [R; 12], u: [R; 3], context: [R; RACE_CONTEXT]) -> R {
        match self {
            Self::Recovery(cost) => cost.stage(&x, &u, &context),
            Self::Centerline(cost) => cost.stage(&x, &u, &context),
            Self::Lane(cost) => cost.stage(&x, &u, &context),
            Self::Quadratic(cost) => cost.stage(&x, &u, &context),
        }
    }
}
