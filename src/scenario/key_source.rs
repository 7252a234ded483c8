//! Where the key of the streams that claims rest on comes from.

use crate::rollout::GENERATOR;

/// Name of the generator where the key is derived from seed and claim.
const OF_CLAIM: &str = "Philox4x32-10, key from seed and claim";

/// Where the key of the streams that claims rest on comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keys {
    /// The seed alone: races, sweep points, and certificates of older versions.
    Seed,
    /// The seed and a digest of what is claimed about.
    #[default]
    Claim,
    /// That key, derived from seed and claim.
    Derived(u64),
}

impl Keys {
    /// Those of a record that names its generator so; none of one that is not known.
    pub(super) fn of(generator: &str) -> Option<Self> {
        match generator {
            OF_CLAIM => Some(Self::Claim),
            GENERATOR => Some(Self::Seed),
            _ => None,
        }
    }

    /// The generator as a record names it.
    pub(super) fn generator(self) -> &'static str {
        match self {
            Self::Seed => GENERATOR,
            Self::Claim | Self::Derived(_) => OF_CLAIM,
        }
    }
}
