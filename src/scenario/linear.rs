//! Exact deviation of linear systems, from the singular values of powers of their state matrix.

use nalgebra::DMatrix;

use crate::model::Model;
use crate::real::bound::{Domain, Enclosure, Interval, enclose};
use crate::system::Axis;

/// Width of a derivative, relative to the largest of the matrix, that is taken to be rounding:
/// 2^-44, five hundred times the spacing of f64, and far below any nonlinearity that matters.
const ROUNDING: f64 = 1.0 / (1_u64 << 44) as f64;
/// Allowance for a singular value, relative to its matrix: 2^-40, four thousand times the
/// spacing of f64. The algorithm is backward stable with a small multiple of that spacing.
const SINGULAR_VALUE: f64 = 1.0 / (1_u64 << 40) as f64;

/// The state matrix `A` `[NX, NX]`, if `step` is `A x + b(u)` for every `x` and each `u` in its
/// bounds, at any step up to `horizon`.
///
/// Every derivative by a state, enclosed over the whole state space and all controls, must be one
/// number up to rounding.
pub fn state_matrix(model: &Model, horizon: u32) -> Option<DMatrix<f64>> {
    let states = model.states.len();
    let ends = |state: f64, side: fn(&Axis) -> f32, step: u32| -> Vec<f64> {
        let controls: Vec<f64> = model.controls.iter().map(|axis| f64::from(side(axis))).collect();
        // The last point of a period comes before the sample after it.
        model.arguments(&vec![state; states], &controls, step)
    };
    let low = ends(f64::NEG_INFINITY, |axis| axis.low, 0);
    let high = ends(f64::INFINITY, |axis| axis.high, horizon);
    let varies: Vec<bool> = (0..low.len()).map(|i| i < states).collect();
    let domain = Domain { low: &low, high: &high, varies: &varies };
    let outputs = enclose(domain, |inputs| model.step.eval(inputs));
    constant_derivatives(&outputs, states)
}

/// The matrix of derivatives, if each is one number over all pieces.
fn constant_derivatives(outputs: &[Enclosure], columns: usize) -> Option<DMatrix<f64>> {
    // A branch on the control alone is no jump in the state; any other is not linear.
    let open = |output: &Enclosure| output.caveats.unbounded || output.caveats.assumed_continuous;
    if outputs.iter().any(open) {
        return None;
    }
    let side = |i: usize, j: usize| {
        let sides = outputs[i].pieces.iter().map(|piece| piece.gradient[j]);
        sides.reduce(Interval::hull).unwrap_or(Interval::ENTIRE)
    };
    let low = DMatrix::from_fn(outputs.len(), columns, |i, j| side(i, j).low);
    let high = DMatrix::from_fn(outputs.len(), columns, |i, j| side(i, j).high);
    let widest = (&high - &low).max();
    let largest = low.amax().max(high.amax());
    (widest <= ROUNDING * largest && largest.is_finite()).then(|| (low + high) * 0.5)
}

/// Largest deviation at t = 0..=`horizon` of any two trajectories under the same controls whose
/// starts are at most `radius` apart: `radius * sigma_max(A^t)` (`docs/method.md`, section 9).
///
/// A supremum, so rounded up: each figure covers the rounding of the entries of `matrix`, of its
/// powers and of the singular values. For the race over 30 steps that is a relative margin below
/// 1e-9. Infinite once the powers leave the range of f64.
///
/// # Panics
/// If `matrix` is not square.
pub fn exact_deviation(matrix: &DMatrix<f64>, radius: f64, horizon: u32) -> Vec<f64> {
    assert!(matrix.is_square(), "a state matrix is square");
    // The computed powers obey M_s = A M_(s-1) + E_s with |E_s| <= share |A| |M_(s-1)| in the
    // Frobenius norm, so A^t = M_t - sum over s of A^(t-s) E_s, and the norms of lower powers of
    // A are known when they are needed. Entries are off by ROUNDING of the largest each, a product
    // by n half spacings of f64.
    let size = matrix.nrows() as f64;
    let share = 2.0 * size * (ROUNDING + f64::EPSILON);
    let scale = matrix.norm();
    let mut power = DMatrix::identity(matrix.nrows(), matrix.nrows());
    let (mut norms, mut errors) = (vec![1.0], vec![]);
    for _ in 0..horizon {
        errors.push(share * scale * power.norm());
        power = matrix * power;
        let norm = largest_singular_value(&power) + carried(&norms, &errors);
        norms.push(if norm.is_nan() { f64::INFINITY } else { norm });
    }
    let up = 1.0 + SINGULAR_VALUE;
    norms.iter().map(|norm| radius * norm * up).collect()
}

