//! Files: results that appear whole or not at all, and states and measures as arrays.

mod archive;
mod array;
mod claim;
mod npz;
mod states;
mod table;

pub(crate) use archive::Archive;
pub use array::{MeasureWriter, npy_bytes};
pub(crate) use claim::claim_folder;
pub use npz::{Array, Data, npz_bytes, read_npz};
pub use states::StateReader;
pub use table::{Column, Table};

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// `value` as a JSON document that ends with its line; errors call it `name`.
///
/// # Errors
/// [`Error::Invalid`] if it has no JSON form.
pub fn json(name: &str, value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(value);
    text.map(|text| text + "\n").map_err(|e| Error::invalid(name, e.to_string()))
}

/// Files of one folder, written beside their final names and renamed together at the end.
///
/// Dropped before [`Staged::publish`], it leaves nothing behind and older files as they were.
#[derive(Debug)]
pub struct Staged {
    folder: PathBuf,
    files: Vec<(NamedTempFile, PathBuf)>,
}

impl Staged {
    /// Creates `folder` where it is missing and makes sure that it can be written to.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot.
    pub fn new(folder: &Path) -> Result<Self> {
        let refused = |source| Error::Write { path: folder.to_owned(), source };
        std::fs::create_dir_all(folder).map_err(refused)?;
        temporary(folder)?;
        Ok(Self { folder: folder.to_owned(), files: Vec::new() })
    }

    /// Writes `bytes` for the file `name`.
    ///
    /// # Errors
    /// [`Error::Write`] with the system's reason.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.folder.join(name);
        let mut file = temporary(&self.folder)?;
        let written = file.write_all(bytes).and_then(|()| file.as_file().sync_all());
        written.map_err(|source| Error::Write { path: path.clone(), source })?;
        self.files.push((file, path));
        Ok(())
    }

    /// Renames all files to their names, in the order in which they were added.
    ///
    /// # Errors
    /// [`Error::Write`] with the system's reason.
    pub fn publish(self) -> Result<Vec<PathBuf>> {
        let rename = |(file, path): (NamedTempFile, PathBuf)| match file.persist(&path) {
            Ok(_) => Ok(path),
            Err(error) => Err(Error::Write { path, source: error.error }),
        };
        self.files.into_iter().map(rename).collect()
    }
}

/// A temporary file in `folder` with the permissions that a new file has there.
fn temporary(folder: &Path) -> Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".reachcast-");
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666))
    };
    let refused = |source| Error::Write { path: folder.to_owned(), source };
    builder.tempfile_in(folder).map_err(refused)
}

/// The folder of `path`, `.` for a bare name.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Whether the name of `path` ends in `.npy` or `.csv`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// Binary NumPy array.
    Npy,
    /// Text with commas.
    Csv,
}

impl Format {
    /// The format that the name asks for.
    fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match ending.as_str() {
            "npy" => Ok(Self::Npy),
            "csv" => Ok(Self::Csv),
            _ => Err(Error::file(path, "the name has to end in .npy or .csv")),
        }
    }
}
