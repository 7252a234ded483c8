//! Networks as text: of ACAS Xu, of Sherlock and of POLAR.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast_fuzz::import;

fuzz_target!(|bytes: &[u8]| {
    import("fuzz.nnet", bytes);
    import("fuzz.txt", bytes);
});
