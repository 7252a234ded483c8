//! Plants stepped side by side, each started again when its episode is over.

use super::purpose;
use super::starts::Mixture;

/// Plants with the states that they are in; what follows is a function of these and of the number
/// of the step.
#[derive(Clone, Debug)]
pub struct Environments<const NX: usize> {
    mixture: Mixture<NX>,
    seed: u64,
    horizon: u32,
    /// The states, one after the other.
    pub states: Vec<f32>,
    /// Steps that each has made since its start.
    pub ages: Vec<f32>,
}

impl<const NX: usize> Environments<NX> {
    /// `count` plants at their first starts, each at another age, so that they do not start again
    /// all at once.
    pub fn new(mixture: Mixture<NX>, seed: u64, horizon: u32, count: usize) -> Self {
        let states = mixture.draw(seed, purpose::START, 0, count).as_flattened().to_vec();
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
    pub fn each(&self) -> Vec<[f32; NX]> {
        self.states.as_chunks().0.to_vec()
    }

    /// Moves all to the states `next`, step number `number`, counted from 0. Those that are at the
    /// horizon, for which `over` says so, or whose state is not finite start again; tells which.
    pub fn advance(
        &mut self,
        number: u64,
        next: &[[f32; NX]],
        over: impl Fn(&[f32; NX]) -> bool,
    ) -> Vec<bool> {
        let starts = self.mixture.draw(self.seed, purpose::START, number + 1, self.ages.len());
        let mut ended = Vec::with_capacity(next.len());
        let states = self.states.as_chunks_mut().0.iter_mut();
        for (((state, age), next), start) in states.zip(&mut self.ages).zip(next).zip(starts) {
            *age += 1.0;
            let broken = next.iter().any(|x| !x.is_finite());
            let again = *age >= self.horizon as f32 || broken || over(next);
            (*state, *age) = if again { (start, 0.0) } else { (*next, *age) };
            ended.push(again);
        }
        ended
    }
}
