//! PyTorch checkpoints: whole files, and pickles in a whole archive.

#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use reachcast::policy::import::{Request, from_bytes};
use reachcast_fuzz::{archive, refused};

/// Bytes of the storages that a bare pickle may refer to.
const STORAGES: [[u8; 1024]; 3] = [[0; 1024], [60; 1024], [190; 1024]];

fn read(bytes: &[u8]) {
    for networks in [vec![], vec!["actor1_old".to_owned()]] {
        let request = Request { networks, ..Request::default() };
        match from_bytes(Path::new("fuzz.pth"), bytes, &request) {
            Ok(found) => drop(found.network.digest()),
            Err(error) => refused(&error),
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    if bytes.starts_with(b"PK") {
        return read(bytes);
    }
    let [a, b, c] = &STORAGES;
    read(&archive(&[
        ("fuzz/data.pkl", bytes),
        ("fuzz/byteorder", b"little"),
        ("fuzz/data/0", a),
        ("fuzz/data/1", b),
        ("fuzz/data/2", c),
        ("fuzz/version", b"3\n"),
    ]));
});
