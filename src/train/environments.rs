//! Plants stepped side by side, each started again when its episode is over.

use super::purpose;
use super::starts::Mixture;
use crate::rollout::States;

/// Plants with the states that they are in; what follows is a function of these and of the number
/// of the step.
#[derive(Clone, Debug)]
pub struct Environments {
    mixture: Mixture,
    seed: u64,
    horizon: u32,
    /// The states, one after the other.
    pub states: Vec<f32>,
    /// Steps that each has made since its start.
    pub ages: Vec<f32>,
}

impl Environments {
    /// `count` plants at their first starts, each at another age, so that they do not start again
    /// all at once.
    pub fn new(mixture: Mixture, seed: u64, horizon: u32, count: usize) -> Self {
        let states = mixture.draw(seed, purpose::START, 0, count).view().numbers().to_vec();
        let ages = (0..count).map(|i| (i as u32 % horizon) as f32).collect();
        Self { mixture, seed, horizon, states, ages }
    }

    /// Number of plants.
    pub fn len(&self) -> usize {
        self.ages.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ages.is_empty()
    }

    /// The state of each.
    pub fn each(&self) -> States<'_> {
        States::of(&self.states, self.states.len() / self.ages.len())
    }

    /// Moves all to the states `next`, step number `number`, counted from 0. Those that are at the
    /// horizon, for whose number `over` says so, or whose state is not finite start again; tells which.
    pub fn advance(
        &mut self,
        number: u64,
        next: States<'_>,
        over: impl Fn(usize) -> bool,
    ) -> Vec<bool> {
        let starts = self.mixture.draw(self.seed, purpose::START, number + 1, self.ages.len());
        let mut ended = Vec::with_capacity(next.len());
        let states = self.states.chunks_exact_mut(next.size());
        for (i, (state, age)) in states.zip(&mut self.ages).enumerate() {
            *age += 1.0;
            let broken = next.row(i).iter().any(|x| !x.is_finite());
            let again = *age >= self.horizon as f32 || broken || over(i);
            state.copy_from_slice(if again { starts.row(i) } else { next.row(i) });
            *age = if again { 0.0 } else { *age };
            ended.push(again);
        }
        ended
    }
}
