//! The physics of a plant as WGSL text: what shaders are built from and certificates hash.

use std::array::from_fn;

use crate::formula::record;
use crate::formula::wgsl::function;
use crate::policy::Policy;
use crate::rollout::Plant;
use crate::system::System;

/// The recorded step, target margin, constraint margin and, where the policy is a formula, its
/// control, as WGSL functions `plant_step`, `plant_target`, `plant_constraint`, `plant_control`.
///
/// Arrays of states and controls are `array<f32, N>`, a single one is an `f32`. A network has no
/// text: its digest is [`crate::policy::Mlp::digest`].
///
/// ```
/// use reachcast::backend::physics;
/// use reachcast::rollout::Plant;
/// use reachcast::system::{BangBang, DoubleIntegrator};
/// let system = DoubleIntegrator::default();
/// let policy = BangBang { acceleration: 1.0 };
/// let text = physics(Plant { system: &system, policy: &policy });
/// assert!(text.starts_with("fn plant_step(x: array<f32, 2>, u: f32) -> array<f32, 2> {"));
/// assert!(text.contains("fn plant_control(x: array<f32, 2>) -> f32 {"));
/// ```
pub fn physics<S, P, const NX: usize, const NU: usize>(plant: Plant<'_, S, P>) -> String
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let Plant { system, policy } = plant;
    let state = [("x", NX)];
    let step = record(NX + NU, |inputs| {
        let x = from_fn(|i| inputs[i]);
        let u = from_fn(|i| inputs[NX + i]);
        system.step(x, u).to_vec()
    });
    let target = record(NX, |x| vec![system.target::<_>(from_fn(|i| x[i]))]);
    let constraint = record(NX, |x| vec![system.constraint::<_>(from_fn(|i| x[i]))]);
    let mut text = [
        function("plant_step", &[("x", NX), ("u", NU)], &step),
        function("plant_target", &state, &target),
        function("plant_constraint", &state, &constraint),
    ]
    .join("\n");
    if policy.network().is_none() {
        let control = record(NX, |x| policy.control::<_>(from_fn(|i| x[i])).to_vec());
        text.push('\n');
        text.push_str(&function("plant_control", &state, &control));
    }
    text
}
