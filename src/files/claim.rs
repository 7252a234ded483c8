//! A folder that holds the results of one piece of work, and says which.

use std::path::Path;

use super::{Staged, check_room};
use crate::error::{Error, Result};

/// Name of the file that says which work a folder holds.
pub(crate) const MANIFEST: &str = "experiment.json";

/// A kind of results: in words, and the names of its files, the one that tells it first.
struct Kind {
    words: &'static str,
    files: &'static [&'static str],
    /// A folder of it, and how the names in it end.
    folder: Option<(&'static str, &'static [&'static str])>,
}

/// Every kind of results that has a folder for itself.
const KINDS: [Kind; 4] = [
    Kind { words: "a certificate", files: &CERTIFICATE, folder: None },
    Kind {
        words: "races",
        files: &["results.json", "timing.json"],
        folder: Some(("races", &[".npz", ".npz.events.json"])),
    },
    Kind {
        words: "a sweep",
        files: &["sweep.json", "sweep.csv", "sweep.parquet"],
        folder: Some(("points", &[".json"])),
    },
    Kind {
        words: "a training",
        files: &[
            "train.json",
            "checkpoint.safetensors",
            "curve.csv",
            "value.safetensors",
            "action_value.safetensors",
            "disturbance.safetensors",
            "critic.safetensors",
        ],
        folder: None,
    },
];
/// Copies of the networks that formulas of a certified model call, in the order of its text.
pub(crate) const NETWORK_COPIES: [&str; 8] = [
    "network_1.safetensors",
    "network_2.safetensors",
    "network_3.safetensors",
    "network_4.safetensors",
    "network_5.safetensors",
    "network_6.safetensors",
    "network_7.safetensors",
    "network_8.safetensors",
];

/// Files of a certificate.
const CERTIFICATE: [&str; 12] = {
    let [a, b, c, d, e, f, g, h] = NETWORK_COPIES;
    let [record, policy] = ["certificate.json", "policy.safetensors"];
    [record, policy, "deviation.csv", "slice.npy", a, b, c, d, e, f, g, h]
};

/// Files that several kinds have: the page, and at last the manifest.
const SHARED: [&str; 2] = ["report.html", MANIFEST];

/// Makes sure that `folder` holds the work that `manifest` describes, or none, and has room for
/// `need` bytes more, and says so in it.
///
/// # Errors
/// [`Error::File`] if something else is there, [`Error::Write`] if the folder cannot be written,
/// [`Error::NoRoom`].
pub(crate) fn claim_folder(folder: &Path, manifest: &str, need: u64) -> Result<()> {
    let mut staged = Staged::new(folder)?;
    let claimed = is_free(folder, manifest)?;
    check_room(folder, need)?;
    if claimed == Claimed::Already {
        return Ok(());
    }
    staged.add(MANIFEST, manifest.as_bytes())?;
    staged.publish().map(drop)
}

/// Whether a folder says already which work it holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Claimed {
    /// It says that it holds the work in question.
    Already,
    /// It holds no results.
    NotYet,
}

/// Makes sure that `folder` holds the work that `manifest` describes, or none.
///
/// # Errors
/// [`Error::File`] naming what else is there, and what to do; [`Error::Write`] if nothing can be.
pub(crate) fn is_free(folder: &Path, manifest: &str) -> Result<Claimed> {
    let path = folder.join(MANIFEST);
    if path.metadata().is_ok_and(|about| !about.is_file()) {
        return Err(Error::file(&path, "it is no file, which it has to be; give another --out"));
    }
    match std::fs::read_to_string(&path) {
        Ok(text) if text == manifest => return Ok(Claimed::Already),
        Ok(_) => {
            let problem = format!(
                "another experiment is stored here, {} (other configuration, starts, parameters, \
                 networks, backend or program); give another --out, or --overwrite to remove it",
                found(folder).map_or("not begun", |(_, words)| words)
            );
            return Err(Error::file(&path, problem));
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(source) => return Err(Error::Write { path, source }),
    }
    match found(folder) {
        None => Ok(Claimed::NotYet),
        Some((name, words)) => {
            let problem = format!(
                "something else is here, by its name of {words}; give another --out, or \
                 --overwrite to remove it"
            );
            Err(Error::file(&folder.join(name), problem))
        }
    }
}

/// The first file of results in `folder`, and the kind that it is of.
fn found(folder: &Path) -> Option<(&'static str, &'static str)> {
    let is_there = |name: &str| folder.join(name).symlink_metadata().is_ok();
    let of_kind = KINDS.iter().find_map(|kind| {
        let name = kind.files.iter().copied().chain(kind.folder.map(|(name, _)| name));
        name.into_iter().find(|name| is_there(name)).map(|name| (name, kind.words))
    });
    of_kind.or_else(|| is_there(SHARED[0]).then_some((SHARED[0], "a report")))
}

/// Removes the results of other work than `manifest` describes from `folder`, and nothing else.
///
/// # Errors
/// [`Error::Write`] if one cannot be removed.
pub(crate) fn make_way(folder: &Path, manifest: &str) -> Result<()> {
    if is_free(folder, manifest).is_ok() {
        return Ok(());
    }
    for kind in &KINDS {
        if let Some((name, endings)) = kind.folder {
            empty(&folder.join(name), endings)?;
        }
        kind.files.iter().try_for_each(|name| remove(&folder.join(name)))?;
    }
    SHARED.iter().try_for_each(|name| remove(&folder.join(name)))
}

/// Removes the files in `folder` whose names end so, and the folder if nothing is left in it.
fn empty(folder: &Path, endings: &[&str]) -> Result<()> {
    // A link may lead anywhere.
    if folder.is_symlink() {
        return remove(folder);
    }
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if endings.iter().any(|ending| name.ends_with(ending)) {
            remove(&entry.path())?;
        }
    }
    // It stays where somebody else's files are in it.
    _ = std::fs::remove_dir(folder);
    Ok(())
}

/// Removes the file at `path`, if there is one.
fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::Write { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_make_way_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let results = ["results.json", "policy.safetensors", "races/a.npz", "points/b.json"];
        let others = ["notes.txt", "races/notes.txt", "policy.safetensors.old", "sub/report.html"];
        for inner in ["races", "points", "sub"] {
            std::fs::create_dir(at(inner)).unwrap();
        }
        for name in results.iter().chain(&others) {
            std::fs::write(at(name), "mine").unwrap();
        }
        let refused = is_free(folder.path(), "work").unwrap_err().to_string();
        assert!(refused.contains("--overwrite") && refused.contains("policy.saf"), "{refused}");
        make_way(folder.path(), "work").unwrap();
        assert!(results.iter().all(|name| !at(name).exists()));
        assert!(others.iter().all(|name| at(name).exists()));
        assert!(!at("points").exists() && at("races").exists());
        // The work's own results stay.
        std::fs::write(at(MANIFEST), "work").unwrap();
        std::fs::write(at("results.json"), "mine").unwrap();
        make_way(folder.path(), "work").unwrap();
        assert!(at("results.json").exists());
    }

    #[test]
    fn every_kind_of_result_is_told_by_its_names() {
        for kind in &KINDS {
            for name in kind.files.iter().chain(&SHARED[..1]) {
                let folder = tempfile::tempdir().unwrap();
                is_free(folder.path(), "work").unwrap();
                std::fs::write(folder.path().join(name), "mine").unwrap();
                assert!(claim_folder(folder.path(), "work", 0).is_err(), "{name}");
                assert_eq!(std::fs::read(folder.path().join(name)).unwrap(), b"mine");
            }
        }
    }
}
