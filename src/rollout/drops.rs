//! Margin drops of pairs, and the score of starts: the tightening that a start just bears.

use super::fold::{Fold, HUGE};
use super::replay::{Margins, PairMargins};
use super::spec::{Effect, RolloutSpec, Tightening};
use crate::model::Role;

/// What margins are measured in at each step: `rho_t` and `kappa_t`, `[T + 1]` each, above 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Shapes {
    /// `rho_t` of the target margin.
    pub target: Vec<f64>,
    /// `kappa_t` of the constraint margin.
    pub constraint: Vec<f64>,
}

impl Shapes {
    /// The units with which the score is the reach-avoid measure itself: `1 / gamma^t` at step t. Points inside a
    /// period have those of the sample after them, so that with points only the sign is that of the measure.
    pub fn of_discount(spec: &RolloutSpec) -> Self {
        let gamma = f64::from(spec.gamma);
        let units: Vec<f64> =
            (0..=spec.horizon).map(|t| gamma.powi(-(t as i32)).min(f64::from(HUGE))).collect();
        Self { target: units.clone(), constraint: units }
    }

    /// What the margins lose at `level`: `level rho_t` and `level kappa_t`, rounded up to f32.
    pub fn tightening(&self, level: f64) -> Tightening {
        let lost = |shape: &Vec<f64>| -> Vec<f32> {
            let lost = shape.iter().map(|unit| (level * unit).min(f64::from(HUGE)));
            lost.map(|lost| if lost == 0.0 { 0.0 } else { (lost as f32).next_up() }).collect()
        };
        Tightening::losing(lost(&self.target), lost(&self.constraint))
    }

    /// The margins in these units, so that with gamma = 1 the measure is the score of a start: the least
    /// level at which it is not certified any more.
    pub fn units(&self) -> Tightening {
        let factor = |unit: &f64| (unit.recip() as f32).clamp(f32::MIN_POSITIVE, HUGE);
        Tightening {
            target: self.target.iter().map(factor).collect(),
            constraint: self.constraint.iter().map(factor).collect(),
            effect: Effect::Multiplied,
        }
    }

    /// The score of a nominal rollout: the least level at which it is not certified any more, in f64.
    /// Minus [`HUGE`] where it was no success when something was no number.
    pub fn score(&self, margins: &[Margins]) -> f64 {
        let huge = f64::from(HUGE);
        let bounded = |x: f64| x.clamp(-huge, huge);
        let mut fold = Fold::new();
        let counts = |margins: &&Margins| margins.role != Role::OVER && margins.are_numbers();
        for margins in margins.iter().take_while(counts) {
            let [target, constraint] = self.scaled(margins).map(bounded);
            fold.look(margins.role, target, constraint);
        }
        fold.measure()
    }

    /// The largest drop of a pair in these units, section 3 of `docs/method.md`: over the margins that count
    /// and the steps before the nominal rollout fails its task. Minus infinity where there is no such step.
    pub fn largest(&self, pair: &PairMargins) -> f64 {
        let scaled = drops(pair).map(|drop| {
            let [target, constraint] = self.scaled(&drop);
            target.max(constraint)
        });
        scaled.fold(f64::NEG_INFINITY, f64::max)
    }

    /// `margins` of target and constraint in the units of their step; a point has those of the sample after it.
    pub(crate) fn scaled(&self, margins: &Margins) -> [f64; 2] {
        let step = margins.moment.sample();
        [margins.target / self.target[step], margins.constraint / self.constraint[step]]
    }
}

/// How far the margins of the perturbed rollout lie below those of the nominal one, look by look up to,
/// and without, the first one that decides the nominal rollout as failed: a margin that has to hold is not above
/// 0, or a margin that counts or a state of it is no number; or up to the end of the task.
///
/// Infinite where the perturbed rollout has no number; two equal infinite margins drop 0, and one that does not
/// count minus infinity.
pub fn drops(pair: &PairMargins) -> impl Iterator<Item = Margins> {
    let both = pair.nominal.iter().zip(&pair.perturbed);
    both.take_while(|(nominal, _)| nominal.is_open()).map(|(nominal, perturbed)| {
        let (moment, role) = (nominal.moment, nominal.role);
        let counted = |counts: bool, nominal: f64, other: f64| match counts || other.is_nan() {
            true => drop(nominal, other),
            false => f64::NEG_INFINITY,
        };
        Margins {
            moment,
            role,
            target: counted(role.sees_target(), nominal.target, perturbed.target),
            constraint: counted(role.sees_constraint(), nominal.constraint, perturbed.constraint),
        }
    })
}