/// The sum over s of `norms[t - s] errors[s]`.
fn carried(norms: &[f64], errors: &[f64]) -> f64 {
    let pairs = norms.iter().zip(errors.iter().rev());
    pairs.map(|(norm, error)| norm * error).sum()
}

/// An upper bound of the largest singular value; infinite if an entry is not finite.
fn largest_singular_value(matrix: &DMatrix<f64>) -> f64 {
    // The iteration does not end on NaN.
    if !matrix.iter().all(|entry| entry.is_finite()) {
        return f64::INFINITY;
    }
    matrix.singular_values().max() + SINGULAR_VALUE * matrix.norm()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::{exact_deviation, state_matrix};
    use crate::model::Model;
    use crate::race::system::DroneRace;
    use crate::real::Real;
    use crate::system::{Axis, DoubleIntegrator, System};

    /// The singular values worked out independently (`docs/method.md`, section 9).
    #[test]
    fn race_deviation_is_the_oracle() {
        let expected = [
            (0, 0.1),
            (1, 0.1468),
            (2, 0.1105),
            (3, 0.1161),
            (5, 0.1281),
            (10, 0.1618),
            (15, 0.2000),
            (20, 0.2414),
            (25, 0.2851),
            (30, 0.3303),
        ];
        let matrix =
            state_matrix(&Model::of(DroneRace::default()), 40).expect("the race is linear");
        let found = exact_deviation(&matrix, 0.1, 30);
        assert_eq!(found.len(), 31);
        for (t, deviation) in expected {
            assert!((found[t] - deviation).abs() <= 5e-5, "t = {t}: {}", found[t]);
        }
    }

    /// `A^t = [[1, s], [0, 1]]` has the largest singular value `(s + sqrt(s^2 + 4)) / 2`.
    #[test]
    fn double_integrator_deviation_is_a_tight_supremum() {
        let matrix =
            state_matrix(&Model::of(DoubleIntegrator::default()), 40).expect("it is linear");
        let dt = f64::from(0.1_f32);
        assert_eq!(matrix, DMatrix::from_row_slice(2, 2, &[1.0, dt, 0.0, 1.0]));
        for (t, found) in exact_deviation(&matrix, 2.0, 200).into_iter().enumerate() {
            let s = dt * t as f64;
            let exact = s + s.hypot(2.0);
            assert!(found >= exact && found <= exact * (1.0 + 1e-9), "t = {t}: {found} {exact}");
        }
    }

    /// Entries that are off by their rounding still give an upper bound.
    #[test]
    fn the_margin_covers_the_rounding_of_the_entries() {
        let matrix =
            state_matrix(&Model::of(DoubleIntegrator::default()), 40).expect("it is linear");
        let rounded = &matrix * (1.0 - 0.5 * super::ROUNDING);
        let s = f64::from(0.1_f32) * 200.0;
        let exact = 0.5 * (s + s.hypot(2.0));
        let found = exact_deviation(&rounded, 1.0, 200)[200];
        assert!(found >= exact && found <= exact * (1.0 + 1e-9), "{found} {exact}");
    }

    /// Along a vector of slope sigma the trajectories do come apart that far, never farther.
    #[test]
    fn no_pair_of_race_trajectories_comes_farther_apart() {
        let race = DroneRace::default();
        let matrix = state_matrix(&Model::of(race), 40).expect("the race is linear");
        let bound = exact_deviation(&matrix, 1.0, 40);
        let mut power = DMatrix::identity(12, 12);
        for (t, bound) in bound.into_iter().enumerate() {
            let svd = nalgebra::SVD::new(power.clone(), false, true);
            let directions = svd.v_t.expect("asked for");
            let worst = svd.singular_values.imax();
            let apart = |shift: f64| -> [f64; 12] {
                let mut x = std::array::from_fn(|i| 0.2 + shift * directions[(worst, i)]);
                for s in 0..t as u8 {
                    x = race.step(x, [0.3, -2.0, f64::from(s)]);
                }
                x
            };
            let ends = [apart(-0.5), apart(0.5)];
            let squares = (0..12).map(|i| (ends[0][i] - ends[1][i]).powi(2));
            let reached = squares.sum::<f64>().sqrt();
            assert!(reached <= bound && reached >= bound * (1.0 - 1e-9), "t = {t}");
            power = &matrix * power;
        }
    }

    #[test]
    fn overflow_is_infinite_not_endless() {
        let matrix = DMatrix::from_row_slice(2, 2, &[1e200, 1.0, 0.0, 1e200]);
        let found = exact_deviation(&matrix, 1.0, 3);
        assert!(found[1] >= 1e200 && found[2] == f64::INFINITY && found[3] == f64::INFINITY);
    }

    /// What keeps a planar system from being linear.
    enum Planar {
        Pendulum,
        Dubins,
        Clipped,
        Bilinear,
        Relay,
        Switched,
    }

    impl System<3, 1> for Planar {
        fn name(&self) -> &str {
            "planar"
        }
        fn states(&self) -> [Axis; 3] {
            ["x", "y", "angle"].map(|name| Axis::new(name, "", -1.0, 1.0))
        }
        fn controls(&self) -> [Axis; 1] {
            [Axis::new("turn", "", -1.0, 1.0)]
        }
        fn step<R: Real>(&self, [x, y, angle]: [R; 3], [u]: [R; 1]) -> [R; 3] {
            let (dt, zero) = (R::lit(0.1), R::lit(0.0));
            match self {
                Self::Pendulum => [x, y - dt * angle.sin(), angle + dt * y],
                Self::Dubins => [x + dt * angle.cos(), y + dt * angle.sin(), angle + dt * u],
                Self::Clipped => [x + dt * y.clamp(-dt, dt), y, angle],
                Self::Bilinear => [x + dt * u * y, y, angle],
                Self::Relay => [x.if_lt(zero, x + dt, x - dt), y, angle],
                // Linear: the control alone decides, and both branches have the same matrix.
                Self::Switched => [x + u.if_lt(zero, y + dt, y), y * dt, angle - u.abs()],
            }
        }
        fn target<R: Real>(&self, [x, _, _]: [R; 3]) -> R {
            x
        }
        fn constraint<R: Real>(&self, [x, _, _]: [R; 3]) -> R {
            x
        }
    }

    #[test]
    fn nonlinear_systems_have_no_matrix() {
        use Planar::{Bilinear, Clipped, Dubins, Pendulum, Relay, Switched};
        for system in [Pendulum, Dubins, Clipped, Bilinear, Relay] {
            assert_eq!(state_matrix(&Model::of(system), 40), None);
        }
        let dt = f64::from(0.1_f32);
        let expected = [1.0, 1.0, 0.0, 0.0, dt, 0.0, 0.0, 0.0, 1.0];
        assert_eq!(
            state_matrix(&Model::of(Switched), 40),
            Some(DMatrix::from_row_slice(3, 3, &expected))
        );
    }
}
