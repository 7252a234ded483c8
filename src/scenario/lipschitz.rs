//! Lipschitz constants of a system's margins, from its own functions (`docs/method.md`, section 8).

use rayon::prelude::*;

use crate::formula::Graph;
use crate::model::Model;
use crate::real::bound::{Domain, Lipschitz, lipschitz};
use crate::rollout::philox;

/// Lipschitz constants of both margins over one box, in the Euclidean norm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarginConstants {
    /// Of the target margin, `L_r`.
    pub target: Lipschitz,
    /// Of the constraint margin, `L_c`.
    pub constraint: Lipschitz,
}

/// Largest slopes found between sampled points: lower estimates, never valid as constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledSlopes {
    /// Of the target margin.
    pub target: f64,
    /// Of the constraint margin.
    pub constraint: f64,
}

/// Where the margins are looked at.
#[derive(Clone, Copy, Debug)]
pub struct MarginBox<'a> {
    /// Lower end of each state.
    pub low: &'a [f32],
    /// Upper end.
    pub high: &'a [f32],
    /// Whether each state varies.
    pub varies: &'a [bool],
    /// Last step: time and step of the margins run from 0 to there.
    pub horizon: u32,
}

/// Constants of the margins that hold for any two states of the box which differ only in
/// coordinates that `varies` marks, at any one step up to the horizon.
///
/// States outside the box are not covered: widen it by the deviation that it is used with.
///
/// # Panics
/// If a lower end is above its upper end.
pub fn margins(model: &Model, region: MarginBox<'_>) -> MarginConstants {
    let ends = |side: &[f32], step: u32| -> Vec<f64> {
        model.at_state(&side.iter().copied().map(f64::from).collect::<Vec<_>>(), step)
    };
    // No margin reads a control: it is held at 0, and nothing but states varies.
    let (low, high) = (ends(region.low, 0), ends(region.high, region.horizon));
    let mut varies = region.varies.to_vec();
    varies.resize(low.len(), false);
    let domain = Domain { low: &low, high: &high, varies: &varies };
    MarginConstants {
        target: lipschitz(domain, |inputs| model.target.eval(inputs)[0]),
        constraint: lipschitz(domain, |inputs| model.constraint.eval(inputs)[0]),
    }
}

/// Largest slopes of the margins along their own numerical gradients at `count` random states.
///
/// Half of the coordinates are drawn at the ends of the box, where slopes are often largest. Each
/// figure is a slope between two states of the box, less what rounding may have added: a constant
/// below it is wrong.
pub fn sampled(model: &Model, region: MarginBox<'_>, count: u32, seed: u64) -> SampledSlopes {
    let slopes = |index: u32| {
        let (start, step) = (state(region, index, seed), index % (region.horizon + 1));
        let mut values = Vec::new();
        let mut climb = |margin: &Graph| {
            let states = start.len();
            let mut inputs = model.at_state(&start, step);
            slope(region, &start, &mut |x| {
                inputs[..states].copy_from_slice(x);
                margin.eval_first(&inputs, &mut values)
            })
        };
        SampledSlopes { target: climb(&model.target), constraint: climb(&model.constraint) }
    };
    let none = || SampledSlopes { target: 0.0, constraint: 0.0 };
    (0..count).into_par_iter().map(slopes).reduce(none, |a, b| SampledSlopes {
        target: a.target.max(b.target),
        constraint: a.constraint.max(b.constraint),
    })
}

/// A random state, each coordinate within its side or at one of the two ends.
fn state(MarginBox { low, high, .. }: MarginBox<'_>, index: u32, seed: u64) -> Vec<f64> {
    let key = [seed as u32, (seed >> 32) as u32];
    let coordinate = |i: usize| {
        let [[place], [end], ..] = philox([[index], [i as u32], [0], [0]], key);
        let share = f64::from(place) / f64::from(u32::MAX);
        let share = if end.is_multiple_of(2) { share } else { share.round() };
        let (low, high) = (f64::from(low[i]), f64::from(high[i]));
        low + share * (high - low)
    };
    (0..low.len()).map(coordinate).collect()
}

/// The slope from `start` along the numerical gradient of `margin`, staying in the box.
fn slope(region: MarginBox<'_>, start: &[f64], margin: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
    // Large against the rounding of the margins (1e-16 of their size), small against the box.
    const STEP: f64 = 1e-5;
    // Roundings that a margin may be off by.
    const DOUBT: f64 = 64.0;
    let within = |i: usize, x: f64| x.clamp(f64::from(region.low[i]), f64::from(region.high[i]));
    let mut x = start.to_vec();
    let mut gradient = vec![0.0; start.len()];
    for i in (0..start.len()).filter(|&i| region.varies[i]) {
        let (back, ahead) = (within(i, start[i] - STEP), within(i, start[i] + STEP));
        if ahead > back {
            x[i] = ahead;
            let above = margin(&x);
            x[i] = back;
            gradient[i] = (above - margin(&x)) / (ahead - back);
            x[i] = start[i];
        }
    }
    let norm = length(gradient.iter().copied());
    if norm == 0.0 {
        return 0.0;
    }
    let moved = |length: f64| -> Vec<f64> {
        let place = |i: usize| within(i, start[i] + length * (gradient[i] / norm));
        (0..start.len()).map(place).collect()
    };
    let (back, ahead) = (moved(-STEP), moved(STEP));
    let apart = length(ahead.iter().zip(&back).map(|(ahead, back)| ahead - back));
    // A start in a corner may have nowhere to go.
    if apart < STEP {
        return 0.0;
    }
    let (above, below) = (margin(&ahead), margin(&back));
    // Both are rounded, at the size of what they were computed from.
    let size = start.iter().copied().chain([above, below]).map(f64::abs).fold(1.0, f64::max);
    (((above - below).abs() - DOUBT * f64::EPSILON * size) / apart).max(0.0)
}

