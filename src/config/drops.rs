//! Keys of margin drops: what tightens the margins, and the claims that go with it.

use serde::de::{Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What tightens the margins; configurations that were stored without the key knew the last alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TighteningSource {
    /// How much less margin perturbed rollouts have than their nominal ones.
    Drops,
    /// No sample: the ball of `deviation.radius` around a start is enclosed, of a plant that is linear in its
    /// state and under `deviation.control = "replay"`, and each piece of the margins loses what it has to.
    Pieces,
    /// No sample: the ball of `deviation.radius` around a start is enclosed in a tube, of any plant, under
    /// `deviation.control`.
    Tube,
    /// Lipschitz constants of the margins times the deviation bound.
    #[default]
    Lipschitz,
}

/// A count of scenarios: as many as the claim needs, or given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Count {
    /// `"needed"`.
    #[default]
    Needed,
    /// A number.
    Given(u64),
}

impl Serialize for Count {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Needed => serializer.serialize_str("needed"),
            Self::Given(count) => serializer.serialize_u64(*count),
        }
    }
}

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CountVisitor;
        impl Visitor<'_> for CountVisitor {
            type Value = Count;
            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a count or \"needed\"")
            }
            fn visit_u64<E>(self, count: u64) -> Result<Count, E> {
                Ok(Count::Given(count))
            }
            fn visit_i64<E: serde::de::Error>(self, count: i64) -> Result<Count, E> {
                let given = u64::try_from(count).map(Count::Given);
                given.map_err(|_| E::invalid_value(Unexpected::Signed(count), &self))
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Count, E> {
                match text {
                    "needed" => Ok(Count::Needed),
                    _ => Err(E::invalid_value(Unexpected::Str(text), &self)),
                }
            }
        }
        deserializer.deserialize_any(CountVisitor)
    }
}

/// The bound on margin drops.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DropsSection {
    /// Pairs of the pilot that fixes the shapes.
    pub pilot: u64,
    /// Risk.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Pairs N.
    pub scenarios: Count,
    /// Pairs that are discarded.
    pub discards: u64,
}

/// Calibration of the score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationSection {
    /// Risk; 1 asks for no calibration.
    pub epsilon: f64,
    /// One minus the confidence.
    pub beta: f64,
    /// Pairs N.
    pub scenarios: Count,
    /// Failing pairs that are discarded.
    pub discards: u64,
}

impl Default for DropsSection {
    fn default() -> Self {
        Self { pilot: 1000, epsilon: 0.1, beta: 1e-3, scenarios: Count::Needed, discards: 0 }
    }
}

impl Default for CalibrationSection {
    fn default() -> Self {
        // The simple bound, which asks for 159 pairs without a discard, leaves room for five.
        Self { epsilon: 0.1, beta: 1e-3, scenarios: Count::Needed, discards: 5 }
    }
}

/// Fresh starts that nobody asked for otherwise.
pub(super) fn share_draws() -> u64 {
    100_000
}
