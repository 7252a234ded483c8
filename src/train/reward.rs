//! The ordinary reward of a task, which knows neither measure nor certificate.

use super::backup::Margins;
use super::settings::RewardSettings;
use crate::model::Task;

/// What a step earns: progress toward a goal, the target set, and a penalty for what is not safe.
#[derive(Clone, Debug, PartialEq)]
pub struct Reward {
    /// The task.
    pub task: Task,
    /// Coordinates of the goal, with its place; without any, larger target margins are nearer.
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
    /// Where a rollout is over in the target, a violation that leads out of it costs nothing: past a gate
    /// no fence holds.
    pub fn of(&self, before: Visited<'_>, after: Visited<'_>) -> f32 {
        let RewardSettings { progress, target, violation, .. } = self.weights;
        let inside = [before, after].map(|visited| visited.margins.target > 0.0);
        let [from, to] = inside.map(|inside| f64::from(u8::from(inside)));
        let over = inside[0] && matches!(self.task, Task::ReachAvoid(_));
        let violated = after.margins.constraint <= 0.0 && !over;
        let nearer = f64::from(self.distance(before) - self.distance(after));
        // An infinite margin gets no larger.
        let nearer = if nearer.is_finite() { nearer } else { 0.0 };
        let penalty = if violated { violation } else { 0.0 };
        (progress * nearer + target * (to - from) - penalty) as f32
    }

    /// Distance from the goal.
    fn distance(&self, Visited { state: x, margins }: Visited<'_>) -> f32 {
        if self.goal.is_empty() {
            return -margins.target;
        }
        self.goal.iter().map(|&(i, place)| (x[i] - place).powi(2)).sum::<f32>().sqrt()
    }
}
