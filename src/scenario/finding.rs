//! What a check found: figures as stored and as found, with words only where there is no number.

use std::fmt;

use serde::Serialize;

use crate::rounding::{interval, lower, upper};

/// One side of a finding; plain numbers are numbers in JSON too.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Figure {
    /// A number of rollouts.
    Count(u64),
    /// A number whose upper side is the safe one: a risk, a bound, a constant.
    Upper(#[serde(with = "crate::files::number")] f64),
    /// A number whose lower side is the safe one: a radius.
    Lower(#[serde(with = "crate::files::number")] f64),
    /// Whether something is so.
    Flag(bool),
    /// Lower and upper end.
    Interval(#[serde(with = "crate::files::number")] [f64; 2]),
    /// A bound.
    AtMost {
        /// The largest value.
        #[serde(with = "crate::files::number")]
        at_most: f64,
    },
    /// Failures of fresh trials, and the risk that they show.
    Trials {
        /// Trials that failed.
        failures: u64,
        /// All of them.
        trials: u64,
        /// The smallest risk that is left.
        #[serde(with = "crate::files::number")]
        at_least: f64,
    },
    /// Anything else.
    Words(String),
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            Self::Upper(number) => f.write_str(&upper(*number)),
            Self::Lower(number) => f.write_str(&lower(*number)),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Interval(ends) => f.write_str(&interval(*ends)),
            Self::AtMost { at_most } => write!(f, "at most {}", upper(*at_most)),
            Self::Trials { failures, trials, at_least } => {
                write!(f, "{failures} of {trials}: at least {}", lower(*at_least))
            }
            Self::Words(words) => f.write_str(words),
        }
    }
}

/// One thing that was checked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What.
    pub name: String,
    /// As stored.
    pub stored: Figure,
    /// As found now.
    pub found: Figure,
    /// Whether the stored claim stands.
    pub holds: bool,
}

/// What a check found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// Whether every finding holds.
    pub holds: bool,
    /// Seed of the fresh samples that the claims were tried on.
    pub fresh_seed: u64,
    /// One by one.
    pub findings: Vec<Finding>,
}

impl CheckReport {
    /// The report of these findings.
    pub(super) fn new(fresh_seed: u64, findings: Vec<Finding>) -> Self {
        Self { holds: findings.iter().all(|finding| finding.holds), fresh_seed, findings }
    }

    /// Adds what was found beside.
    pub fn add(&mut self, findings: Vec<Finding>) {
        self.holds &= findings.iter().all(|finding| finding.holds);
        self.findings.extend(findings);
    }
}
