//! Safetensors files of other programs.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast_fuzz::import;

fuzz_target!(|bytes: &[u8]| import("fuzz.safetensors", bytes));
