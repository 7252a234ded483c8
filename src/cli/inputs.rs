//! The files that a command reads.

use std::path::{Path, PathBuf};

use crate::config::{Config, PolicySource};
use crate::files::Inputs;

/// The configuration at `config`, the policy's file if it has one, and `more`.
pub(crate) fn inputs(
    config: &Path,
    policy: &PolicySource,
    more: impl IntoIterator<Item = PathBuf>,
) -> Inputs {
    let network = match policy {
        PolicySource::Network { path, .. } => Some(path.clone()),
        PolicySource::Formula(_) => None,
    };
    Inputs::new(std::iter::once(config.to_owned()).chain(network).chain(more))
}

/// The files of networks that formulas of a model call.
pub(crate) fn networks(config: &Config) -> impl Iterator<Item = PathBuf> {
    config.networks.iter().map(|file| file.path.clone())
}
