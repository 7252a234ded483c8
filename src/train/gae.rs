//! Generalised advantage estimation: how much better what was done is than what was expected.

/// One step of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What it earned.
    pub reward: f32,
    /// What was expected before it.
    pub value: f32,
    /// What is expected after it; 0 after an end, but not where an episode is merely cut off.
    pub next_value: f32,
    /// Whether the step after it belongs to another episode.
    pub last: bool,
}

/// The advantage of each of consecutive steps (Schulman et al. 2016): the sum over the rest of its
/// episode of `(gamma lambda)^k (reward + gamma next_value - value)`.
pub fn advantages(steps: &[Step], gamma: f32, lambda: f32) -> Vec<f32> {
    let mut advantages = vec![0.0; steps.len()];
    let mut rest = 0.0;
    for (advantage, step) in advantages.iter_mut().zip(steps).rev() {
        let after = if step.last { 0.0 } else { gamma * lambda * rest };
        rest = step.reward + gamma * step.next_value - step.value + after;
        *advantage = rest;
    }
    advantages
}
