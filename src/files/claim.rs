//! A folder that holds the results of one piece of work, and says which.

use std::path::Path;

use super::{Staged, check_room};
use crate::error::{Error, Result};

/// Name of the file that says which work a folder holds.
const MANIFEST: &str = "experiment.json";
/// Name of the page that every command with results writes.
const REPORT: &str = "report.html";

/// Makes sure that `folder` holds the work that `manifest` describes, or none, and has room for
/// `need` bytes more, and says so in it.
///
/// # Errors
/// [`Error::File`] if something else is there, [`Error::Write`] if the folder cannot be written,
/// [`Error::NoRoom`].
pub(crate) fn claim_folder(folder: &Path, manifest: &str, need: u64) -> Result<()> {
    let mut staged = Staged::new(folder)?;
    let path = folder.join(MANIFEST);
    match std::fs::read_to_string(&path) {
        Ok(text) if text == manifest => return check_room(folder, need),
        Ok(_) => {
            let problem = "another experiment is stored here (other configuration, starts, \
                           parameters, networks, backend or program); give another --out, or \
                           remove this folder";
            return Err(Error::file(&path, problem));
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(Error::file(&path, error)),
    }
    if folder.join(REPORT).exists() {
        let problem = "a report of something else is here; give another --out, or remove it";
        return Err(Error::file(&folder.join(REPORT), problem));
    }
    check_room(folder, need)?;
    staged.add(MANIFEST, manifest.as_bytes())?;
    staged.publish().map(drop)
}
