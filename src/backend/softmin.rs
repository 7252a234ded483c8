//! Softmin by parts: weighted means of blocks of samples, merged in a fixed order.

use crate::rollout::MppiResult;

/// The samples of a block, weighted against the smallest cost among them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Partial<const NU: usize> {
    /// Smallest cost; infinite where none is finite.
    pub(super) least: f32,
    /// The sample that has it, the first of equal ones.
    pub(super) best: u32,
    /// Sum of the weights `exp(-(S - least) / lambda)`.
    pub(super) weight: f64,
    /// Sum of their squares.
    pub(super) squares: f64,
    /// Sum of the finite costs.
    pub(super) cost: f64,
    /// Samples whose cost is not finite.
    pub(super) non_finite: u32,
    /// Weighted sum of the controls, `[H]`.
    pub(super) controls: Vec<[f64; NU]>,
}

impl<const NU: usize> Partial<NU> {
    /// No sample, for plans of `horizon` steps.
    pub(super) fn none(horizon: usize) -> Self {
        Self {
            least: f32::INFINITY,
            best: 0,
            weight: 0.0,
            squares: 0.0,
            cost: 0.0,
            non_finite: 0,
            controls: vec![[0.0; NU]; horizon],
        }
    }

    /// Adds the samples of `other`, which come after these.
    pub(super) fn merge(&mut self, other: &Self, temperature: f32) {
        let least = self.least.min(other.least);
        let scale = |part: f32| {
            // An empty part has no weight to scale.
            let excess = f64::from(part) - f64::from(least);
            if part.is_finite() { (-excess / f64::from(temperature)).exp() } else { 0.0 }
        };
        let (mine, theirs) = (scale(self.least), scale(other.least));
        if other.least < self.least {
            self.best = other.best;
        }
        self.least = least;
        self.weight = mine * self.weight + theirs * other.weight;
        self.squares = mine * mine * self.squares + theirs * theirs * other.squares;
        self.cost += other.cost;
        self.non_finite += other.non_finite;
        for (sum, more) in self.controls.iter_mut().flatten().zip(other.controls.iter().flatten()) {
            *sum = mine * *sum + theirs * more;
        }
    }

    /// The result for `samples` samples around the plan `nominal`.
    pub(super) fn finish(
        self,
        samples: u32,
        nominal: &[[f32; NU]],
        bounds: &[[f32; 2]; NU],
        costs: Vec<f32>,
    ) -> MppiResult<NU> {
        let clip = |i: usize, u: f32| u.clamp(bounds[i][0], bounds[i][1]);
        let mean = |sum: &[f64; NU]| -> [f32; NU] {
            std::array::from_fn(|i| clip(i, (sum[i] / self.weight) as f32))
        };
        let kept = |u: &[f32; NU]| -> [f32; NU] { std::array::from_fn(|i| clip(i, u[i])) };
        let found = self.weight > 0.0;
        let plan = match found {
            true => self.controls.iter().map(mean).collect(),
            false => nominal.iter().map(kept).collect(),
        };
        MppiResult {
            plan,
            least_cost: self.least,
            mean_cost: self.cost / f64::from((samples - self.non_finite).max(1)),
            effective_samples: if found { self.weight * self.weight / self.squares } else { 0.0 },
            best: self.best,
            non_finite: self.non_finite,
            costs,
        }
    }
}
