//! The filter against bisection, a grid, and the plant written out by hand.

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
    let p: [f64; 3] = [0, 2, 4].map(|i| x[i] + 0.2 * x[i + 1] + 0.005 * u[i / 2] - after[i + 6]);
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
    for failed in [Solver::MaxIterations, Solver::NumericalError, Solver::InsufficientProgress] {
        assert_eq!(status(failed), FilterStatus::Failed);
    }
}
