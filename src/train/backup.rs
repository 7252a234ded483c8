//! The backup of tasks without a time: what a state is worth, given what the next one is.

use crate::model::{Model, Task};
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

    /// What of them counts to `task`, one without a time: a target that it does not have is never met, a
    /// constraint always kept. Their backups are then `min(c, gamma next)` and `max(r, gamma next)`.
    #[must_use]
    pub fn counted(self, task: &Task) -> Self {
        match task {
            Task::Avoid => Self { target: R::lit(f32::MIN), ..self },
            Task::Reach(_) => Self { constraint: R::lit(f32::MAX), ..self },
            _ => self,
        }
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
    use crate::model::Window;
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

    /// The same of the tasks that see one margin alone, the worth after the last state being that of nothing
    /// lost, and of nothing reached.
    #[test]
    fn backups_of_one_margin_unroll_to_its_extreme() {
        let margins = |t: usize| Margins {
            target: (0.7 * t as f64).sin(),
            constraint: 0.4 + (1.3 * t as f64).cos(),
        };
        let folded = |task: Task, last: f64| {
            (0..12).rev().fold(last, |next, t| margins(t).counted(&task).backup(0.95, next))
        };
        let discounted =
            |of: fn(Margins<f64>) -> f64| move |t: usize| 0.95_f64.powi(t as i32) * of(margins(t));
        let least = (0..12).map(discounted(|at| at.constraint)).fold(f64::INFINITY, f64::min);
        let most = (0..12).map(discounted(|at| at.target)).fold(f64::NEG_INFINITY, f64::max);
        assert!((folded(Task::Avoid, f64::INFINITY) - least).abs() < 1e-12);
        assert!((folded(Task::Reach(Window::default()), f64::NEG_INFINITY) - most).abs() < 1e-12);
    }

    #[test]
    fn a_value_is_held_between_what_the_margins_say() {
        let margins = Margins { target: -1.0, constraint: 0.5 };
        assert_eq!([-9.0, 0.2, 9.0].map(|value| margins.hold(value)), [-1.0, 0.2, 0.5]);
        let violated = Margins { target: 2.0, constraint: -0.5 };
        assert_eq!([-9.0, 9.0].map(|value| violated.hold(value)), [-0.5; 2]);
    }
}
