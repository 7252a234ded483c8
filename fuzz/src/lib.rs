//! What the targets share: inputs as files, archives around inputs, and what an error has to be.

use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use reachcast::Error;
use reachcast::config::{Config, PolicySource};
use reachcast::files::StateReader;
use reachcast::policy::Mlp;
use reachcast::policy::import::{Request, from_bytes};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A policy that fits races.
const NETWORK: &[u8] = include_bytes!("../../configs/policies/race_policy.safetensors");

/// Puts `bytes` into a file of this name and hands its path on.
pub fn with_file<T>(name: &str, bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().expect("a folder for inputs"));
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, bytes).expect("an input that can be written");
    read(&path)
}

/// A zip archive with these entries, stored, so that inputs get past the checksums.
pub fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, bytes) in entries {
        zip.start_file(*name, stored).expect("an entry");
        zip.write_all(bytes).expect("its bytes");
    }
    zip.finish().expect("an archive").into_inner()
}

/// Imports `bytes` as the file `name`: a network with a digest, or a refusal.
pub fn import(name: &str, bytes: &[u8]) {
    match from_bytes(Path::new(name), bytes, &Request::default()) {
        Ok(found) => drop(found.network.digest()),
        Err(error) => refused(&error),
    }
}

/// Refusals are those of wrong input and say something.
pub fn refused(error: &Error) {
    let mut text = String::new();
    write!(text, "{error}").expect("text");
    assert!(!text.is_empty());
    assert_eq!(error.exit_code(), 2, "{text}");
}

/// Reads all states of a file, `size` numbers each, seven at a time: finite numbers, or a refusal.
pub fn read_states(path: &Path, size: usize) {
    let names = (0..size).map(|i| format!("x{i}")).collect();
    let mut reader = match StateReader::open(path, names) {
        Ok(reader) => reader,
        Err(error) => return refused(&error),
    };
    loop {
        match reader.next(7) {
            Ok(states) if states.is_empty() => return,
            Ok(states) => assert!(states.iter().flatten().all(|value| value.is_finite())),
            Err(error) => return refused(&error),
        }
    }
}

/// The formula of a configuration, or the carried network in place of any file that it names,
/// since that name may be one of any file of this machine.
pub fn policy(config: &Config) -> PolicySource {
    if config.policy.file.is_none()
        && let Ok(formula) = config.policy_source(Path::new(""))
    {
        return formula;
    }
    PolicySource::Network {
        path: "race_policy.safetensors".into(),
        bytes: NETWORK.to_vec(),
        network: Mlp::from_bytes(NETWORK).expect("the carried policy"),
    }
}
