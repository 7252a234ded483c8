//! A task in the words of a sentence.

use super::{Task, Window};

/// Form of a verb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A start *reaches*.
    One,
    /// Starts *reach*.
    Many,
    /// Rollouts *reached*.
    Past,
}

impl Task {
    /// What a rollout does that does the task, without the time: `reaches the target safely`.
    pub fn deed(&self, form: Form) -> &'static str {
        match (self, form) {
            (Self::ReachAvoid(_), Form::One) => "reaches the target safely",
            (Self::ReachAvoid(_), Form::Many) => "reach the target safely",
            (Self::ReachAvoid(_), Form::Past) => "reached the target safely",
            (Self::Reach(_), Form::One) => "reaches the target",
            (Self::Reach(_), Form::Many) => "reach the target",
            (Self::Reach(_), Form::Past) => "reached the target",
            (Self::Avoid | Self::ReachStay { .. } | Self::AtEnd, Form::One) => "stays safe",
            (Self::Avoid | Self::ReachStay { .. } | Self::AtEnd, Form::Many) => "stay safe",
            (Self::Avoid | Self::ReachStay { .. } | Self::AtEnd, Form::Past) => "stayed safe",
        }
    }

    /// The time that goes with [`Task::deed`] in a rollout of `horizon` steps: `within 30 steps`.
    pub fn time(&self, horizon: u32) -> String {
        match *self {
            Self::ReachAvoid(window) | Self::Reach(window) => window.time(horizon),
            Self::Avoid => format!("for {horizon} steps"),
            Self::ReachStay { by: None } | Self::AtEnd => {
                format!("for {horizon} steps, in the target at the last of them")
            }
            Self::ReachStay { by: Some(by) } => {
                format!("for {horizon} steps, in the target from step {by} on")
            }
        }
    }

    /// The deed with its time: `stays safe for 30 steps`.
    pub fn words(&self, form: Form, horizon: u32) -> String {
        format!("{} {}", self.deed(form), self.time(horizon))
    }

    /// The deed as sentences have it that do not go without a time where the task has times of its own:
    /// `reaches the target safely`, but `stays safe for 30 steps`.
    pub fn short_words(&self, form: Form, horizon: u32) -> String {
        if self.is_plain() { self.deed(form).to_owned() } else { self.words(form, horizon) }
    }
}

impl Window {
    fn time(self, horizon: u32) -> String {
        match (self.from, self.to) {
            (from, Some(to)) if from == to => format!("at step {from}"),
            (0, to) => format!("within {} steps", to.unwrap_or(horizon)),
            (from, to) => format!("at a step from {from} to {}", to.unwrap_or(horizon)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_say_what_the_task_is() {
        let window = |from, to| Window { from, to };
        for (task, words) in [
            (Task::default(), "reaches the target safely within 30 steps"),
            (Task::ReachAvoid(window(0, Some(9))), "reaches the target safely within 9 steps"),
            (Task::ReachAvoid(window(3, None)), "reaches the target safely at a step from 3 to 30"),
            (Task::Reach(window(7, Some(7))), "reaches the target at step 7"),
            (Task::Reach(window(0, Some(0))), "reaches the target at step 0"),
            (Task::Avoid, "stays safe for 30 steps"),
            (Task::AtEnd, "stays safe for 30 steps, in the target at the last of them"),
            (
                Task::ReachStay { by: Some(9) },
                "stays safe for 30 steps, in the target from step 9 on",
            ),
        ] {
            assert_eq!(task.words(Form::One, 30), words);
        }
        assert_eq!(Task::default().short_words(Form::Many, 30), "reach the target safely");
        assert_eq!(Task::Avoid.short_words(Form::Past, 30), "stayed safe for 30 steps");
    }
}
