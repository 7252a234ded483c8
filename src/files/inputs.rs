//! The files that a command reads, which no output of it takes the place of.

use std::path::{Path, PathBuf};

use super::folder_of;
use crate::error::{Error, Result};

/// The files that a command reads.
#[derive(Clone, Debug, Default)]
pub struct Inputs(Vec<PathBuf>);

impl Inputs {
    /// The files at `paths`.
    pub fn new(paths: impl IntoIterator<Item = PathBuf>) -> Self {
        Self(paths.into_iter().collect())
    }

    /// Refuses the output `path` where it is one of the inputs, by its name or through links.
    ///
    /// # Errors
    /// [`Error::File`] naming both.
    pub fn spare_file(&self, path: &Path) -> Result<()> {
        match self.0.iter().find(|input| same(input, path)) {
            Some(input) => Err(taken(path, input, "the same file as")),
            None => Ok(()),
        }
    }

    /// Refuses the output folder `path` where one of the inputs is it or lies in it, at any depth.
    ///
    /// # Errors
    /// [`Error::File`] naming both.
    pub fn spare_folder(&self, path: &Path) -> Result<()> {
        let folder = resolved(path);
        let within = |input: &&PathBuf| {
            resolved(input).ancestors().any(|above| above == folder || same(above, path))
        };
        match self.0.iter().find(within) {
            Some(input) => Err(taken(path, input, "a folder above")),
            None => Ok(()),
        }
    }
}

/// The refusal of the output at `path`.
fn taken(path: &Path, input: &Path, relation: &str) -> Error {
    let problem = format!(
        "the output is {relation} the input {}, which it could replace; give it another place",
        input.display()
    );
    Error::file(path, problem)
}

/// Whether both names lead to one file.
fn same(one: &Path, other: &Path) -> bool {
    resolved(one) == resolved(other) || identity(one).is_some_and(|id| Some(id) == identity(other))
}

/// The path without links; for a file that is not there yet, that of its folder with its name.
fn resolved(path: &Path) -> PathBuf {
    let whole = path.canonicalize();
    whole.unwrap_or_else(|_| match (folder_of(path).canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    })
}

/// Disk and number of a file, which hard links share.
#[cfg(unix)]
fn identity(path: &Path) -> Option<[u64; 2]> {
    use std::os::unix::fs::MetadataExt;
    let found = std::fs::metadata(path).ok()?;
    Some([found.dev(), found.ino()])
}

/// Other systems do not tell; names have to do.
#[cfg(not(unix))]
fn identity(_: &Path) -> Option<[u64; 2]> {
    None
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn outputs_are_told_from_inputs_through_links_and_folders() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("inner/deep")).unwrap();
        std::fs::write(at("inner/deep/starts.csv"), "0,0\n").unwrap();
        std::fs::hard_link(at("inner/deep/starts.csv"), at("hard.csv")).unwrap();
        symlink(at("inner/deep/starts.csv"), at("link.csv")).unwrap();
        symlink(at("inner"), at("way")).unwrap();
        let inputs = Inputs::new([at("inner/deep/starts.csv")]);
        for name in ["inner/deep/starts.csv", "hard.csv", "link.csv", "way/deep/../deep/starts.csv"]
        {
            let message = inputs.spare_file(&at(name)).unwrap_err().to_string();
            assert!(message.contains("starts.csv"), "{message}");
        }
        for name in ["inner", "inner/deep", "way", "way/deep", "", "inner/../inner"] {
            assert!(inputs.spare_folder(&at(name)).is_err(), "{name}");
        }
        for name in ["inner/deep/measures.csv", "inner/starts.csv", "new/starts.csv"] {
            inputs.spare_file(&at(name)).unwrap();
        }
        for name in ["inner/other", "inner/deep/out", "inn", "new/new"] {
            inputs.spare_folder(&at(name)).unwrap();
        }
    }
}
