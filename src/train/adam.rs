//! Adam on flat parameters, the clipping of gradients and the schedule of the rate.

use serde::{Deserialize, Serialize};

/// Keeps the division finite where a gradient has always been 0.
const FLOOR: f32 = 1e-8;

/// How parameters follow their gradients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Optimiser {
    /// Learning rate after the warm-up.
    pub rate: f64,
    /// Iterations over which the rate rises from 0.
    pub warmup: u64,
    /// What is left of the rate at the end, as a share; half a cosine leads there.
    pub last: f64,
    /// Longest gradient, Euclidean; longer ones are scaled down.
    pub clip: f64,
    /// Decay of the means of gradients and of their squares.
    pub decays: [f64; 2],
}

impl Optimiser {
    /// The rate of iteration `iteration` of `total`, counted from 0.
    pub fn rate(&self, iteration: u64, total: u64) -> f64 {
        let begun = (iteration + 1) as f64;
        let risen = if self.warmup == 0 { 1.0 } else { (begun / self.warmup as f64).min(1.0) };
        let turn = std::f64::consts::PI * begun / total as f64;
        self.rate * risen * (self.last + (1.0 - self.last) * 0.5 * (1.0 + turn.cos()))
    }
}

/// Moments of the gradients of one network (Kingma and Ba 2015).
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Mean of the gradients.
    pub first: Vec<f32>,
    /// Mean of their squares.
    pub second: Vec<f32>,
}

impl Adam {
    /// No gradient seen, of `count` parameters.
    pub fn new(count: usize) -> Self {
        Self { first: vec![0.0; count], second: vec![0.0; count] }
    }

    /// Update number `iteration`, counted from 0: moves `parameters` against `gradient`.
    pub fn update(
        &mut self,
        parameters: &mut [f32],
        gradient: &[f32],
        optimiser: &Optimiser,
        [iteration, total]: [u64; 2],
    ) {
        let shrunk = clipping(gradient, optimiser.clip);
        let rate = optimiser.rate(iteration, total);
        let unbiased = |decay: f64| 1.0 / (1.0 - decay.powf((iteration + 1) as f64));
        let [keep, keep_square] = optimiser.decays.map(|decay| decay as f32);
        let rate = (rate * unbiased(optimiser.decays[0])) as f32;
        let square = unbiased(optimiser.decays[1]) as f32;
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((parameter, slope), (first, second)) in
            parameters.iter_mut().zip(gradient).zip(moments)
        {
            let slope = slope * shrunk;
            *first = keep * *first + (1.0 - keep) * slope;
            *second = keep_square * *second + (1.0 - keep_square) * slope * slope;
            *parameter -= rate * *first / ((*second * square).sqrt() + FLOOR);
        }
    }
}

/// What a gradient is multiplied with so that it is no longer than `most`; 0 for one that is not
/// finite, which then leaves the parameters where momentum takes them.
fn clipping(gradient: &[f32], most: f64) -> f32 {
    let square: f64 = gradient.iter().map(|slope| f64::from(*slope).powi(2)).sum();
    let length = square.sqrt();
    if !length.is_finite() {
        return 0.0;
    }
    (most / length.max(most)) as f32
}
