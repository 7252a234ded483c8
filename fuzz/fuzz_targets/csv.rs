//! States in .csv files, read in pieces, for both systems.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast_fuzz::{read_states, with_file};

fuzz_target!(|bytes: &[u8]| {
    with_file("fuzz.csv", bytes, |path| {
        read_states(path, 2);
        read_states(path, 12);
    });
});
