//! The control barrier filter: the control closest to a nominal one that keeps the drones apart.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, SupportedConeT,
};

use crate::race::system::DroneRace;
use crate::system::System;

/// The solver's tolerance, absolute and relative, on duality gap and feasibility; the costs are
/// of the order of 1.
const TOLERANCE: f64 = 1e-11;

/// How many steps ahead the barrier looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BarrierForm {
    /// One, as published. In the Euler plant no control moves the next position, so this filter
    /// returns the nominal control and all shortfall is slack.
    OneStep,
    /// Two, the relative degree of the position: the first positions that a control moves.
    TwoStep,
}

impl BarrierForm {
    fn steps(self) -> usize {
        match self {
            Self::OneStep => 1,
            Self::TwoStep => 2,
        }
    }
}

/// What widens the radius kept around the opponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Widening {
    /// The opponent's excess of upward velocity in m/s, a slip of the published code.
    Velocities,
    /// The opponent's excess of height in m, as in the collision cone.
    Heights,
}

/// The filter, race study section 5: with `h = |p_e - p_o|^2 - rho^2` and
/// `rho = radius (1 + max(0, excess))`, both of the same instant, it solves
///
/// ```text
/// min over u, s of  1/2 |u - u_nom|^2 + 1/2 slack_weight s^2   subject to  |u_i| <= 1,  s >= 0,
/// 2 (p_e - p_o)_(t+k) . (p_(t+k)(u) - p_(t+k)(u_nom)) + h_(t+k) + s >= (1 - rate)^k h_t
/// ```
///
/// with k = 1 or 2 by the form. What stands at t + k without `(u)` is under the nominal control,
/// and the opponent flies by its own feedback. The squared distance is convex, so the linear left
/// side is never above its true value; rho is held at its nominal value, as published.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarrierFilter {
    /// How many steps ahead the barrier looks.
    pub form: BarrierForm,
    /// What widens the radius.
    pub widening: Widening,
    /// Share of the barrier that may be given up in one step, in (0, 1].
    pub rate: f64,
    /// Weight of the squared slack (in m^2) against the squared change of the control; positive.
    pub slack_weight: f64,
    /// Distance kept to the opponent without widening, m.
    pub radius: f64,
}

/// How the filter came to its control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterStatus {
    /// The optimum, within the solver's tolerance.
    Solved,
    /// The optimum, within the solver's reduced tolerance.
    Inaccurate,
    /// The solver found no feasible point; the control is the nominal one.
    Infeasible,
    /// The solver stopped early, or a number was not finite; the control is the nominal one.
    Failed,
}

/// What the filter returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtered {
    /// The control, within its bounds; not finite only where the nominal one is not.
    pub control: [f32; 3],
    /// How far the barrier had to be relaxed, m^2; 0 where the control is the nominal one for
    /// want of a solution.
    pub slack: f64,
    /// How it was found.
    pub status: FilterStatus,
}

/// The barrier at one state as a constraint on the change v of the control: `gain . v + s >= need`.
#[derive(Clone, Copy, Debug)]
struct Barrier {
    gain: [f64; 3],
    need: f64,
}

impl BarrierFilter {
    /// The published filter.
    pub const STUDY: Self = Self {
        form: BarrierForm::OneStep,
        widening: Widening::Velocities,
        rate: 0.6,
        slack_weight: 1e5,
        radius: 0.2,
    };
    /// The filter with authority over the plant and the radius of the collision cone.
    pub const RIGOROUS: Self =
        Self { form: BarrierForm::TwoStep, widening: Widening::Heights, ..Self::STUDY };

    /// The control to fly at `x` instead of `nominal`, which is clipped to the bounds first.
    pub fn filter(&self, system: &DroneRace, x: &[f32; 12], nominal: [f32; 3]) -> Filtered {
        let control = nominal.map(|u| u.clamp(-1.0, 1.0));
        let unchanged = |status| Filtered { control, slack: 0.0, status };
        let nominal = control.map(f64::from);
        let barrier = self.barrier(system, x.map(f64::from), nominal);
        if !barrier.gain.iter().chain([&barrier.need]).all(|value| value.is_finite()) {
            return unchanged(FilterStatus::Failed);
        }
        // No change costs nothing, so where it is feasible it is the optimum.
        if barrier.need <= 0.0 {
            return unchanged(FilterStatus::Solved);
        }
        let (status, multiplier) = barrier.multiplier(nominal, self.slack_weight);
        if !matches!(status, FilterStatus::Solved | FilterStatus::Inaccurate) {
            return unchanged(status);
        }
        let control = barrier.control(nominal, multiplier).map(|u| u as f32);
        Filtered { control, slack: multiplier / self.slack_weight, status }
    }

