//! Temporary files beside their final names, and what killed runs left of them.

use std::fs::TryLockError;
use std::path::Path;

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// Ends of the names of temporary files; six random letters or digits stand between them.
const PREFIX: &str = ".reachcast-";
const SUFFIX: &str = ".part";
const RANDOM: usize = 6;
/// Attempts at a temporary file that no other run takes for abandoned.
const ATTEMPTS: usize = 8;

/// A temporary file in `folder` with the permissions that a new file has there.
///
/// It is locked as long as it is open, so that [`clear`] tells it from one of a killed run, whose
/// locks are gone.
pub(super) fn temporary(folder: &Path) -> Result<NamedTempFile> {
    let refused = |source| Error::Write { path: folder.to_owned(), source };
    let mut file = create(folder).map_err(refused)?;
    for _ in 1..ATTEMPTS {
        // Another run may have found it before it was locked.
        let taken = matches!(file.as_file().try_lock(), Err(TryLockError::WouldBlock));
        if !taken && file.path().exists() {
            break;
        }
        file = create(folder).map_err(refused)?;
    }
    Ok(file)
}

fn create(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666))
    };
    builder.tempfile_in(folder)
}

/// Removes the temporary files of killed runs from `folder`; none of a live run, no other file.
pub(super) fn clear(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file && is_temporary(&entry.file_name().to_string_lossy()) {
            remove_abandoned(&entry.path());
        }
    }
}

fn is_temporary(name: &str) -> bool {
    let random = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(SUFFIX));
    random.is_some_and(|random| {
        random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric())
    })
}

/// Removes the file unless a run has it locked. One that cannot be opened, locked or removed is
/// left: it does no harm but that it takes room.
fn remove_abandoned(path: &Path) {
    if let Ok(file) = super::open(path)
        && file.try_lock().is_ok()
    {
        _ = std::fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_writes_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let live = temporary(folder.path()).unwrap();
        let abandoned = folder.path().join(".reachcast-a1B2c3.part");
        let others = [
            ".reachcast-a1B2c3",
            ".reachcast-notes.part",
            ".reachcast-a1B2c3.part.txt",
            "reachcast-a1B2c3.part",
            "notes.txt",
        ];
        let folders = folder.path().join(".reachcast-f0lder.part");
        std::fs::create_dir(&folders).unwrap();
        for name in others {
            std::fs::write(folder.path().join(name), "mine").unwrap();
        }
        std::fs::write(&abandoned, "half of a fi").unwrap();
        clear(folder.path());
        assert!(!abandoned.exists());
        assert!(live.path().exists() && folders.is_dir());
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
        drop(live);
        // Two live writers, and one that clears all the time: none loses its file.
        std::thread::scope(|scope| {
            let writers = [0, 1].map(|_| {
                scope.spawn(|| {
                    for i in 0..400 {
                        let name = folder.path().join(format!("result-{i}"));
                        temporary(folder.path()).unwrap().persist(name).unwrap();
                    }
                })
            });
            while !writers.iter().all(|writer| writer.is_finished()) {
                clear(folder.path());
            }
        });
    }
}
