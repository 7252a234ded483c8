//! ONNX graphs.

#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use reachcast::policy::import::{Request, from_bytes};
use reachcast_fuzz::refused;

fuzz_target!(|bytes: &[u8]| {
    match from_bytes(Path::new("fuzz.onnx"), bytes, &Request::default()) {
        Ok(found) => drop(found.network.digest()),
        Err(error) => refused(&error),
    }
});
