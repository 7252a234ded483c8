//! What a search for failures is given.

use super::pairs::PairSettings;
use crate::error::{Error, Result};
use crate::rollout::{Region, RolloutSpec};

/// Largest budget, rollouts.
const MOST_BUDGET: u64 = 1_000_000_000;

/// What a search is given.
#[derive(Clone, Debug, PartialEq)]
pub struct FalsifySettings {
    /// Where starts may lie; of pairs the nominal ones.
    pub region: Region,
    /// Pairs of a certificate instead of starts: a failure is a perturbed start beside a certified one.
    pub pairs: Option<PairSettings>,
    /// Horizon and discount.
    pub spec: RolloutSpec,
    /// Rollouts, at most.
    pub budget: u64,
    /// Seed of every draw.
    pub seed: u64,
}

impl FalsifySettings {
    /// Refuses a budget out of range and a horizon or discount out of range.
    pub(super) fn check(&self) -> Result<()> {
        self.spec.check()?;
        if (1..=MOST_BUDGET).contains(&self.budget) {
            return Ok(());
        }
        let problem = format!("{} is not within 1..={MOST_BUDGET} rollouts", self.budget);
        Err(Error::invalid("budget", problem))
    }
}
