//! From the bodies of a description to those of a picture: their places recorded.

use super::bodies::WrittenBody;
use super::description::Description;
use crate::error::Result;
use crate::formula::text::Networks;
use crate::model::PlacedBody;

impl Description {
    /// The bodies at formulas, recorded.
    pub(super) fn placed_bodies(&self, networks: &Networks) -> Result<Vec<PlacedBody>> {
        let placed = |body: &WrittenBody| {
            Ok(PlacedBody {
                name: body.name.clone(),
                at: self.recorded(&body.at[0].key, &body.at, networks)?,
                written: body.at.clone().map(|written| written.text),
                size: body.size,
                joined: body.joined,
            })
        };
        self.bodies.placed.iter().map(placed).collect()
    }
}
