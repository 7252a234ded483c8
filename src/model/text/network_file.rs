//! The file of a network that formulas call.

use std::path::PathBuf;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::files::{RECORD_BYTES, read};
use crate::policy::Mlp;

/// Most files of networks that the formulas of a model may name.
pub const MOST_NETWORKS: usize = 8;

/// The file of a network that formulas call.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFile {
    /// What formulas call it.
    pub name: String,
    /// Where it was read.
    pub path: PathBuf,
    /// The file as it was read, for a copy that is sure to be the same.
    pub bytes: Vec<u8>,
    /// The network.
    pub network: Arc<Mlp>,
}

impl NetworkFile {
    /// Reads the safetensors file at `path`, which formulas call `name`.
    ///
    /// # Errors
    /// [`Error::File`] if it is missing, damaged, or has a weight that is not finite.
    pub fn read(name: &str, path: PathBuf) -> Result<Self> {
        let bytes = read(&path, RECORD_BYTES).map_err(|e| Error::file(&path, e))?;
        let network = Mlp::from_bytes(&bytes).map_err(|problem| Error::file(&path, problem))?;
        Ok(Self { name: name.to_owned(), path, bytes, network: Arc::new(network) })
    }
}
