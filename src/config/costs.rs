//! The costs of plans that a configuration describes.

use std::path::Path;

use super::section::Config;
use super::sources::UNNAMED;
use crate::error::Result;
use crate::model::Costs;
use crate::model::text::Origin;

impl Config {
    /// The costs of plans in the section `model.costs`, if there is one; files of references, maps and
    /// networks are sought relative to `folder`, where the configuration lies.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the key of what is wrong, cannot be read or does not fit.
    pub fn costs(&self, folder: &Path) -> Result<Option<Costs>> {
        let Some(model) = &self.model else { return Ok(None) };
        let origin = Origin::new(UNNAMED, folder);
        let described = self.description(model, &self.policy, &origin);
        let described = described.map(|found| found.with_networks(self.networks.clone()));
        described.and_then(|found| found.costs()).map_err(|error| self.placed(error))
    }
}
