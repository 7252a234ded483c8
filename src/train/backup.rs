//! The backup of reach-avoid learning: what a state is worth, given what the next one is.

use crate::model::Model;
use crate::real::Real;

/// Both margins of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins<R> {
    /// `r`, positive inside the target set.
    pub target: R,
    /// `c`, positive where safe.
    pub constraint: R,
}

impl<R: Real> Margins<R> {
    /// The margins of `x` at a step.
    pub fn of(model: &Model, x: &[R], step: u32) -> Self {
        Self { target: model.target_at(x, step), constraint: model.constraint_at(x, step) }
    }

    /// What the state is worth where the next one is worth `next`: `min(c, max(r, gamma next))`,
    /// section 1 of `docs/method.md` unrolled by one step.
    pub fn backup(self, gamma: R, next: R) -> R {
        self.hold(gamma * next)
    }

    /// `value`, moved to where the worth of this state lies whatever follows: between `min(c, r)`
    /// and `c`. A network that tells more is wrong, and this much is known without it.
    pub fn hold(self, value: R) -> R {
        self.constraint.min(self.target.max(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::reach_avoid;

    /// Folded from the end, backups are the measure of the rollout.
    #[test]
    fn backups_unroll_to_the_measure() {
        let wave = |t: usize, rate: f64| (rate * t as f64 + 0.3).sin();
        for shift in 0..50 {
            let margins: Vec<(f64, f64)> =
                (shift..shift + 12).map(|t| (wave(t, 0.7), wave(t, 1.3) + 0.4)).collect();
            let of = |&(target, constraint)| Margins { target, constraint };
            let last = of(&margins[11]).hold(f64::NEG_INFINITY);
            let folded =
                margins[..11].iter().rev().fold(last, |next, pair| of(pair).backup(0.95, next));
            assert!((folded - reach_avoid(margins, 0.95)).abs() < 1e-12, "{shift}");
        }
    }

    #[test]
    fn a_value_is_held_between_what_the_margins_say() {
        let margins = Margins { target: -1.0, constraint: 0.5 };
        assert_eq!([-9.0, 0.2, 9.0].map(|value| margins.hold(value)), [-1.0, 0.2, 0.5]);
        let violated = Margins { target: 2.0, constraint: -0.5 };
        assert_eq!([-9.0, 9.0].map(|value| violated.hold(value)), [-0.5; 2]);
    }
}
