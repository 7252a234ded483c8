//! The commands of the study: `race`, and `sweep`, which certifies the points of a grid as well.

mod input;
pub(crate) mod race;
pub(crate) mod sweep;
