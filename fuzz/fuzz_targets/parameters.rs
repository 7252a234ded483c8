//! Pickles that are files of their own: parameters of JAX, and checkpoints of PyTorch before 1.6.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast_fuzz::import;

fuzz_target!(|bytes: &[u8]| import("fuzz.pkl", bytes));
