//! The networks that formulas call, by the names that they have there.

use std::sync::Arc;

use crate::policy::Mlp;

/// Networks by the files that formulas name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Networks {
    list: Vec<(String, Arc<Mlp>)>,
}

impl Networks {
    /// Adds the network that formulas call `file`.
    pub fn add(&mut self, file: &str, network: Arc<Mlp>) {
        self.list.push((file.to_owned(), network));
    }

    /// The network that formulas call `file`.
    ///
    /// # Panics
    /// If there is none.
    pub fn of(&self, file: &str) -> &Arc<Mlp> {
        let found = self.list.iter().find(|(known, _)| known == file);
        &found.expect("formulas are evaluated once their networks are there").1
    }
}
