//! Pipelines kept on disk: the program from outside, run after run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::gpu;

/// Rolls out the published starts on the adapter; the bytes of their measures.
fn measures(out: &Path, cache: &Path) -> Vec<u8> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let file = out.join("measures.npy");
    let run = Command::new(env!("CARGO_BIN_EXE_reachcast"))
        .args(["rollout", "configs/race.toml", "--backend", "gpu", "-q", "--overwrite"])
        .args(["--starts", "configs/race_starts_500.csv", "--measures"])
        .arg(&file)
        .current_dir(root)
        .env("REACHCAST_PIPELINE_CACHE", cache)
        .output()
        .expect("the program starts");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    fs::read(file).expect("measures")
}

/// The only file of `folder`.
fn only_file(folder: &Path) -> PathBuf {
    let entries: Vec<_> = fs::read_dir(folder).expect("the folder of the cache").collect();
    let [Ok(entry)] = entries.as_slice() else { panic!("not one file: {entries:?}") };
    entry.path()
}

#[test]
fn runs_start_from_the_file_of_the_last() {
    if gpu().is_none() {
        return;
    }
    let temporary = tempfile::tempdir().expect("a folder");
    let (out, cache) = (temporary.path(), temporary.path().join("cache"));
    let first = measures(out, &cache);
    let file = only_file(&cache);
    let stored = fs::read(&file).expect("stored pipelines");

    // What was read and taken is not written again: the file stays the same file.
    let written = |file: &Path| fs::metadata(file).and_then(|data| data.modified()).expect("time");
    let before = written(&file);
    assert_eq!(measures(out, &cache), first, "from stored pipelines");
    assert_eq!(written(&file), before, "the file was not accepted");

    // A damaged file is replaced by a whole one.
    let mut damaged = stored.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x55;
    for bytes in [&damaged[..], &stored[..stored.len() / 2], &[]] {
        fs::write(&file, bytes).expect("a damaged file");
        assert_eq!(measures(out, &cache), first, "from a damaged file");
        assert_ne!(fs::read(only_file(&cache)).expect("a new file"), bytes);
    }
}

#[test]
fn a_run_does_without_the_file() {
    if gpu().is_none() {
        return;
    }
    let temporary = tempfile::tempdir().expect("a folder");
    let out = temporary.path();
    let plain = measures(out, Path::new("off"));
    // A folder that cannot be made, since a file stands in its place: root may write anywhere else.
    let file = out.join("file");
    fs::write(&file, "in the way").expect("a file");
    assert_eq!(measures(out, &file.join("cache")), plain);
    assert_eq!(fs::read(&file).expect("untouched"), b"in the way");
    let left: Vec<_> = fs::read_dir(out).expect("the folder").flatten().collect();
    assert_eq!(left.len(), 2, "the measures and the file: {left:?}");
}
