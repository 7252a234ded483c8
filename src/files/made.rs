//! Folders that a run made: those that nothing was put into go with it.

use std::path::{Path, PathBuf};

/// Folders that this run made, the deepest first.
#[derive(Debug, Default)]
pub(super) struct Made(Vec<PathBuf>);

impl Made {
    /// Makes `folder` with those above it that are missing.
    ///
    /// # Errors
    /// Those of the system.
    pub(super) fn folder(folder: &Path) -> std::io::Result<Self> {
        let missing = folder
            .ancestors()
            .take_while(|above| !above.as_os_str().is_empty() && above.symlink_metadata().is_err());
        let made = Self(missing.map(Path::to_owned).collect());
        std::fs::create_dir_all(folder)?;
        Ok(made)
    }
}

impl Drop for Made {
    /// Removes those that are empty, and nothing else.
    fn drop(&mut self) {
        for folder in &self.0 {
            _ = std::fs::remove_dir(folder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_that_stay_empty_go() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        drop(Made::folder(&at("a/b/c")).unwrap());
        assert!(!at("a").exists());
        let made = Made::folder(&at("a/b/c")).unwrap();
        std::fs::write(at("a/b/file"), "kept").unwrap();
        drop(made);
        assert!(at("a/b/file").exists() && !at("a/b/c").exists());
        // What was there before stays, empty or not.
        std::fs::create_dir(at("mine")).unwrap();
        drop(Made::folder(&at("mine")).unwrap());
        assert!(at("mine").exists());
    }
}
