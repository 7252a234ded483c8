//! Models of stable-baselines3: whole archives, and what `data` says beside a whole checkpoint.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast_fuzz::{archive, import};

/// A checkpoint of a body and a head.
const CHECKPOINT: &[u8] = include_bytes!("../corpus/policy.pth");

fuzz_target!(|bytes: &[u8]| {
    match bytes.starts_with(b"PK") {
        true => import("fuzz.zip", bytes),
        false => import("fuzz.zip", &archive(&[("data", bytes), ("policy.pth", CHECKPOINT)])),
    }
});
