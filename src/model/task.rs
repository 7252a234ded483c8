//! Tasks: what a rollout has to do, and what each of its steps is to that.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Role;
use crate::error::{Error, Result};

/// What a rollout x_0..=x_T has to do, `docs/method.md`, section 1; r is the target margin, c the constraint
/// margin.
///
/// ```
/// use reachcast::model::{Role, Task};
/// // From step 3 of 5 on, the target has to hold.
/// let task = Task::ReachStay { by: Some(3) };
/// let required = |step: u32| task.role(step, 5).has(Role::REQUIREMENT);
/// assert_eq!([0, 2, 3, 5].map(required), [false, false, true, true]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Task {
    /// Be in the target at a step of the window, safe up to it.
    ReachAvoid(Window),
    /// Be safe at all steps.
    Avoid,
    /// Be in the target at a step of the window.
    Reach(Window),
    /// Be safe at all steps, and in the target at each from step `by` on.
    ReachStay {
        /// The step; the last one where nothing is said.
        by: Option<u32>,
    },
    /// Be safe at all steps, and in the target at the last one.
    AtEnd,
}

/// Steps at which the target counts: `from..=to`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Window {
    /// The first.
    pub from: u32,
    /// The last; that of the rollout where nothing is said.
    pub to: Option<u32>,
}

impl Default for Task {
    fn default() -> Self {
        Self::ReachAvoid(Window::default())
    }
}

/// As texts have it: `reach-avoid from 2 to 9`, in steps.
impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind())?;
        match *self {
            Self::ReachAvoid(window) | Self::Reach(window) => write!(f, "{window}"),
            Self::ReachStay { by: Some(by) } => write!(f, " by {by}"),
            Self::ReachStay { by: None } | Self::Avoid | Self::AtEnd => Ok(()),
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.from > 0 {
            write!(f, " from {}", self.from)?;
        }
        self.to.map_or(Ok(()), |to| write!(f, " to {to}"))
    }
}

impl Window {
    /// The last of its steps in a rollout of `horizon` steps.
    fn last(self, horizon: u32) -> u32 {
        self.to.unwrap_or(horizon).min(horizon)
    }

    /// [`Role::CHANCE`] within the window.
    fn chance(self, step: u32) -> Role {
        if step < self.from { Role::LIVE } else { Role::CHANCE }
    }

    fn check(self, horizon: u32) -> Result<()> {
        within("model.task.from", self.from, horizon)?;
        let to = self.to.unwrap_or(horizon);
        within("model.task.to", to, horizon)?;
        if self.from > to {
            let problem = format!("step {to} comes before step {}, `from`", self.from);
            return Err(Error::invalid("model.task.to", problem));
        }
        Ok(())
    }
}

/// Refuses a step beyond the horizon.
fn within(key: &str, step: u32, horizon: u32) -> Result<()> {
    if step > horizon {
        let problem = format!(
            "step {step} lies beyond the horizon of {horizon} steps; take an earlier one or a longer horizon"
        );
        return Err(Error::invalid(key, problem));
    }
    Ok(())
}

impl Task {
    /// The name of its kind, as texts have it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::ReachAvoid(_) => "reach-avoid",
            Self::Avoid => "avoid",
            Self::Reach(_) => "reach",
            Self::ReachStay { .. } => "reach-stay",
            Self::AtEnd => "at-end",
        }
    }

    /// Whether it is reach-avoid over the whole rollout: every step has the same role.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// Whether what a state is worth is the same at every step of an endless rollout: no window, no deadline.
    pub fn is_timeless(&self) -> bool {
        match self {
            Self::ReachAvoid(window) | Self::Reach(window) => *window == Window::default(),
            Self::Avoid => true,
            Self::ReachStay { .. } | Self::AtEnd => false,
        }
    }

    /// Whether it has a target.
    pub fn has_target(&self) -> bool {
        *self != Self::Avoid
    }

    /// Whether it has a constraint.
    pub fn has_constraint(&self) -> bool {
        !matches!(self, Self::Reach(_))
    }

    /// Whether a rollout that is in the target at its first state has reached it.
    pub fn is_reached_at_once(&self) -> bool {
        matches!(self, Self::ReachAvoid(window) | Self::Reach(window) if window.from == 0)
    }

    /// The last step that matters in a rollout of `horizon` steps: what comes after it changes no measure.
    pub fn last(&self, horizon: u32) -> u32 {
        match self {
            Self::ReachAvoid(window) | Self::Reach(window) => window.last(horizon),
            Self::Avoid | Self::ReachStay { .. } | Self::AtEnd => horizon,
        }
    }

    /// What step `step` of a rollout of `horizon` steps is to it.
    pub fn role(&self, step: u32, horizon: u32) -> Role {
        if step > self.last(horizon) {
            return Role::OVER;
        }
        match self {
            Self::ReachAvoid(window) => SAFE.with(window.chance(step)),
            Self::Reach(window) => Role::LIVE.with(window.chance(step)),
            Self::Avoid => held(step, horizon, horizon + 1),
            Self::ReachStay { by } => held(step, horizon, by.unwrap_or(horizon)),
            Self::AtEnd => held(step, horizon, horizon),
        }
    }

    /// The roles of the steps 0..=`horizon`.
    pub fn roles(&self, horizon: u32) -> Vec<Role> {
        (0..=horizon).map(|step| self.role(step, horizon)).collect()
    }

    /// Refuses times beyond the horizon, and a window without a step.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key, the step and the horizon.
    pub fn check(&self, horizon: u32) -> Result<()> {
        match *self {
            Self::ReachAvoid(window) | Self::Reach(window) => window.check(horizon),
            Self::ReachStay { by: Some(by) } => within("model.task.by", by, horizon),
            Self::ReachStay { by: None } | Self::Avoid | Self::AtEnd => Ok(()),
        }
    }
}

