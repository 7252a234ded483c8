//! What the picture of a model as text shows beside its rollouts.

use serde::{Deserialize, Serialize};

use crate::model::Shape;

/// Bodies, shapes and the ground that rollouts are drawn over.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawnRecord {
    /// Bodies at formulas; without any, those of the system, or its states.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<DrawnBody>,
    /// Shapes that stand still.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shapes: Vec<Shape>,
    /// Margins over the plane of the first body, where that is a plane of two states.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ground: Option<GroundRecord>,
}

/// A body at formulas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawnBody {
    /// Name for the legend.
    pub name: String,
    /// The formulas of its place, right and up.
    pub written: [String; 2],
    /// How wide it is, in the unit of its place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<f32>,
    /// The body that a line joins it to, by its number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joined: Option<usize>,
    /// Where it is to the right in each rollout, `[rollouts][T + 1]`.
    #[serde(with = "crate::files::number")]
    pub right: Vec<Vec<f32>>,
    /// Where it is upwards.
    #[serde(with = "crate::files::number")]
    pub up: Vec<Vec<f32>>,
}

/// Margins over a plane of two states, the others as in the state, at the first step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundRecord {
    /// Across the columns.
    pub x: GroundAxis,
    /// Along the rows.
    pub y: GroundAxis,
    /// Target margins, row by row.
    #[serde(with = "crate::files::number")]
    pub target_margin: Vec<f32>,
    /// Constraint margins, row by row.
    #[serde(with = "crate::files::number")]
    pub constraint_margin: Vec<f32>,
}

/// One axis of a ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundAxis {
    /// The state along it.
    pub state: usize,
    /// The middles of its cells.
    #[serde(with = "crate::files::number")]
    pub values: Vec<f32>,
}
