//! Files: results that appear whole or not at all, and states and measures as arrays.

#[cfg(feature = "import")]
mod archive;
mod array;
#[cfg(feature = "cli")]
mod claim;
mod disk;
mod elements;
mod existing;
mod inputs;
mod lines;
mod list;
mod made;
#[cfg(feature = "cli")]
mod npz;
pub(crate) mod number;
mod plain;
mod sheet;
mod states;
#[cfg(feature = "cli")]
mod table;
mod temporary;

#[cfg(feature = "import")]
pub(crate) use archive::Archive;
pub use array::{MeasureWriter, npy_bytes};
#[cfg(feature = "cli")]
pub(crate) use claim::{
    COST_COPIES, Claim, MANIFEST, NETWORK_COPIES, is_free, make_way, spare_results,
};
pub use disk::check_room;
pub use existing::Existing;
#[cfg(feature = "cli")]
pub(crate) use existing::spare_existing;
pub use inputs::Inputs;
pub use list::{StateList, States};
#[cfg(feature = "cli")]
pub use npz::{Array, Data, npz_bytes, npz_sha256, read_npz};
#[cfg(feature = "cli")]
pub(crate) use npz::{npy_array, npy_array_bytes};
#[cfg(feature = "import")]
pub(crate) use plain::ARCHIVE_BYTES;
#[cfg(feature = "gpu")]
pub(crate) use plain::is_denied;
pub(crate) use plain::{CONFIG_BYTES, RECORD_BYTES, open, read, read_text};
pub use sheet::Sheet;
pub use states::StateReader;
#[cfg(feature = "cli")]
pub use table::{Column, Table};

use std::io::Write;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;
use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use existing::{spare_folder, spare_other};
use made::Made;
use plain::sync;
use temporary::{clear, temporary};

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
/// Dropped before [`Staged::publish`], it leaves nothing behind, no folder that it made either, and
/// older files as they were.
#[derive(Debug)]
pub struct Staged {
    folder: PathBuf,
    // Files are dropped before the folders that they lie in.
    files: Vec<(NamedTempFile, PathBuf)>,
    _made: Made,
}

impl Staged {
    /// Creates `folder` where it is missing, makes sure that it can be written to, and removes
    /// what killed runs left in it.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot.
    pub fn new(folder: &Path) -> Result<Self> {
        let folder = named(folder);
        let refused = |source| Error::Write { path: folder.to_owned(), source };
        let made = Made::folder(folder).map_err(refused)?;
        clear(folder);
        let mut trial = temporary(folder)?;
        // A full disk may have room for a name and for nothing else.
        trial.write_all(&[0; 4096]).and_then(|()| trial.as_file().sync_all()).map_err(refused)?;
        Ok(Self { folder: folder.to_owned(), files: Vec::new(), _made: made })
    }

    /// The same for the folder `name` in `folder`.
    ///
    /// # Errors
    /// [`Error::File`] if it is a link, which may lead anywhere: results stay in `folder`.
    pub fn within(folder: &Path, name: &str) -> Result<Self> {
        let inner = folder.join(name);
        if inner.is_symlink() {
            let problem = "a link, which may lead out of the folder of the results; remove it";
            return Err(Error::file(&inner, problem));
        }
        Self::new(&inner)
    }

    /// Writes `bytes` for the file `name`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `name` is a path, [`Error::Write`] with the system's reason.
    pub fn add(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let mut parts = Path::new(name).components();
        let (Some(Component::Normal(_)), None) = (parts.next(), parts.next()) else {
            return Err(Error::invalid(
                name,
                "not the name of a file in the folder of the results",
            ));
        };
        let path = self.folder.join(name);
        let mut file = temporary(&self.folder)?;
        let written = file.write_all(bytes).and_then(|()| file.as_file().sync_all());
        written.map_err(|source| Error::Write { path: path.clone(), source })?;
        self.files.push((file, path));
        Ok(())
    }

    /// The same as [`Staged::publish`], unless `existing` keeps something else that has one of the names.
    ///
    /// # Errors
    /// [`Error::File`] naming what is there; [`Error::Write`].
    pub fn publish_sparing(self, existing: Existing) -> Result<Vec<PathBuf>> {
        for (file, path) in &self.files {
            spare_other(path, file.path(), existing)?;
        }
        self.publish()
    }

    /// Renames all files to their names, in the order in which they were added.
    ///
    /// # Errors
    /// [`Error::File`] if a folder is in the place of one, before any is renamed; [`Error::Write`]
    /// with the system's reason.
    pub fn publish(self) -> Result<Vec<PathBuf>> {
        self.files.iter().try_for_each(|(_, path)| spare_folder(path))?;
        let rename = |(file, path): (NamedTempFile, PathBuf)| match file.persist(&path) {
            Ok(_) => Ok(path),
            Err(error) => Err(Error::Write { path, source: error.error }),
        };
        let paths = self.files.into_iter().map(rename).collect();
        sync(&self.folder);
        paths
    }
}

/// The folder of `path`, `.` for a bare name.
fn folder_of(path: &Path) -> &Path {
    path.parent().map_or(Path::new("."), named)
}

/// `folder` with a name: `.` where it has none.
fn named(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() { Path::new(".") } else { folder }
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
