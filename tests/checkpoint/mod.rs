//! The checkpoints of `tests/fixtures`, whole and with entries or bytes changed.

#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};

use rand::RngExt;
use rand::rngs::StdRng;
use reachcast::policy::Activation;
use reachcast::policy::import::{Imported, Request, from_bytes};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// A file of `tests/fixtures/checkpoints`.
pub(crate) fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/checkpoints").join(name)
}

/// Its content.
pub(crate) fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).unwrap()
}

/// A request that states what a plain checkpoint does not say: `relu` between its layers, and `tanh` at the end.
pub(crate) fn stated() -> Request {
    let (activation, output) = (Some(Activation::Relu), Some(Activation::Tanh));
    Request { activation, output, ..Request::default() }
}

/// `content` with up to four bytes changed at random: to others, by a bit, or to bytes of other places.
pub(crate) fn damaged(content: &[u8], draw: &mut StdRng) -> Vec<u8> {
    let mut changed = content.to_vec();
    for _ in 0..draw.random_range(1..=4) {
        let at = draw.random_range(0..changed.len());
        changed[at] = match draw.random_range(0..3) {
            0 => draw.random(),
            1 => changed[at] ^ 1 << draw.random_range(0..8),
            _ => content[draw.random_range(0..content.len())],
        };
    }
    changed
}

/// Imports `content` as the file `name`.
pub(crate) fn import(
    name: &Path,
    content: &[u8],
    request: &Request,
) -> reachcast::Result<Imported> {
    from_bytes(name, content, request)
}

/// Imports a file and expects a refusal as wrong input, with `words` in the message.
pub(crate) fn refused(name: &str, request: &Request, words: &[&str]) {
    refused_bytes(name, &bytes(name), request, words);
}

/// The same for changed content.
pub(crate) fn refused_bytes(name: &str, content: &[u8], request: &Request, words: &[&str]) {
    let Err(error) = import(Path::new(name), content, request) else {
        panic!("{name} with {request:?} was imported, expected {words:?}");
    };
    assert_eq!(error.exit_code(), 2, "{error}");
    let message = error.to_string();
    for word in words {
        assert!(message.contains(word), "{name}: no `{word}` in: {message}");
    }
}

/// The archive `name` with the content of each entry changed by `change`; `None` leaves it out.
pub(crate) fn rewritten(
    name: &str,
    mut change: impl FnMut(&str, Vec<u8>) -> Option<Vec<u8>>,
) -> Vec<u8> {
    let mut old = ZipArchive::new(Cursor::new(bytes(name))).unwrap();
    let mut new = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for index in 0..old.len() {
        let mut entry = old.by_index(index).unwrap();
        let name = entry.name().unwrap().into_owned();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        let short = name.split_once('/').unwrap().1.to_owned();
        if let Some(content) = change(&short, content) {
            new.start_file(name, options).unwrap();
            new.write_all(&content).unwrap();
        }
    }
    new.finish().unwrap().into_inner()
}

/// The archive `name` with another pickle.
pub(crate) fn with_pickle(name: &str, pickle: &[u8]) -> Vec<u8> {
    rewritten(name, |entry, old| Some(if entry == "data.pkl" { pickle.to_vec() } else { old }))
}

/// The pickle of the archive `name`.
pub(crate) fn pickle(name: &str) -> Vec<u8> {
    let mut pickle = Vec::new();
    rewritten(name, |entry, old| {
        if entry == "data.pkl" {
            pickle.clone_from(&old);
        }
        Some(old)
    });
    pickle
}

/// `bytes` with the first `old` replaced by `new`.
pub(crate) fn replaced(bytes: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let at = bytes.windows(old.len()).position(|window| window == old);
    let at = at.unwrap_or_else(|| panic!("{old:?} is not in the bytes"));
    [&bytes[..at], new, &bytes[at + old.len()..]].concat()
}