fn length(vector: impl Iterator<Item = f64>) -> f64 {
    vector.map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::{MarginBox, MarginConstants, margins, sampled};
    use crate::model::Model;
    use crate::race::system::{Cone, DroneRace};
    use crate::system::DoubleIntegrator;

    /// Constants over the default box; sampled slopes must come to `share` of them, and no farther.
    fn over_default_box(model: &Model, varies: &[bool], share: f64) -> MarginConstants {
        let low: Vec<f32> = model.states.iter().map(|axis| axis.low).collect();
        let high: Vec<f32> = model.states.iter().map(|axis| axis.high).collect();
        let region = MarginBox { low: &low, high: &high, varies, horizon: 30 };
        let found = margins(model, region);
        let slopes = sampled(model, region, 2000, 1);
        // A slope over 2e-5 between margins below 1e3 is rounded at 1e-13 / 2e-5.
        let rounding = 1e-8;
        assert!(slopes.target <= found.target.constant + rounding, "{slopes:?}");
        assert!(slopes.constraint <= found.constraint.constant + rounding, "{slopes:?}");
        assert!(slopes.target >= share * found.target.constant, "{slopes:?}");
        assert!(slopes.constraint >= share * found.constraint.constant, "{slopes:?}");
        assert!(!found.target.hulled && !found.constraint.hulled);
        assert!(!found.target.assumed_continuous && !found.constraint.assumed_continuous);
        found
    }

    /// Never below the truth, and at most 1 % above; the truth is rounded to 1 in 1e15.
    fn assert_bounds(constant: f64, truth: f64) {
        assert!(constant >= truth * (1.0 - 1e-15), "{constant} is below {truth}");
        assert!(constant <= truth * 1.01, "{constant} is far above {truth}");
    }

    /// The constants worked out by hand, with `q` the f32 nearest to the cone's 0.2.
    #[test]
    fn race_constants_are_tight() {
        let q = f64::from(0.2_f32);
        let depth = 2.0_f64.powi(2) + f64::from(3.2_f32).powi(2);
        let truths = [
            (Cone::Distance, 2.0 + 2.0 * q * q, 0.99),
            (Cone::Root, 2.0 + q / 2.0, 0.99),
            // Steepest far away, where the fences are the smaller and a sample sees them instead:
            // a piece counts over the whole box, so this is the constant of the cone alone.
            (Cone::Squared, 8.0 * depth + 2.0 * q * q, 0.0),
        ];
        for (cone, square, share) in truths {
            let race = DroneRace { cone, ..DroneRace::default() };
            let found = over_default_box(&Model::of(race), &[true; 12], share);
            assert_bounds(found.target.constant, 10.0 * 2.0_f64.sqrt());
            assert_bounds(found.constraint.constant, 10.0 * square.sqrt());
            assert_eq!(found.target.pieces, 6);
            let limited = DroneRace { speed_limit: true, ..race };
            let limited = over_default_box(&Model::of(limited), &[true; 12], share);
            assert_eq!(limited.constraint.constant, found.constraint.constant);
            assert_eq!(limited.constraint.pieces, found.constraint.pieces + 1);
        }
    }

    /// With the opponent frozen: one end of each difference, but the corner of two fences.
    #[test]
    fn frozen_coordinates_do_not_count() {
        let varies: [bool; 12] = std::array::from_fn(|i| i < 6);
        let found = over_default_box(&Model::of(DroneRace::default()), &varies, 0.99);
        let q = f64::from(0.2_f32);
        assert_bounds(found.target.constant, 10.0);
        // The fences have slope 10 sqrt(2), the cone only 10 sqrt(1 + q^2).
        assert_bounds(found.constraint.constant, 10.0 * 2.0_f64.sqrt().max((1.0 + q * q).sqrt()));
        let opponent: [bool; 12] = std::array::from_fn(|i| i >= 6);
        let found = over_default_box(&Model::of(DroneRace::default()), &opponent, 0.99);
        assert_bounds(found.constraint.constant, 10.0 * (1.0 + q * q).sqrt());
    }

    #[test]
    fn double_integrator_has_unit_slopes() {
        let found = over_default_box(&Model::of(DoubleIntegrator::default()), &[true; 2], 0.99);
        assert_bounds(found.target.constant, 1.0);
        assert_bounds(found.constraint.constant, 1.0);
    }
}
