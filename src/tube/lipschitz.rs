//! The Lipschitz form: distances grow by the largest slope of a step, margins lose their slope times the distance.

use nalgebra::DMatrix;

use super::{Fold, Nominal, Tube};
use crate::model::{Moment, Plant, Role};
use crate::real::bound::{Bound, Domain, Enclosure, Interval, enclose};
use crate::rollout::PairControl;

/// Allowance for a singular value, relative to its matrix: 2^-40, four thousand times the spacing of f64.
const SINGULAR_VALUE: f64 = 1.0 / (1_u64 << 40) as f64;

impl Tube<'_> {
    /// A number that the measure is nowhere below over the ball, by the published form: the distance
    /// from the nominal at step t is at most `radius` times the product of the steps' Lipschitz constants
    /// (`L^t` of a linear plant), and a margin loses its own constant times that. Each constant holds over a box
    /// around the nominal state that the distance cannot leave.
    pub fn lipschitz_measure(&self, nominal: &Nominal, radius: f64) -> f64 {
        let mut fold = Fold::new(self.spec.gamma);
        let mut distance = Interval::point(radius).magnitude();
        // The distance at the last sample, and the box that it spans there.
        let (mut apart, mut sample) = (distance, Vec::new());
        if !(radius >= 0.0 && radius.is_finite()) {
            return fold.best;
        }
        for (look, set) in nominal.sets.iter().enumerate() {
            let (at, (moment, role)) = (super::ranges(set), self.look(look));
            fold.begin(moment);
            let around = |x: &Interval| *x + Interval::new(-distance, distance);
            let around: Vec<Interval> = at.iter().map(around).collect();
            let lost = |low: f64, slope: f64| {
                (Interval::point(low.max(f64::MIN)) - product(slope, distance)).low
            };
            let [target, constraint] = self.slopes(&around, moment);
            if role.sees_constraint() {
                fold.hold(lost(self.constraint.below(set, moment), constraint));
            }
            if role.sees_target() {
                let low = self.target.below(set, moment);
                // What may be no number fails the rollout from here on; and so may what has no constant.
                if low == f64::NEG_INFINITY || target == f64::INFINITY {
                    break;
                }
                fold.target(role, lost(low, target));
            }
            fold.conclude(role);
            let ended = moment.step == self.spec.horizon || role == Role::OVER;
            if fold.safe <= fold.best || ended {
                break;
            }
            if moment.point == 0 {
                (apart, sample) = (distance, around);
            }
            distance = product(self.growth(nominal, &sample, moment), apart).high;
            if !distance.is_finite() {
                break;
            }
        }
        fold.best
    }

    /// Lipschitz constants of the target and the constraint margin over a box, at a moment.
    fn slopes(&self, x: &[Interval], at: Moment) -> [f64; 2] {
        let model = &*self.plant.model;
        let outputs = over(x, &[], |x, _| vec![model.target_at(x, at), model.constraint_at(x, at)]);
        [0, 1].map(|i| open(&outputs[i]).map_or(f64::INFINITY, Enclosure::constant))
    }

    /// The Lipschitz constant, over a box of states at the sample of `moment`, of what comes after the state of
    /// `moment`: under the nominal's controls, or with the policy. Controls are those at the sample, so that the
    /// constant of a part by itself would not do.
    fn growth(&self, nominal: &Nominal, x: &[Interval], Moment { step, point }: Moment) -> f64 {
        let Plant { model, .. } = self.plant;
        let none = Vec::new();
        let replayed = match self.control {
            PairControl::Replay => nominal.controls.get(step as usize).unwrap_or(&none),
            PairControl::ClosedLoop => &none,
        };
        let u: Vec<Interval> = replayed.iter().map(|control| control.range).collect();
        let outputs = over(x, &u, |x, u| match self.control {
            PairControl::Replay => model.parts(x, u, step).swap_remove(point as usize),
            PairControl::ClosedLoop => {
                model.parts(x, &self.plant.control(x, step), step).swap_remove(point as usize)
            }
        });
        spectral(&outputs, x.len())
    }
}

/// The product of two numbers that are not negative.
fn product(a: f64, b: f64) -> Interval {
    Interval::new(0.0, (Interval::point(a) * Interval::point(b)).high)
}

/// Values and gradients of `formula` by the states of a box, for all controls `u`.
fn over(
    x: &[Interval],
    u: &[Interval],
    formula: impl FnOnce(&[Bound], &[Bound]) -> Vec<Bound>,
) -> Vec<Enclosure> {
    let inputs = || x.iter().chain(u);
    let low: Vec<f64> = inputs().map(|side| side.low).collect();
    let high: Vec<f64> = inputs().map(|side| side.high).collect();
    let varies: Vec<bool> = (0..low.len()).map(|i| i < x.len()).collect();
    enclose(Domain { low: &low, high: &high, varies: &varies }, |inputs| {
        let (x, u) = inputs.split_at(x.len());
        formula(x, u)
    })
}

/// An enclosure whose gradients hold whatever the branches do.
fn open(enclosure: &Enclosure) -> Option<&Enclosure> {
    let caveats = enclosure.caveats;
    (!caveats.unbounded && !caveats.assumed_continuous).then_some(enclosure)
}

/// An upper bound of the largest singular value of every matrix of gradients.
fn spectral(outputs: &[Enclosure], columns: usize) -> f64 {
    if outputs.iter().any(|output| open(output).is_none()) {
        return f64::INFINITY;
    }
    let side = |i: usize, j: usize| {
        let sides = outputs[i].pieces.iter().map(|piece| piece.gradient[j]);
        sides.reduce(Interval::hull).unwrap_or(Interval::ENTIRE)
    };
    let middle = DMatrix::from_fn(outputs.len(), columns, |i, j| {
        0.5 * side(i, j).low + 0.5 * side(i, j).high
    });
    let away = DMatrix::from_fn(outputs.len(), columns, |i, j| {
        (side(i, j) - Interval::point(middle[(i, j)])).magnitude()
    });
    // The iteration does not end on NaN.
    if !middle.iter().chain(away.iter()).all(|entry| entry.is_finite()) {
        return f64::INFINITY;
    }
    let up = 1.0 + SINGULAR_VALUE;
    (middle.singular_values().max() + SINGULAR_VALUE * middle.norm() + away.norm() * up) * up
}
