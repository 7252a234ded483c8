//! What a certificate stores of its Lipschitz constants.

use serde::{Deserialize, Serialize};

/// The Lipschitz constants that tighten the margins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantsRecord {
    /// `L_r` of the target margin.
    pub target: ConstantRecord,
    /// `L_c` of the constraint margin.
    pub constraint: ConstantRecord,
    /// Where they were computed; over the box of starts where there is nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<VisitedRecord>,
    /// What the user confirmed of the margins.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assumed: Vec<Assumption>,
}

/// One Lipschitz constant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantRecord {
    /// The constant used, Euclidean norm over all states.
    #[serde(with = "crate::files::number")]
    pub used: f64,
    /// Where it comes from: `computed` (gradient bound over the box) or `given`.
    pub source: String,
    /// The computed bound, also where a given constant is used; infinite where none could be shown.
    #[serde(with = "crate::files::number::or_infinite")]
    pub computed: f64,
    /// Largest gradient among random points: a lower estimate.
    #[serde(with = "crate::files::number")]
    pub sampled: f64,
    /// Whether the computed bound assumes that the sides of a branch agree where it switches; unknown
    /// before schema 3, as is the next.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_continuous: Option<bool>,
    /// Whether it was taken of hulls in the place of pieces, and is larger than need be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hulled: Option<bool>,
}

/// What a user may confirm of the margins, `constants.assume`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Assumption {
    /// The two sides of each branch agree where it switches, which could not be shown of all.
    Continuous,
    /// A constant that was bounded with hulls in the place of pieces is wanted although it is loose.
    Hulled,
}

/// The hull of the states that pilot pairs visited, with the box of starts, widened.
///
/// A pair counts up to, and without, the first violation of its nominal rollout: what makes its start
/// certified lies before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VisitedRecord {
    /// Pilot pairs.
    pub pairs: u64,
    /// What each side was widened by at either end, in its widths; at least by the radius of the
    /// perturbation.
    #[serde(with = "crate::files::number")]
    pub widened: f64,
    /// Lower ends, `[states]`.
    #[serde(with = "crate::files::number")]
    pub low: Vec<f32>,
    /// Upper ends.
    #[serde(with = "crate::files::number")]
    pub high: Vec<f32>,
}
