//! What is there already where a result is to be written: kept, or replaced.

use std::io::{BufRead, BufReader};
use std::path::Path;

use super::plain::open;
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
    spare_folder(path)?;
    if existing == Existing::Replaced || path.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(Error::file(path, "it is there already; give another name, or --overwrite to replace it"))
}

/// Refuses a folder at `path`, where a file has to go.
pub(super) fn spare_folder(path: &Path) -> Result<()> {
    match path.symlink_metadata().is_ok_and(|about| about.is_dir()) {
        true => {
            let problem = "a folder is in the place of a file of the results; move it, or write to \
                           another place";
            Err(Error::file(path, problem))
        }
        false => Ok(()),
    }
}

/// The same as [`spare_existing`] where the file `written` is to take the place, which replaces nothing
/// if its bytes are there already.
///
/// # Errors
/// As [`spare_existing`].
pub(super) fn spare_other(path: &Path, written: &Path, existing: Existing) -> Result<()> {
    let is_link = path.is_symlink();
    match !is_link && same_bytes(path, written).unwrap_or(false) {
        true => Ok(()),
        false => spare_existing(path, existing),
    }
}

/// Whether two plain files hold the same bytes.
fn same_bytes(one: &Path, other: &Path) -> std::io::Result<bool> {
    let (one, other) = (open(one)?, open(other)?);
    if one.metadata()?.len() != other.metadata()?.len() {
        return Ok(false);
    }
    let [mut one, mut other] = [one, other].map(BufReader::new);
    loop {
        let (here, there) = (one.fill_buf()?, other.fill_buf()?);
        let count = here.len().min(there.len());
        if count == 0 || here[..count] != there[..count] {
            return Ok(here.is_empty() && there.is_empty());
        }
        one.consume(count);
        other.consume(count);
    }
}
