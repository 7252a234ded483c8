//! Lipschitz constants of a system's margins, from its own functions (`docs/method.md`, section 8).

use crate::real::bound::{Domain, Lipschitz, lipschitz};
use crate::rollout::philox;
use crate::system::System;

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

/// Constants of the margins that hold for any two states of the box which differ only in
/// coordinates that `varies` marks.
///
/// States outside the box are not covered: widen it by the deviation that it is used with.
///
/// # Panics
/// If a lower end is above its upper end.
pub fn margins<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    low: [f32; NX],
    high: [f32; NX],
    varies: [bool; NX],
) -> MarginConstants {
    let domain = Domain { low: &low.map(f64::from), high: &high.map(f64::from), varies: &varies };
    MarginConstants {
        target: lipschitz(domain, |x| system.target(std::array::from_fn(|i| x[i]))),
        constraint: lipschitz(domain, |x| system.constraint(std::array::from_fn(|i| x[i]))),
    }
}

/// Largest slopes of the margins along their own numerical gradients at `count` random states.
///
/// Half of the coordinates are drawn at the ends of the box, where slopes are often largest. Each
/// figure is a slope between two states of the box, so up to rounding no constant is below it.
pub fn sampled<S: System<NX, NU>, const NX: usize, const NU: usize>(
    system: &S,
    low: [f32; NX],
    high: [f32; NX],
    varies: [bool; NX],
    count: u32,
    seed: u64,
) -> SampledSlopes {
    let (low, high) = (low.map(f64::from), high.map(f64::from));
    let mut largest = SampledSlopes { target: 0.0, constraint: 0.0 };
    for index in 0..count {
        let start = state(low, high, index, seed);
        let climb = |margin: &dyn Fn([f64; NX]) -> f64| slope(margin, start, low, high, varies);
        largest.target = largest.target.max(climb(&|x| system.target(x)));
        largest.constraint = largest.constraint.max(climb(&|x| system.constraint(x)));
    }
    largest
}

/// A random state, each coordinate within its side or at one of the two ends.
fn state<const NX: usize>(low: [f64; NX], high: [f64; NX], index: u32, seed: u64) -> [f64; NX] {
    let key = [seed as u32, (seed >> 32) as u32];
    std::array::from_fn(|i| {
        let [[place], [end], ..] = philox([[index], [i as u32], [0], [0]], key);
        let share = f64::from(place) / f64::from(u32::MAX);
        let share = if end.is_multiple_of(2) { share } else { share.round() };
        low[i] + share * (high[i] - low[i])
    })
}

/// The slope from `start` along the numerical gradient of `margin`, staying in the box.
fn slope<const NX: usize>(
    margin: &dyn Fn([f64; NX]) -> f64,
    start: [f64; NX],
    low: [f64; NX],
    high: [f64; NX],
    varies: [bool; NX],
) -> f64 {
    // Large against the rounding of the margins (1e-16 of their size), small against the box.
    const STEP: f64 = 1e-5;
    let moved = |direction: [f64; NX], length: f64| -> [f64; NX] {
        std::array::from_fn(|i| (start[i] + length * direction[i]).clamp(low[i], high[i]))
    };
    let mut gradient = [0.0; NX];
    for i in (0..NX).filter(|&i| varies[i]) {
        let axis = std::array::from_fn(|j| f64::from(u8::from(i == j)));
        let (back, ahead) = (moved(axis, -STEP), moved(axis, STEP));
        if ahead[i] > back[i] {
            gradient[i] = (margin(ahead) - margin(back)) / (ahead[i] - back[i]);
        }
    }
    let norm = length(gradient);
    if norm == 0.0 {
        return 0.0;
    }
    let direction = gradient.map(|side| side / norm);
    let (back, ahead) = (moved(direction, -STEP), moved(direction, STEP));
    let apart = length::<NX>(std::array::from_fn(|i| ahead[i] - back[i]));
    // A start in a corner may have nowhere to go.
    if apart < STEP {
        return 0.0;
    }
    (margin(ahead) - margin(back)).abs() / apart
}

fn length<const N: usize>(vector: [f64; N]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::{MarginConstants, margins, sampled};
    use crate::system::{Cone, DoubleIntegrator, DroneRace, System};

    /// Constants over the default box; sampled slopes must come to `share` of them, and no farther.
    fn over_default_box<S: System<NX, NU>, const NX: usize, const NU: usize>(
        system: &S,
        varies: [bool; NX],
        share: f64,
    ) -> MarginConstants {
        let states = system.states();
        let low = std::array::from_fn(|i| states[i].low);
        let high = std::array::from_fn(|i| states[i].high);
        let found = margins(system, low, high, varies);
        let slopes = sampled(system, low, high, varies, 2000, 1);
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
            let found = over_default_box(&race, [true; 12], share);
            assert_bounds(found.target.constant, 10.0 * 2.0_f64.sqrt());
            assert_bounds(found.constraint.constant, 10.0 * square.sqrt());
            assert_eq!(found.target.pieces, 6);
            let limited = DroneRace { speed_limit: true, ..race };
            let limited = over_default_box(&limited, [true; 12], share);
            assert_eq!(limited.constraint.constant, found.constraint.constant);
            assert_eq!(limited.constraint.pieces, found.constraint.pieces + 1);
        }
    }

    /// With the opponent frozen: one end of each difference, but the corner of two fences.
    #[test]
    fn frozen_coordinates_do_not_count() {
        let varies = std::array::from_fn(|i| i < 6);
        let found = over_default_box(&DroneRace::default(), varies, 0.99);
        let q = f64::from(0.2_f32);
        assert_bounds(found.target.constant, 10.0);
        // The fences have slope 10 sqrt(2), the cone only 10 sqrt(1 + q^2).
        assert_bounds(found.constraint.constant, 10.0 * 2.0_f64.sqrt().max((1.0 + q * q).sqrt()));
        let opponent = std::array::from_fn(|i| i >= 6);
        let found = over_default_box(&DroneRace::default(), opponent, 0.99);
        assert_bounds(found.constraint.constant, 10.0 * (1.0 + q * q).sqrt());
    }

    #[test]
    fn double_integrator_has_unit_slopes() {
        let found = over_default_box(&DoubleIntegrator::default(), [true; 2], 0.99);
        assert_bounds(found.target.constant, 1.0);
        assert_bounds(found.constraint.constant, 1.0);
    }
}
