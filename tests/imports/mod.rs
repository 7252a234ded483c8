//! Policies of the libraries of the field: what comes out of each file is what its library makes of it.

mod archives;
mod beside;
mod doubt;
mod forward;
mod layouts;
mod lost;
mod scripts;
mod written;

use std::path::{Path, PathBuf};

use reachcast::policy::import::{Imported, Request, read};

/// A file of `tests/fixtures/imports`.
pub(crate) fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/imports").join(name)
}

/// What is imported of it, the weights in f64 among them.
pub(crate) fn imported(name: &str, request: &Request) -> Imported {
    read(&path(name), request).unwrap_or_else(|error| panic!("{error}"))
}

/// A request for these networks.
pub(crate) fn named(networks: &[&str]) -> Request {
    let networks = networks.iter().map(|&name| name.to_owned()).collect();
    Request { networks, ..Request::default() }
}

/// The refusal of a file, with all of these words.
pub(crate) fn refusal(name: &str, request: &Request, words: &[&str]) {
    let error = read(&path(name), request).err().unwrap_or_else(|| panic!("{name} was imported"));
    assert_eq!(error.exit_code(), 2, "{error}");
    let message = error.to_string();
    for word in words {
        assert!(message.contains(word), "{name}: no `{word}` in: {message}");
    }
}
