//! What pictures of a model show beside its states: bodies where formulas say, and shapes that stand still.

use serde::{Deserialize, Serialize};

use crate::formula::Graph;

/// What pictures show; nothing of it is computed with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Bodies; without any, pictures show those of the model, or its states.
    pub bodies: Vec<PlacedBody>,
    /// Shapes.
    pub shapes: Vec<Shape>,
}

/// A body that stands where formulas of the state say.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedBody {
    /// Name for the legend.
    pub name: String,
    /// Where it stands, to the right and upwards: of the inputs of the model.
    pub at: Graph,
    /// The two formulas as they are written.
    pub written: [String; 2],
    /// How wide it is, in the unit of its place.
    pub size: Option<f32>,
    /// The body that a line joins it to, by its number.
    pub joined: Option<usize>,
}

/// Something that does not move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    /// Name for the legend.
    pub name: String,
    /// Its outline.
    pub outline: Outline,
    /// What it is.
    pub kind: ShapeKind,
}

/// The outline of a shape, in the unit of the plane that it is drawn in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outline {
    /// Left, lower, right and upper end.
    Box([f32; 4]),
    /// The middle, right and up, and the radius.
    Disc([f32; 3]),
}

impl Outline {
    /// Left, lower, right and upper end of what it covers.
    pub fn extent(self) -> [f64; 4] {
        match self {
            Self::Box(ends) => ends.map(f64::from),
            Self::Disc(disc) => {
                let [x, y, radius] = disc.map(f64::from);
                [x - radius, y - radius, x + radius, y + radius]
            }
        }
    }
}

/// What a shape is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShapeKind {
    /// Where the plant must not be.
    Unsafe,
    /// Where it should get to.
    Target,
    /// Neither.
    #[default]
    Plain,
}
