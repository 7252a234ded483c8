//! The control barrier filter: the control closest to a nominal one that keeps the drones apart.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, SupportedConeT,
};

use crate::system::{DroneRace, System};

/// The solver's tolerance, absolute and relative, on duality gap and feasibility; the costs are
/// of the order of 1.
const TOLERANCE: f64 = 1e-11;

/// How many steps ahead the barrier looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
mod tests {
    use super::*;

    /// Uniform numbers in [-1, 1), a linear congruential generator.
    struct Uniform(u64);

    impl Uniform {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            ((self.0 >> 40) as f32) / (1 << 23) as f32 - 1.0
        }

        /// Drones within about 0.4 m, the ego faster; one control in three at a bound.
        fn case(&mut self) -> ([f32; 12], [f32; 3]) {
            let mut x = [0.0; 12].map(|_: f32| 0.25 * self.next());
            x[3] += 0.6;
            x[9] += 0.2;
            let u = [0.0; 3].map(|_: f32| (1.5 * self.next()).clamp(-1.0, 1.0));
            (x, u)
        }
    }

    /// The constraint written out for the plant by hand, in another order than in the filter.
    fn by_hand(filter: &BarrierFilter, x: [f32; 12], u: [f32; 3]) -> Barrier {
        let race = DroneRace::default();
        let (x, u) = (x.map(f64::from), u.map(f64::from));
        let next = race.step(x, u);
        let after = race.step(next, [0.0; 3]);
        let h = |x: [f64; 12]| {
            let up = if filter.widening == Widening::Heights { [10, 4] } else { [11, 5] };
            let rho = 0.2 + 0.2 * (x[up[0]] - x[up[1]]).max(0.0);
            (x[0] - x[6]).powi(2) + (x[2] - x[8]).powi(2) + (x[4] - x[10]).powi(2) - rho * rho
        };
        if filter.form == BarrierForm::OneStep {
            return Barrier { gain: [0.0; 3], need: 0.4 * h(x) - h(next) };
        }
        // p_(t+2) = p + 2 dt v + dt^2 gain u, so its derivative is 0.1^2 0.5 on each axis.
        let p: [f64; 3] =
            [0, 2, 4].map(|i| x[i] + 0.2 * x[i + 1] + 0.005 * u[i / 2] - after[i + 6]);
        Barrier { gain: p.map(|p| 2.0 * p * 0.005), need: 0.16 * h(x) - h(after) }
    }

    /// The optimum by bisection: what the multiplier yields grows with it.
    fn bisected(barrier: &Barrier, u: [f64; 3], weight: f64) -> ([f64; 3], f64) {
        let [mut low, mut high] = [0.0, weight * barrier.need.max(0.0)];
        let control = |m: f64| [0, 1, 2].map(|i| (u[i] + m * barrier.gain[i]).clamp(-1.0, 1.0));
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            let moved: f64 = (0..3).map(|i| barrier.gain[i] * (control(middle)[i] - u[i])).sum();
            *(if moved + middle / weight < barrier.need { &mut low } else { &mut high }) = middle;
        }
        (control(high), high / weight)
    }

    #[test]
    fn two_step_filter_finds_the_optimum() {
        let (filter, race) = (BarrierFilter::RIGOROUS, DroneRace::default());
        let mut uniform = Uniform(7);
        let (mut active, mut saturated) = (0, 0);
        for case in 0..3000 {
            let (x, u) = uniform.case();
            let found = filter.filter(&race, &x, u);
            let barrier = by_hand(&filter, x, u);
            let (control, slack) = bisected(&barrier, u.map(f64::from), filter.slack_weight);
            assert_eq!(found.status, FilterStatus::Solved, "case {case}");
            for (have, want) in found.control.iter().zip(control) {
                assert!((f64::from(*have) - want).abs() < 2e-6, "case {case}: {have}, {want}");
            }
            let error = (found.slack - slack).abs();
            assert!(error < 1e-8, "case {case}: slack {}, {slack}", found.slack);
            active += usize::from(found.control != u);
            saturated += usize::from(slack > 1e-3);
        }
        assert!(active > 500 && saturated > 100, "{active} active, {saturated} saturated");
    }

    /// Constraints that controls can keep, unlike most of the plant's, over four decades of gain.
    #[test]
    fn multiplier_is_that_of_the_optimum() {
        let mut uniform = Uniform(10);
        let mut kept = 0;
        for case in 0..3000 {
            let scale = 10.0_f64.powf(2.0 * f64::from(uniform.next()) - 1.0);
            let gain = [0; 3].map(|_| scale * f64::from(uniform.next()));
            let barrier = Barrier { gain, need: scale * f64::from(uniform.next().abs()) };
            let u = [0; 3].map(|_| (1.5 * f64::from(uniform.next())).clamp(-1.0, 1.0));
            let (status, multiplier) = barrier.multiplier(u, 1e5);
            assert_eq!(status, FilterStatus::Solved, "case {case}");
            let (control, slack) = bisected(&barrier, u, 1e5);
            for (have, want) in barrier.control(u, multiplier).into_iter().zip(control) {
                assert!((have - want).abs() < 2e-6, "case {case}: {have}, {want}");
            }
            assert!((multiplier / 1e5 - slack).abs() < 1e-8, "case {case}: {multiplier}");
            kept += usize::from(slack < 1e-4);
        }
        assert!(kept > 1000, "{kept} kept");
    }

    #[test]
    fn no_grid_point_is_better() {
        let (filter, race) = (BarrierFilter::RIGOROUS, DroneRace::default());
        let mut uniform = Uniform(8);
        let cost = |barrier: &Barrier, u: [f64; 3], v: [f64; 3]| {
            let change = [0, 1, 2].map(|i| v[i] - u[i]);
            let gained: f64 = (0..3).map(|i| barrier.gain[i] * change[i]).sum();
            let slack = (barrier.need - gained).max(0.0);
            0.5 * change.map(|c| c * c).iter().sum::<f64>() + 0.5e5 * slack * slack
        };
        let mut active = 0;
        for case in 0..60 {
            let (x, u) = uniform.case();
            let found = filter.filter(&race, &x, u);
            let (barrier, u) = (by_hand(&filter, x, u), u.map(f64::from));
            let ours = cost(&barrier, u, found.control.map(f64::from));
            active += usize::from(ours > 0.0);
            for i in 0..31_usize.pow(3) {
                let v = [1, 31, 961].map(|stride| (i / stride % 31) as f64 / 15.0 - 1.0);
                let grid = cost(&barrier, u, v);
                assert!(ours <= grid * (1.0 + 1e-5) + 1e-9, "case {case}: {ours}, {v:?} {grid}");
            }
        }
        assert!(active > 10, "{active} active");
    }

    /// The published form: the nominal control, whatever it is, and slack for all that is missing.
    #[test]
    fn one_step_filter_has_no_authority() {
        let race = DroneRace::default();
        let mut uniform = Uniform(9);
        let mut relaxed = 0;
        for widening in [Widening::Velocities, Widening::Heights] {
            let filter = BarrierFilter { widening, ..BarrierFilter::STUDY };
            for _ in 0..1000 {
                let (x, u) = uniform.case();
                let found = filter.filter(&race, &x, u);
                assert_eq!((found.control, found.status), (u, FilterStatus::Solved));
                let missing = by_hand(&filter, x, u).need.max(0.0);
                assert!((found.slack - missing).abs() < 1e-8, "{} {missing}", found.slack);
                relaxed += usize::from(found.slack > 0.0);
            }
        }
        assert!(relaxed > 200, "{relaxed} relaxed");
    }

    #[test]
    fn filter_brakes_behind_the_opponent() {
        let race = DroneRace::default();
        // 0.35 m behind on the same line, 0.6 m/s faster; at 1 m there is time.
        let at = |gap: f32| [0.0, 0.0, -1.0, 0.9, 0.0, 0.0, 0.0, 0.0, gap - 1.0, 0.3, 0.0, 0.0];
        let found = BarrierFilter::RIGOROUS.filter(&race, &at(0.35), [0.0, 1.0, 0.0]);
        assert_eq!([found.control[0], found.control[2]], [0.0, 0.0]);
        assert!(found.control[1] < 1.0 && found.slack > 0.0, "{found:?}");
        let far = BarrierFilter::RIGOROUS.filter(&race, &at(1.0), [0.0, 1.0, 0.0]);
        assert_eq!((far.control, far.slack), ([0.0, 1.0, 0.0], 0.0));
    }

    #[test]
    fn nominal_controls_are_clipped() {
        let far = [0.0, 0.0, -1.0, 0.5, 0.0, 0.0, 0.0, 0.0, -3.0, 0.3, 0.0, 0.0];
        let found = BarrierFilter::RIGOROUS.filter(&DroneRace::default(), &far, [3.0, -2.0, 0.5]);
        assert_eq!(found.control, [1.0, -1.0, 0.5]);
    }

    #[test]
    fn what_is_not_finite_fails_and_says_so() {
        let race = DroneRace::default();
        let mut x = [0.0; 12];
        x[8] = 0.1;
        let nominal = [0.5, -2.0, 0.0];
        assert_ne!(BarrierFilter::RIGOROUS.filter(&race, &x, nominal).slack, 0.0);
        for bad in [f32::NAN, f32::INFINITY] {
            x[2] = bad;
            let found = BarrierFilter::RIGOROUS.filter(&race, &x, nominal);
            let expected =
                Filtered { control: [0.5, -1.0, 0.0], slack: 0.0, status: FilterStatus::Failed };
            assert_eq!(found, expected);
        }
        let found = BarrierFilter::RIGOROUS.filter(&race, &[0.1; 12], [f32::NAN, 0.0, 0.0]);
        assert_eq!(found.status, FilterStatus::Failed);
    }

    #[test]
    fn outcomes_of_the_solver() {
        use SolverStatus as Solver;
        assert_eq!(status(Solver::AlmostSolved), FilterStatus::Inaccurate);
        for infeasible in [Solver::PrimalInfeasible, Solver::AlmostDualInfeasible] {
            assert_eq!(status(infeasible), FilterStatus::Infeasible);
        }
        for failed in [Solver::MaxIterations, Solver::NumericalError, Solver::InsufficientProgress]
        {
            assert_eq!(status(failed), FilterStatus::Failed);
        }
    }
}
