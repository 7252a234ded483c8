//! What is there already where a result is to be written: kept, or replaced.

use std::path::Path;

use crate::error::{Error, Result};

/// What becomes of results that are there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Existing {
    /// They stay, and what would replace them is refused.
    #[default]
    Kept,
    /// They make way.
    Replaced,
}

/// Refuses to write `path` where something is that `existing` keeps.
///
/// # Errors
/// [`Error::File`] naming it, and what to do.
pub(crate) fn spare_existing(path: &Path, existing: Existing) -> Result<()> {
    if existing == Existing::Replaced || path.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(Error::file(path, "it is there already; give another name, or --overwrite to replace it"))
}

/// The same where `bytes` are to be written, which replace nothing if they are there already.
///
/// # Errors
/// As [`spare_existing`].
pub(super) fn spare_other(path: &Path, bytes: &[u8], existing: Existing) -> Result<()> {
    // A pipe would be waited for.
    let is_file = path.symlink_metadata().is_ok_and(|about| about.is_file());
    match is_file && std::fs::read(path).is_ok_and(|found| found == bytes) {
        true => Ok(()),
        false => spare_existing(path, existing),
    }
}
