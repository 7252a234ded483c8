//! Named arrays in .npz files: as they are, and as arrays in a whole archive.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast::files::{npz_bytes, read_npz};
use reachcast_fuzz::{archive, refused, with_file};

fn read(bytes: &[u8]) {
    let arrays = match with_file("fuzz.npz", bytes, read_npz) {
        Ok(arrays) => arrays,
        Err(error) => return refused(&error),
    };
    let list: Vec<_> = arrays.into_iter().collect();
    let list: Vec<_> = list.iter().map(|(name, array)| (name.as_str(), array.clone())).collect();
    // Names of a file may be such that an archive cannot have them twice over.
    if let Ok(written) = npz_bytes(&list) {
        with_file("again.npz", &written, read_npz).expect("what was written is whole");
    }
}

fuzz_target!(|bytes: &[u8]| {
    match bytes.starts_with(b"PK") {
        true => read(bytes),
        false => read(&archive(&[("a.npy", bytes), ("b.npy", &bytes[bytes.len() / 2..])])),
    }
});
