//! What failed on an adapter and how the work went on: part of every record.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::Fault;

/// A failure that the work survived.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// What happened.
    pub fault: Fault,
    /// The adapter, and what it or its driver says.
    pub problem: String,
    /// What was computed: `starts`, `pairs`, `problems`; empty where no work had begun.
    pub work: String,
    /// Index of the first of them without a result; all before it had theirs from the adapter.
    pub index: u64,
    /// What was done.
    pub action: Action,
}

/// How the work went on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// On the same adapter, so many trajectories at a time.
    SmallerChunks(u64),
    /// On the same adapter, opened again.
    Reopened,
    /// On the CPU, this and all later work.
    Cpu,
}

/// Adds to `all` those of `more` that are not in it yet.
pub fn add_events(all: &mut Vec<Event>, more: impl IntoIterator<Item = Event>) {
    for event in more {
        if !all.contains(&event) {
            all.push(event);
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fault, problem, work, index, action } = self;
        write!(f, "{fault} ({problem})")?;
        if !work.is_empty() {
            write!(f, " before {work} {index} had results")?;
        }
        match action {
            Action::SmallerChunks(columns) => {
                write!(f, "; went on {columns} trajectories at a time")
            }
            Action::Reopened => f.write_str("; went on with the adapter opened again"),
            Action::Cpu => f.write_str("; went on on the CPU"),
        }
    }
}