/// How far `perturbed` lies below `nominal`, rounded up.
fn drop(nominal: f64, perturbed: f64) -> f64 {
    match () {
        () if perturbed.is_nan() => f64::INFINITY,
        () if nominal == perturbed => 0.0,
        () => (nominal - perturbed).next_up(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Moment;
    use crate::rollout::{RolloutSpec, replay};

    fn rollout(margins: &[[f64; 2]]) -> Vec<Margins> {
        let role = Role::REACH_AVOID;
        (0..).zip(margins).map(|(t, both)| Margins::of(Moment::from(t), role, *both)).collect()
    }

    fn z(shapes: &Shapes, nominal: &[[f64; 2]], perturbed: &[[f64; 2]]) -> f64 {
        let (nominal, perturbed) = (rollout(nominal), rollout(perturbed));
        shapes.largest(&PairMargins { nominal, perturbed })
    }

    #[test]
    fn drops_count_before_the_violation_of_the_nominal_rollout() {
        let shapes = Shapes { target: vec![1.0, 2.0, 4.0], constraint: vec![1.0, 1.0, 0.5] };
        let close = |found: f64, wanted: f64| {
            assert!(found >= wanted && found <= wanted + 1e-12, "{found}, not {wanted}");
        };
        let nominal = [[-1.0, 1.0], [0.0, 1.0], [1.0, 1.0]];
        close(z(&shapes, &nominal, &[[-1.5, 1.0], [-3.0, 1.0], [1.0, 0.5]]), 1.5);
        close(z(&shapes, &nominal, &[[-1.5, 1.0], [0.0, 1.0], [1.0, -0.5]]), 3.0);
        // A perturbed rollout that is better has a drop below 0.
        close(z(&shapes, &nominal, &[[0.0, 2.0], [1.0, 2.0], [3.0, 2.0]]), -0.5);
        let (nan, inf) = (f64::NAN, f64::INFINITY);
        assert_eq!(z(&shapes, &nominal, &[[-1.0, 1.0], [nan, nan], [nan, nan]]), inf);
        // The step of the violation, and what comes after it, does not count.
        for violated in [0.0, -1.0, nan] {
            let fails = [[-1.0, 1.0], [0.0, violated], [1.0, 1.0]];
            close(z(&shapes, &fails, &[[-1.25, 1.0], [-9.0, nan], [nan, nan]]), 0.25);
        }
        assert_eq!(z(&shapes, &[[0.0, -1.0]; 3], &nominal), f64::NEG_INFINITY);
        let clear = [[1.0, inf], [1.0, inf], [1.0, 1.0]];
        assert_eq!(z(&shapes, &clear, &clear), 0.0);
        assert_eq!(z(&shapes, &clear, &[[1.0, inf], [1.0, 5.0], [1.0, 1.0]]), inf);
    }

    /// The score is the level at which the measure with tightened margins changes its sign.
    #[test]
    fn a_start_is_certified_exactly_below_its_score() {
        let shapes = Shapes { target: vec![0.1, 0.2, 0.4], constraint: vec![0.3, 0.1, 0.2] };
        let spec = RolloutSpec::new(2, 0.9).expect("a horizon");
        let plain = RolloutSpec::new(2, 1.0).expect("a horizon");
        for margins in [
            [[-1.0, 1.0], [0.5, 0.75], [1.0, -1.0]],
            [[0.25, 0.5], [0.5, 0.75], [1.0, 1.0]],
            [[0.25, 0.0], [0.5, 0.75], [1.0, 1.0]],
            [[0.25, 3.0], [0.5, 3.0], [-1.0, f64::NAN]],
        ] {
            let margins = rollout(&margins);
            let score = replay::measure_of(&margins, &plain, &shapes.units());
            let certified =
                |level: f64| replay::measure_of(&margins, &spec, &shapes.tightening(level)) > 0.0;
            assert_eq!(score > 0.0, certified(0.0), "{margins:?}: {score}");
            if score > 0.0 {
                assert!(certified(score * (1.0 - 1e-6)) && !certified(score * (1.0 + 1e-6)));
            }
        }
    }
}
