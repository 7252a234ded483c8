//! The tier of a state: who controls there; and the ball that growth verified.

use serde::Serialize;

use super::growth_set::Family;
use super::record::{GrowthOutcome, GrowthRecord};
use crate::model::Task;
use crate::rollout::Region;

/// Who controls at a state, section 6 of `docs/method.md` and Algorithm 2; a file has its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(into = "u8")]
pub enum Tier {
    /// Tier 0, in the target: the fast controller.
    Target,
    /// Tier 1, in the certified set: the policy.
    Global,
    /// Tier 2, in the locally verified ball: the policy.
    Local,
    /// Tier 3, elsewhere: recovery.
    Recovery,
}

impl Tier {
    /// Its number, 0 to 3.
    pub fn number(self) -> u8 {
        self as u8
    }
}

impl From<Tier> for u8 {
    fn from(tier: Tier) -> Self {
        tier.number()
    }
}

/// Tier of a state; a target counts where to be in it at once is enough for `task`.
pub(super) fn tier(
    task: &Task,
    target_margin: f64,
    check_margin: f64,
    growth: &GrowthRecord,
    x: &[f32],
) -> Tier {
    let local = || verified_set(growth, x.len()).is_some_and(|set| set.contains(x));
    match () {
        () if task.is_reached_at_once() && target_margin > 0.0 => Tier::Target,
        () if check_margin > 0.0 => Tier::Global,
        () if local() => Tier::Local,
        () => Tier::Recovery,
    }
}

/// The verified set of `states` coordinates, where there is one: a record that was edited may have
/// any number of them.
pub(super) fn verified_set(growth: &GrowthRecord, states: usize) -> Option<Region> {
    let whole = |center: &&Vec<f32>| center.len() == states && growth.varies.len() == states;
    let verified = growth.outcome == GrowthOutcome::Verified;
    let center = growth.center.as_ref().filter(whole).filter(|_| verified)?.clone();
    let family = match &growth.upward {
        None => Family::balls(center, &growth.varies),
        Some(upward) => upward.family(center),
    };
    (family.widths.len() == states).then(|| family.at(growth.radius as f32))
}
