//! How a set of local growth is looked for: which way radii go, and what the set is.

use serde::{Deserialize, Serialize};

/// Which way radii go, `docs/method.md` section 5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GrowthMethod {
    /// Algorithm 1: from the first radius down to the nearest failure, until a round is clean; beta is
    /// split over the rounds.
    #[default]
    Shrinking,
    /// Along radii that are fixed beforehand, from the smallest up, as long as each passes; all of beta at
    /// each, since a first wrong radius is accepted with probability at most beta.
    Upward,
}

/// What grows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GrowthShape {
    /// A Euclidean ball in the coordinates that vary.
    #[default]
    Ball,
    /// An axis-parallel ellipsoid, its axes from a pilot; its radius is that of the ball with its volume.
    Ellipsoid,
    /// A box, its sides from a pilot; its radius is the geometric mean of half its sides.
    Box,
}

impl GrowthShape {
    /// The name in a sentence.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Ellipsoid => "ellipsoid",
            Self::Box => "box",
        }
    }
}

/// Whose boundary the centre lies on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Around {
    /// The certified set.
    #[default]
    Set,
    /// The set that the bound on margin drops certifies by itself, before a sequence goes on from it: the
    /// boundary of a set that a sequence chose is nearly that of the starts from which the policy
    /// succeeds, and around it few radii pass. The certified set where that one has no boundary.
    Bound,
}

impl Around {
    /// Whether it is the certified set, as records say that name none.
    pub(super) fn is_set(&self) -> bool {
        *self == Self::Set
    }

    /// The set in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Set => "the certified set",
            Self::Bound => "the set that margin drops certify by themselves",
        }
    }
}

impl GrowthShape {
    /// The same with its article.
    pub fn with_article(self) -> String {
        let article = if self == Self::Ellipsoid { "an" } else { "a" };
        format!("{article} {}", self.name())
    }
}

/// How a set is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrowthPlan {
    /// Whose boundary the centre lies on.
    pub around: Around,
    /// Which way radii go.
    pub method: GrowthMethod,
    /// What grows; Algorithm 1 knows balls alone.
    pub shape: GrowthShape,
    /// Upward: each radius over the one before it, above 1. The last one is the radius of the settings.
    pub factor: f64,
    /// Starts of the pilot that fixes the axes of an ellipsoid or a box.
    pub pilot: u64,
}

impl GrowthPlan {
    /// Algorithm 1.
    pub const SHRINKING: Self = Self {
        around: Around::Set,
        method: GrowthMethod::Shrinking,
        shape: GrowthShape::Ball,
        factor: 1.25,
        pilot: 2000,
    };
    /// A ball, upward.
    pub const UPWARD: Self = Self { method: GrowthMethod::Upward, ..Self::SHRINKING };
}

/// What growth upward fixed before it drew the starts that its claim rests on, and what of that the
/// pilot showed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UpwardRecord {
    /// Failures that a round may have, from its starts, risk and beta alone.
    pub allowed: u64,
    /// The radii in the order in which they are tried.
    #[serde(with = "crate::files::number")]
    pub radii: Vec<f64>,
    /// What grows.
    pub shape: GrowthShape,
    /// Half-width of each state at radius 1; 1 of a ball, 0 of a state that does not vary.
    #[serde(with = "crate::files::number")]
    pub widths: Vec<f32>,
    /// Starts of the pilot; 0 of a ball.
    pub pilot: u64,
    /// Of which failed.
    pub pilot_failures: u64,
}
