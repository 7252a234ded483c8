//! Networks in safetensors: read, run, written and read again.

#![no_main]

use libfuzzer_sys::fuzz_target;
use reachcast::policy::Mlp;
use reachcast::policy::inspect::Inspection;

fuzz_target!(|bytes: &[u8]| {
    let Ok(network) = Mlp::from_bytes(bytes) else { return };
    network.forward(&vec![0.5_f32; network.widths()[0]]);
    let _ = Inspection::of(&network);
    let again = Mlp::from_bytes(&network.to_bytes()).expect("what was written is whole");
    assert_eq!(again.digest(), network.digest());
});