/// The constraint has to hold.
const SAFE: Role = Role::LIVE.with(Role::CONSTRAINT);

/// The role of a step where all that matters has to hold at all times: the constraint, and from step `by` on
/// the target.
fn held(step: u32, horizon: u32, by: u32) -> Role {
    let target = if step >= by { Role::REQUIREMENT } else { Role::OVER };
    let end = if step == horizon { Role::CONCLUSION } else { Role::OVER };
    SAFE.with(target).with(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(from: u32, to: u32) -> Window {
        Window { from, to: Some(to) }
    }

    #[test]
    fn the_open_window_is_the_default_and_gives_every_step_one_role() {
        let plain = Task::default();
        assert!(plain.is_plain() && !Task::ReachAvoid(window(0, 4)).is_plain());
        assert_eq!(plain.roles(4), [Role::REACH_AVOID; 5]);
        assert_eq!(Task::ReachAvoid(window(0, 4)).roles(4), [Role::REACH_AVOID; 5]);
    }

    #[test]
    fn windows_begin_and_end_where_they_say() {
        let reach = Task::Reach(window(1, 2));
        let chance = Role::LIVE.with(Role::CHANCE);
        assert_eq!(reach.roles(4), [Role::LIVE, chance, chance, Role::OVER, Role::OVER]);
        assert_eq!((reach.last(4), Task::default().last(4), Task::AtEnd.last(4)), (2, 4, 4));
    }

    #[test]
    fn what_has_to_hold_at_all_times_is_concluded_at_the_end() {
        let safe = Role::LIVE.with(Role::CONSTRAINT);
        let both = safe.with(Role::REQUIREMENT);
        assert_eq!(Task::Avoid.roles(2), [safe, safe, safe.with(Role::CONCLUSION)]);
        let end = both.with(Role::CONCLUSION);
        assert_eq!(Task::AtEnd.roles(2), [safe, safe, end]);
        assert_eq!(Task::ReachStay { by: None }.roles(2), Task::AtEnd.roles(2));
        assert_eq!(Task::ReachStay { by: Some(1) }.roles(2), [safe, both, end]);
        assert_eq!(Task::ReachStay { by: Some(0) }.roles(1), [both, end]);
    }

    #[test]
    fn a_task_is_written_as_texts_have_it() {
        let words = |task: Task| task.to_string();
        assert_eq!(words(Task::default()), "reach-avoid");
        assert_eq!(words(Task::ReachAvoid(window(2, 9))), "reach-avoid from 2 to 9");
        assert_eq!(words(Task::Reach(window(0, 9))), "reach to 9");
        assert_eq!(words(Task::ReachStay { by: Some(3) }), "reach-stay by 3");
        assert_eq!(words(Task::AtEnd), "at-end");
    }

    #[test]
    fn times_beyond_the_horizon_are_refused() {
        for (task, words) in [
            (Task::Reach(window(2, 7)), "model.task.to: step 7 lies beyond the horizon of 5"),
            (Task::ReachAvoid(Window { from: 6, to: None }), "model.task.from: step 6 lies"),
            (Task::Reach(window(3, 2)), "model.task.to: step 2 comes before step 3"),
            (Task::ReachStay { by: Some(6) }, "model.task.by: step 6 lies"),
        ] {
            let found = task.check(5).expect_err(words).to_string();
            assert!(found.contains(words), "no `{words}` in: {found}");
        }
        Task::Reach(window(5, 5)).check(5).expect("a window of one step");
        Task::ReachStay { by: Some(5) }.check(5).expect("the last step");
    }
}
