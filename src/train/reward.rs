//! The ordinary reward of a task, which knows neither measure nor certificate.

use super::backup::Margins;
use super::settings::RewardSettings;

/// What a step earns: progress toward a goal, the target set, and a penalty for what is not safe.
#[derive(Clone, Debug, PartialEq)]
pub struct Reward {
    /// Coordinates of the goal, with its place.
    pub goal: Vec<(usize, f32)>,
    /// What each part is worth.
    pub weights: RewardSettings,
}

/// A state and its margins.
#[derive(Clone, Copy, Debug)]
pub struct Visited<'a> {
    /// The state.
    pub state: &'a [f32],
    /// Its margins.
    pub margins: Margins<f32>,
}

impl Reward {
    /// The reward of a step from `before` to `after`, section 12 of `docs/method.md`.
    ///
    /// A violation that leads out of the target costs nothing: past a gate no fence holds.
    pub fn of(&self, before: Visited<'_>, after: Visited<'_>) -> f32 {
        let RewardSettings { progress, target, violation, .. } = self.weights;
        let inside = [before, after].map(|visited| visited.margins.target > 0.0);
        let [from, to] = inside.map(|inside| f64::from(u8::from(inside)));
        let violated = after.margins.constraint <= 0.0 && !inside[0];
        let nearer = f64::from(self.distance(before.state) - self.distance(after.state));
        let penalty = if violated { violation } else { 0.0 };
        (progress * nearer + target * (to - from) - penalty) as f32
    }

    /// Distance from the goal.
    fn distance(&self, x: &[f32]) -> f32 {
        self.goal.iter().map(|&(i, place)| (x[i] - place).powi(2)).sum::<f32>().sqrt()
    }
}
