//! A folder that holds the results of one piece of work, and says which.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::existing::spare_folder;
use super::made::Made;
use super::{RECORD_BYTES, Staged, check_room, named, read_text};
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
const KINDS: [Kind; 6] = [
    Kind {
        words: "a certificate",
        files: &CERTIFICATE,
        folder: Some((COST_COPIES, &[".csv", ".npy", ".safetensors"])),
    },
    Kind { words: "a search for failures", files: &["falsify.json"], folder: None },
    Kind {
        words: "plans in closed loop",
        files: &["plan.json", "steps.csv", "trajectories.npz"],
        folder: None,
    },
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

/// Folder of the copies of what costs of a certified model name, in the order of its text.
pub(crate) const COST_COPIES: &str = "costs";

/// Files of a certificate.
const CERTIFICATE: [&str; 12] = {
    let [a, b, c, d, e, f, g, h] = NETWORK_COPIES;
    let [record, policy] = ["certificate.json", "policy.safetensors"];
    [record, policy, "deviation.csv", "slice.npy", a, b, c, d, e, f, g, h]
};

/// Files that several kinds have: the page, starts that fail, and at last the manifest.
const SHARED: [&str; 4] =
    ["report.html", "counterexamples.csv", "counterexamples_replayed.csv", MANIFEST];

/// A folder that says which work it holds.
///
/// Dropped before anything of the work is in it, it leaves the folder as it was.
#[derive(Debug)]
pub(crate) struct Claim {
    /// What this run wrote and made; none if the folder said so already.
    own: Option<(PathBuf, Made)>,
}

impl Claim {
    /// Makes sure that `folder` holds the work that `manifest` describes, or none, and has room for
    /// `need` bytes more, and says so in it.
    ///
    /// # Errors
    /// [`Error::File`] if something else is there, [`Error::Write`] if the folder cannot be written,
    /// [`Error::NoRoom`].
    pub(crate) fn new(folder: &Path, manifest: &str, need: u64) -> Result<Self> {
        let folder = named(folder);
        let made = Made::folder(folder)
            .map_err(|source| Error::Write { path: folder.to_owned(), source })?;
        let mut staged = Staged::new(folder)?;
        let claimed = is_free(folder, manifest)?;
        check_room(folder, need)?;
        if claimed == Claimed::Already {
            return Ok(Self { own: None });
        }
        staged.add(MANIFEST, manifest.as_bytes())?;
        staged.publish()?;
        Ok(Self { own: Some((folder.to_owned(), made)) })
    }

    /// Keeps the claim though nothing may be in the folder yet.
    pub(crate) fn keep(&mut self) {
        self.own = None;
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let Some((folder, _)) = &self.own else { return };
        for kind in &KINDS {
            if let Some((name, _)) = kind.folder {
                // One that holds something stays.
                _ = std::fs::remove_dir(folder.join(name));
            }
        }
        if found(folder).is_none() {
            _ = std::fs::remove_file(folder.join(MANIFEST));
        }
    }
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
    spare_others(folder)?;
    match read_text(&path, RECORD_BYTES) {
        Ok(text) if text == manifest => return Ok(Claimed::Already),
        Ok(_) => {
            let problem = format!(
                "another experiment is stored here, {} (other configuration, starts, parameters, \
                 networks, backend or program); give another --out, or --overwrite to remove it",
                found(folder).map_or("not begun", |(_, words)| words)
            );
            return Err(Error::file(&path, problem));
        }
        // That a file is in the place of the folder, who writes to it says.
        Err(error) if [ErrorKind::NotFound, ErrorKind::NotADirectory].contains(&error.kind()) => {}
        Err(error) => {
            let problem = format!("{error}; give another --out, or --overwrite to remove it");
            return Err(Error::file(&path, problem));
        }
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

/// Refuses folders in the places of files of results, and the other way round: nothing could replace
/// them.
fn spare_others(folder: &Path) -> Result<()> {
    let files = KINDS.iter().flat_map(|kind| kind.files).chain(&SHARED);
    files.map(|name| folder.join(name)).try_for_each(|path| spare_folder(&path))?;
    for (name, _) in KINDS.iter().filter_map(|kind| kind.folder) {
        let path = folder.join(name);
        if path.symlink_metadata().is_ok_and(|about| !about.is_dir() && !about.is_symlink()) {
            let problem = "a file is in the place of a folder of the results; move it, or write to \
                           another place";
            return Err(Error::file(&path, problem));
        }
    }
    Ok(())
}

/// Refuses to write into `folder` where results of a piece of work are.
///
/// # Errors
/// [`Error::File`] naming them, and what to do.
pub(crate) fn spare_results(folder: &Path) -> Result<()> {
    match found(folder) {
        None => Ok(()),
        Some((name, words)) => {
            let problem =
                format!("something else is here, by its name of {words}; give another folder");
            Err(Error::file(&folder.join(name), problem))
        }
    }
}

/// The first file of results in `folder`, and the kind that it is of.
fn found(folder: &Path) -> Option<(&'static str, &'static str)> {
    let is_there = |name: &str| folder.join(name).symlink_metadata().is_ok();
    let of_kind = KINDS.iter().find_map(|kind| {
        let inner = kind.folder.filter(|(name, endings)| holds(&folder.join(name), endings));
        let file = kind.files.iter().copied().find(|name| is_there(name));
        file.or(inner.map(|(name, _)| name)).map(|name| (name, kind.words))
    });
    of_kind.or_else(|| is_there(SHARED[0]).then_some((SHARED[0], "a report")))
}

/// Whether `folder` is a link or has files whose names end so.
fn holds(folder: &Path, endings: &[&str]) -> bool {
    let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let ends = |name: &str| endings.iter().any(|ending| name.ends_with(ending));
    folder.is_symlink() || entries.any(|entry| ends(&entry.file_name().to_string_lossy()))
}

/// Removes the results of other work than `manifest` describes from `folder`, and nothing else.
///
/// # Errors
/// [`Error::Write`] if one cannot be removed.
pub(crate) fn make_way(folder: &Path, manifest: &str) -> Result<()> {
    spare_others(folder)?;
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
        // What is left is nobody's results.
        is_free(folder.path(), "work").unwrap();
        // The work's own results stay.
        std::fs::write(at(MANIFEST), "work").unwrap();
        std::fs::write(at("results.json"), "mine").unwrap();
        make_way(folder.path(), "work").unwrap();
        assert!(at("results.json").exists());
    }

    #[test]
    fn a_claim_without_work_leaves_the_folder_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let new = folder.path().join("new/inner");
        drop(Claim::new(&new, "work", 0).unwrap());
        assert!(!folder.path().join("new").exists());
        drop(Claim::new(folder.path(), "work", 0).unwrap());
        assert!(folder.path().exists() && !folder.path().join(MANIFEST).exists());
        let claim = Claim::new(&new, "work", 0).unwrap();
        std::fs::create_dir(new.join("races")).unwrap();
        std::fs::write(new.join("races/a.npz"), "race").unwrap();
        drop(claim);
        assert!(new.join("races/a.npz").exists() && new.join(MANIFEST).exists());
        std::fs::remove_file(new.join("races/a.npz")).unwrap();
        // An earlier run's claim is not this one's to take back.
        drop(Claim::new(&new, "work", 0).unwrap());
        assert!(new.join(MANIFEST).exists());
    }

    #[test]
    fn folders_in_the_places_of_files_are_refused_and_files_in_those_of_folders() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("results.json")).unwrap();
        std::fs::write(folder.path().join("timing.json"), "mine").unwrap();
        let refused = |words: &str| {
            for refused in
                [is_free(folder.path(), "work").map(drop), make_way(folder.path(), "work")]
            {
                let message = refused.unwrap_err().to_string();
                assert!(message.contains(words), "{message}");
            }
            assert!(folder.path().join("timing.json").exists());
        };
        refused("results.json: a folder");
        std::fs::remove_dir(folder.path().join("results.json")).unwrap();
        std::fs::write(folder.path().join("points"), "mine").unwrap();
        refused("points: a file");
    }

    #[test]
    fn every_kind_of_result_is_told_by_its_names() {
        for kind in &KINDS {
            for name in kind.files.iter().chain(&SHARED[..1]) {
                let folder = tempfile::tempdir().unwrap();
                is_free(folder.path(), "work").unwrap();
                std::fs::write(folder.path().join(name), "mine").unwrap();
                assert!(Claim::new(folder.path(), "work", 0).is_err(), "{name}");
                assert_eq!(std::fs::read(folder.path().join(name)).unwrap(), b"mine");
            }
        }
    }
}
