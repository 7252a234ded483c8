//! A quadratic cost around a reference, with an optional round obstacle.

use serde::{Deserialize, Serialize};

use super::{Cost, hinge, square};
use crate::real::Real;

/// `sum_i q_i (x_i - ref_i)^2 + sum_j r_j u_j^2`, the last stage with weights of its own, plus an
/// obstacle.
///
/// The context is the reference state followed by a flag that is 1 at the last stage: `NC = NX + 1`.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadratic<const NX: usize, const NU: usize> {
    /// Weights of the states.
    pub state: [f32; NX],
    /// Weights of the controls.
    pub control: [f32; NU],
    /// Weights of the states at the last stage, in place of `state`.
    pub last: [f32; NX],
    /// What the plan has to keep away from.
    pub obstacle: Option<Obstacle>,
}

/// A disc in the plane of two states that costs `weight max(0, radius - distance)^2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Indices of the two states.
    pub states: [usize; 2],
    /// Centre.
    pub center: [f32; 2],
    /// Radius.
    pub radius: f32,
    /// Weight of the squared depth.
    pub weight: f32,
}

impl<const NX: usize, const NU: usize, const NC: usize> Cost<NX, NU, NC> for Quadratic<NX, NU> {
    #[inline(always)]
    fn stage<R: Real>(&self, x: [R; NX], u: [R; NU], context: [R; NC]) -> R {
        const { assert!(NC == NX + 1, "the context is the reference and the flag of the last stage") };
        let last = context[NX];
        let mut cost = R::lit(0.0);
        for i in 0..NX {
            let weight = R::lit(self.state[i]) + last * R::lit(self.last[i] - self.state[i]);
            cost = cost + weight * square(x[i] - context[i]);
        }
        for (weight, u) in self.control.iter().zip(u) {
            cost = cost + R::lit(*weight) * square(u);
        }
        match &self.obstacle {
            None => cost,
            Some(Obstacle { states: [i, j], center: [a, b], radius, weight }) => {
                let distance = (x[*i] - R::lit(*a)).hypot(x[*j] - R::lit(*b));
                cost + R::lit(*weight) * hinge(R::lit(*radius) - distance)
            }
        }
    }
}
