//! Damaged and hostile files of the other readers: models, parameters, texts, safetensors and larger graphs.

mod followed;
mod formats;
mod graphs;
mod hostile;
mod made;
mod refusals;

use std::path::Path;

use rand::SeedableRng;
use rand::rngs::StdRng;
use reachcast::policy::import::{Request, from_bytes};

use crate::checkpoint::{damaged, stated};

/// Files that are damaged, one of each reader, and the parts of them whose numbers decide something.
const FILES: [&str; 13] = [
    "brax.pkl",
    "brax_numpy.pkl",
    "flax.pkl",
    "legacy.pth",
    "sb3_ppo.zip",
    "foreign.safetensors",
    "acas.nnet",
    "polar.txt",
    "sherlock.txt",
    "written_out.onnx",
    "affine.onnx",
    "halves.onnx",
    "image.onnx",
];

/// The content of a file of `tests/fixtures/imports`.
pub(crate) fn content(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/imports").join(name))
        .unwrap()
}

/// Whether a network is imported; a refusal has to be one of wrong input.
fn imports(name: &str, content: &[u8]) -> bool {
    // Of some files nobody but the request says what lies between the layers.
    let unsaid = ["flax.pkl", "legacy.pth", "foreign.safetensors"].contains(&name);
    let request = if unsaid { stated() } else { Request::default() };
    match from_bytes(Path::new(name), content, &request) {
        Ok(found) => !found.network.digest().is_empty(),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{name}: {error}");
            false
        }
    }
}

/// What is cut off is refused, but for what ends where nothing is missing: blanks, and the version of a graph.
#[test]
fn truncated_files_are_refused() {
    for name in FILES {
        let whole = content(name);
        assert!(imports(name, &whole), "{name}");
        let step = whole.len().div_ceil(1500);
        let taken = (0..whole.len())
            .step_by(step)
            .filter(|&length| imports(name, &whole[..length]))
            .count();
        // A text that ends within its last number has one digit less, or no map of its output.
        let most = if name.ends_with(".txt") || name.ends_with(".nnet") { 24 } else { 8 };
        assert!(taken <= most, "{name}: {taken} truncated files were imported");
    }
}

#[test]
fn changed_bytes_crash_nothing() {
    let mut draw = StdRng::seed_from_u64(3);
    let mut refused = 0;
    for name in FILES {
        let whole = content(name);
        for _ in 0..1_500 {
            refused += usize::from(!imports(name, &damaged(&whole, &mut draw)));
        }
    }
    println!("{refused} refused");
    assert!(refused > 5_000, "{refused} refused");
}
