//! The tier of a state: who controls there.

use serde::Serialize;

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
