//! Where a failing start is looked for, in coordinates from -1 to 1.

use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::{Ball, Region};

/// What a start that rounding put outside of a ball is drawn in by, first; twice that next.
const DRAWN_IN: f64 = 1e-7;

/// A region with coordinates of its own: those that vary, from -1 to 1.
pub(super) struct Domain {
    region: Region,
    /// Indices of the states that vary.
    varying: Vec<usize>,
}

impl Domain {
    /// The coordinates of `region`, whose states are those of `model`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has another number of states, or none of them varies.
    pub(super) fn new(region: &Region, model: &Model) -> Result<Self> {
        if region.size() != model.states.len() {
            let (has, states) = (region.size(), model.states.len());
            let problem = format!("{has} coordinates; the model has {states} states");
            return Err(Error::invalid("region", problem));
        }
        let varies = region.varies();
        let varying: Vec<usize> = (0..varies.len()).filter(|&i| varies[i]).collect();
        if varying.is_empty() {
            return Err(Error::invalid("region", "no coordinate varies; one at least has to"));
        }
        Ok(Self { region: region.clone(), varying })
    }

    /// How many coordinates there are.
    pub(super) fn dimension(&self) -> usize {
        self.varying.len()
    }

    /// The start at `u`; what lies outside is moved to the rim.
    pub(super) fn start(&self, u: &[f64]) -> Vec<f32> {
        match &self.region {
            Region::Box { low, high } => {
                let mut x = low.clone();
                for (&i, u) in self.varying.iter().zip(u) {
                    let [low, high] = [low[i], high[i]];
                    let [middle, half] = middle_and_half(low, high);
                    x[i] = ((middle + half * u) as f32).clamp(low, high);
                }
                x
            }
            Region::Ball(ball) => self.in_ball(ball, u),
        }
    }

    /// The start of a ball at `u`.
    fn in_ball(&self, ball: &Ball, u: &[f64]) -> Vec<f32> {
        let length = u.iter().map(|u| u * u).sum::<f64>().sqrt();
        let mut scale = f64::from(ball.radius) / length.max(1.0);
        let mut drawn_in = DRAWN_IN;
        loop {
            let mut x = ball.center.clone();
            for (&i, u) in self.varying.iter().zip(u) {
                x[i] = (f64::from(ball.center[i]) + scale * u) as f32;
            }
            if ball.contains(&x) || scale <= 0.0 {
                return x;
            }
            scale = (scale - drawn_in * f64::from(ball.radius)).max(0.0);
            drawn_in *= 2.0;
        }
    }

    /// The coordinates of the start `x`.
    pub(super) fn coordinates(&self, x: &[f32]) -> Vec<f64> {
        let at = |&i: &usize| match &self.region {
            Region::Box { low, high } => {
                let [middle, half] = middle_and_half(low[i], high[i]);
                (f64::from(x[i]) - middle) / half
            }
            Region::Ball(ball) => {
                (f64::from(x[i]) - f64::from(ball.center[i])) / f64::from(ball.radius)
            }
        };
        self.varying.iter().map(at).collect()
    }

    /// Those of the places `all` that lie `apart` from the ones kept before them, in the root mean square
    /// over the coordinates.
    pub(super) fn apart<'a>(
        &self,
        all: impl IntoIterator<Item = &'a Vec<f64>>,
        apart: f64,
    ) -> Vec<Vec<f64>> {
        let mut kept: Vec<Vec<f64>> = Vec::new();
        for u in all {
            let far = |other: &Vec<f64>| {
                let square: f64 = other.iter().zip(u).map(|(a, b)| (a - b).powi(2)).sum();
                square > self.dimension() as f64 * apart * apart
            };
            if kept.iter().all(far) {
                kept.push(u.clone());
            }
        }
        kept
    }
}

/// Middle of an interval and half its length.
fn middle_and_half(low: f32, high: f32) -> [f64; 2] {
    let [low, high] = [low, high].map(f64::from);
    [0.5 * (low + high), 0.5 * (high - low)]
}