    /// The constraint at `x`, from the plant itself.
    ///
    /// In the Euler plant `p_(t+1) = p + dt v` and `p_(t+2) = p + 2 dt v + dt^2 gain u`: affine in
    /// u, so that differences of unit controls are the derivative, exactly 0 for one step.
    fn barrier(&self, system: &DroneRace, x: [f64; 12], nominal: [f64; 3]) -> Barrier {
        let ahead = |u: [f64; 3]| {
            // What follows the first control moves no position two steps ahead.
            let next = system.step(x, u);
            (1..self.form.steps()).fold(next, |x, _| system.step(x, [0.0; 3]))
        };
        let reached = ahead(nominal);
        let gradient = offset(reached).map(|distance| 2.0 * distance);
        let still = offset(ahead([0.0; 3]));
        let gain = |axis: usize| {
            let moved = offset(ahead(std::array::from_fn(|i| f64::from(u8::from(i == axis)))));
            (0..3).map(|i| gradient[i] * (moved[i] - still[i])).sum()
        };
        let kept = (1.0 - self.rate).powi(self.form.steps() as i32);
        Barrier {
            gain: std::array::from_fn(gain),
            need: kept * self.margin(x) - self.margin(reached),
        }
    }

    /// The barrier function h, m^2: positive outside the radius.
    fn margin(&self, x: [f64; 12]) -> f64 {
        let [_, _, _, _, ego_z, ego_vz, .., opp_z, opp_vz] = x;
        let excess = match self.widening {
            Widening::Velocities => opp_vz - ego_vz,
            Widening::Heights => opp_z - ego_z,
        };
        let radius = self.radius * (1.0 + excess.max(0.0));
        let squares = offset(x).map(|distance| distance * distance);
        squares.iter().sum::<f64>() - radius * radius
    }
}

impl Barrier {
    /// The multiplier of the constraint at the optimum, by Clarabel's interior-point method.
    ///
    /// Unknowns are the change v of the control and the slack over `scale`, the root of its
    /// weight's inverse: all then weigh 1. The rows are the constraint over `scale`, the bounds
    /// of the control, and that of the slack.
    fn multiplier(&self, nominal: [f64; 3], slack_weight: f64) -> (FilterStatus, f64) {
        let scale = slack_weight.sqrt().recip();
        let [x, y, z] = self.gain.map(|gain| gain / scale);
        let [ux, uy, uz] = nominal;
        let need = self.need / scale;
        let cost = CscMatrix::identity(4);
        let rows = CscMatrix::from(&[
            [-x, -y, -z, -1.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [-1.0, 0.0, 0.0, 0.0],
            [0.0, -1.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, 0.0],
            [0.0, 0.0, 0.0, -1.0],
        ]);
        let most = [-need, 1.0 - ux, 1.0 - uy, 1.0 - uz, 1.0 + ux, 1.0 + uy, 1.0 + uz, 0.0];
        let cones: [SupportedConeT<f64>; 1] = [NonnegativeConeT(most.len())];
        let settings = DefaultSettings {
            tol_gap_abs: TOLERANCE,
            tol_gap_rel: TOLERANCE,
            tol_feas: TOLERANCE,
            verbose: false,
            max_threads: 1,
            ..Default::default()
        };
        let solver = DefaultSolver::new(&cost, &[0.0; 4], &rows, &most, &cones, settings);
        let Ok(mut solver) = solver else { return (FilterStatus::Failed, 0.0) };
        solver.solve();
        (status(solver.solution.status), solver.solution.z[0].max(0.0) / scale)
    }

    /// The control at which the Lagrangian is stationary for this multiplier: `u_nom + multiplier
    /// gain`, clipped; the slack is `multiplier / slack_weight`.
    ///
    /// An interior point stays away from a bound by the root of its tolerance where the optimum
    /// lies on it without pressing, as nominal controls often do; its multiplier does not.
    fn control(&self, nominal: [f64; 3], multiplier: f64) -> [f64; 3] {
        std::array::from_fn(|i| (nominal[i] + multiplier * self.gain[i]).clamp(-1.0, 1.0))
    }
}

/// The ego's position less the opponent's, m.
fn offset(x: [f64; 12]) -> [f64; 3] {
    [x[0] - x[6], x[2] - x[8], x[4] - x[10]]
}

/// The solver's outcome in the filter's terms.
fn status(of: SolverStatus) -> FilterStatus {
    match of {
        SolverStatus::Solved => FilterStatus::Solved,
        SolverStatus::AlmostSolved => FilterStatus::Inaccurate,
        SolverStatus::PrimalInfeasible
        | SolverStatus::DualInfeasible
        | SolverStatus::AlmostPrimalInfeasible
        | SolverStatus::AlmostDualInfeasible => FilterStatus::Infeasible,
        _ => FilterStatus::Failed,
    }
}

#[cfg(test)]
mod tests;
