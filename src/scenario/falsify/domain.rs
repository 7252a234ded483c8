//! Where a failing start is looked for, in coordinates from -1 to 1.

use super::pairs::halves;
use super::settings::FalsifySettings;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::rollout::{Pairs, Region, Starts, Stream};

/// What a start that rounding put outside of a ball is drawn in by, first; twice that next.
const DRAWN_IN: f64 = 1e-7;

/// A region with coordinates of its own: those that vary, from -1 to 1.
pub(super) struct Domain {
    region: Region,
    /// Indices of the states that vary.
    varying: Vec<usize>,
    /// Radius of the perturbations of pairs, which have a coordinate for each state besides.
    radius: Option<f32>,
}

impl Domain {
    /// The coordinates of the starts or pairs of a search for a plant of `model`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it has another number of states, or none of them varies.
    pub(super) fn new(settings: &FalsifySettings, model: &Model) -> Result<Self> {
        let region = &settings.region;
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
        let radius = settings.pairs.as_ref().map(|pairs| pairs.radius);
        Ok(Self { region: region.clone(), varying, radius })
    }

    /// How many coordinates there are.
    pub(super) fn dimension(&self) -> usize {
        let perturbed = self.radius.map_or(0, |_| self.region.size());
        self.varying.len() + perturbed
    }

    /// The start number `index` of the uniform distribution, or the pair of it.
    pub(super) fn point(&self, [stream, perturbation]: [Stream; 2], index: u64) -> Vec<f32> {
        let Some(radius) = self.radius else { return self.region.point(stream, index) };
        let nominal = Starts::Drawn { region: self.region.clone(), stream };
        let [nominal, perturbed] = Pairs { nominal, radius, stream: perturbation }.pair(index);
        [perturbed, nominal].concat()
    }

    /// The start or pair at `u`; what lies outside is moved to the rim.
    pub(super) fn start(&self, u: &[f64]) -> Vec<f32> {
        let Some(radius) = self.radius else { return self.plain(u) };
        let (at, by) = u.split_at(self.varying.len());
        let nominal = self.plain(at);
        let length = by.iter().map(|u| u * u).sum::<f64>().sqrt();
        // Rounding to f32 leaves it in the ball.
        let scale = (1.0 - DRAWN_IN) * f64::from(radius) / length.max(1.0);
        let moved = |(x, by): (&f32, &f64)| (f64::from(*x) + scale * by) as f32;
        let perturbed: Vec<f32> = nominal.iter().zip(by).map(moved).collect();
        [perturbed, nominal].concat()
    }

    /// The start of the region at `u`.
    fn plain(&self, u: &[f64]) -> Vec<f32> {
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
            Region::Ball(ball) => self.in_round(&ball.center, |_| ball.radius, u),
            Region::Ellipsoid(set) => self.in_round(&set.center, |i| set.half_axes[i], u),
        }
    }

    /// The start of a ball or an ellipsoid of these half axes at `u`.
    fn in_round(&self, center: &[f32], half: impl Fn(usize) -> f32, u: &[f64]) -> Vec<f32> {
        let length = u.iter().map(|u| u * u).sum::<f64>().sqrt();
        let mut scale = 1.0 / length.max(1.0);
        let mut drawn_in = DRAWN_IN;
        loop {
            let mut x = center.to_vec();
            for (&i, u) in self.varying.iter().zip(u) {
                x[i] = (f64::from(center[i]) + scale * f64::from(half(i)) * u) as f32;
            }
            if self.region.contains(&x) || scale <= 0.0 {
                return x;
            }
            scale = (scale - drawn_in).max(0.0);
            drawn_in *= 2.0;
        }
    }

    /// The coordinates of the start or pair `x`.
    pub(super) fn coordinates(&self, x: &[f32]) -> Vec<f64> {
        let Some(radius) = self.radius else { return self.of_plain(x) };
        let [perturbed, nominal] = halves(x);
        let by = |(p, n): (&f32, &f32)| (f64::from(*p) - f64::from(*n)) / f64::from(radius);
        let perturbation = perturbed.iter().zip(nominal).map(by);
        self.of_plain(nominal).into_iter().chain(perturbation).collect()
    }

    /// The coordinates of a start of the region.
    fn of_plain(&self, x: &[f32]) -> Vec<f64> {
        let at = |&i: &usize| match &self.region {
            Region::Box { low, high } => {
                let [middle, half] = middle_and_half(low[i], high[i]);
                (f64::from(x[i]) - middle) / half
            }
            Region::Ball(ball) => {
                (f64::from(x[i]) - f64::from(ball.center[i])) / f64::from(ball.radius)
            }
            Region::Ellipsoid(set) => {
                (f64::from(x[i]) - f64::from(set.center[i])) / f64::from(set.half_axes[i])
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
