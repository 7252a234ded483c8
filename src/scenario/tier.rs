//! Which tier of a certificate a state is in, and the ball that its growth verified.

use super::record::{GrowthOutcome, GrowthRecord};
use crate::rollout::Ball;

/// Tier of a state: 0 in the target, 1 globally certified, 2 in the verified ball, 3 otherwise.
pub(super) fn tier(target_margin: f64, check_margin: f64, growth: &GrowthRecord, x: &[f32]) -> u8 {
    let local = || verified_ball(growth, x.len()).is_some_and(|ball| ball.contains(x));
    match () {
        () if target_margin > 0.0 => 0,
        () if check_margin > 0.0 => 1,
        () if local() => 2,
        () => 3,
    }
}

/// The verified ball of `states` coordinates, where there is one: a record that was edited may have
/// any number of them.
pub(super) fn verified_ball(growth: &GrowthRecord, states: usize) -> Option<Ball> {
    let whole = |center: &&Vec<f32>| center.len() == states && growth.varies.len() == states;
    let verified = growth.outcome == GrowthOutcome::Verified;
    let center = growth.center.as_ref().filter(whole).filter(|_| verified)?;
    Some(Ball {
        center: center.clone(),
        radius: growth.radius as f32,
        varies: growth.varies.clone(),
    })
}
