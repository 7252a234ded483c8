//! Graphs made operation by operation, from `x` to `y`: refused with these words, or of these values.

use std::path::Path;

use reachcast::policy::Mlp;
use reachcast::policy::import::{Request, from_bytes};

/// A factor of each weight of [`square`].
pub(crate) const WEIGHTS: [f32; 16] =
    [0.5, -1.0, 0.25, 2.0, 1.5, 0.75, -0.5, 1.0, -2.0, 0.5, 1.0, -0.25, 0.125, 1.0, -1.5, 0.5];

pub(crate) fn varint(mut n: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while n >= 128 {
        bytes.push(n as u8 | 128);
        n >>= 7;
    }
    bytes.push(n as u8);
    bytes
}

/// A field of bytes.
pub(crate) fn field(tag: u64, content: &[u8]) -> Vec<u8> {
    [varint(tag << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
}

/// A field of a whole number.
pub(crate) fn whole(tag: u64, n: i64) -> Vec<u8> {
    [varint(tag << 3), varint(n as u64)].concat()
}

pub(crate) fn raw(name: &str, lengths: &[i64], kind: i64, bytes: &[u8]) -> Vec<u8> {
    let lengths: Vec<u8> = lengths.iter().flat_map(|&length| whole(1, length)).collect();
    [lengths, whole(2, kind), field(8, name.as_bytes()), field(9, bytes)].concat()
}

pub(crate) fn tensor(name: &str, lengths: &[i64], numbers: &[f32]) -> Vec<u8> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    raw(name, lengths, 1, &bytes)
}

pub(crate) fn places(name: &str, lengths: &[i64], numbers: &[i64]) -> Vec<u8> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    raw(name, lengths, 7, &bytes)
}

/// The weights of four numbers from four.
pub(crate) fn square() -> Vec<u8> {
    tensor("W", &[4, 4], &WEIGHTS)
}

pub(crate) fn attribute(name: &str, n: i64) -> Vec<u8> {
    [field(1, name.as_bytes()), whole(3, n), whole(20, 2)].concat()
}

pub(crate) fn word(name: &str, word: &str) -> Vec<u8> {
    [field(1, name.as_bytes()), field(4, word.as_bytes()), whole(20, 3)].concat()
}

pub(crate) fn order(name: &str, all: &[i64]) -> Vec<u8> {
    let all: Vec<u8> = all.iter().flat_map(|&n| whole(8, n)).collect();
    [field(1, name.as_bytes()), all, whole(20, 7)].concat()
}

/// An operation, as `Gemm a W -> b`.
pub(crate) fn node_with(text: &str, attributes: &[Vec<u8>]) -> Vec<u8> {
    let (left, outputs) = text.split_once(" -> ").unwrap();
    let mut words = left.split(' ');
    let operation = field(4, words.next().unwrap().as_bytes());
    let inputs: Vec<u8> = words.flat_map(|name| field(1, name.as_bytes())).collect();
    let outputs: Vec<u8> = outputs.split(' ').flat_map(|name| field(2, name.as_bytes())).collect();
    let attributes: Vec<u8> = attributes.iter().flat_map(|content| field(5, content)).collect();
    [inputs, outputs, operation, attributes].concat()
}

pub(crate) fn node(text: &str) -> Vec<u8> {
    node_with(text, &[])
}

/// `W x`.
pub(crate) fn layer(from: &str, to: &str) -> Vec<u8> {
    node_with(&format!("Gemm {from} W -> {to}"), &[attribute("transB", 1)])
}

/// A graph from `x` to `y`; a length that is 0 has a name.
pub(crate) fn graph(lengths: &[i64], nodes: &[Vec<u8>], tensors: &[Vec<u8>]) -> Vec<u8> {
    let length = |&length: &i64| match length {
        0 => field(1, &field(2, b"n")),
        _ => field(1, &whole(1, length)),
    };
    let shape: Vec<u8> = lengths.iter().flat_map(length).collect();
    let kind = field(1, &[whole(1, 1), field(2, &shape)].concat());
    let named = |name: &[u8]| [field(1, name), field(2, &kind)].concat();
    let all = |tag: u64, all: &[Vec<u8>]| -> Vec<u8> {
        all.iter().flat_map(|content| field(tag, content)).collect()
    };
    let parts = [all(1, nodes), all(5, tensors), field(11, &named(b"x")), field(12, &named(b"y"))];
    [whole(1, 9), field(7, &parts.concat())].concat()
}

pub(crate) fn outcome(content: &[u8]) -> Result<Mlp, String> {
    let found = from_bytes(Path::new("made.onnx"), content, &Request::default());
    found.map(|found| found.network).map_err(|error| {
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    })
}

pub(crate) fn refused(words: &[&str], lengths: &[i64], nodes: &[Vec<u8>], tensors: &[Vec<u8>]) {
    let message = outcome(&graph(lengths, nodes, tensors)).err();
    let message = message.unwrap_or_else(|| panic!("imported, not refused with {words:?}"));
    assert!(words.iter().all(|word| message.contains(word)), "{words:?} in {message}");
}

/// What `W x` is.
pub(crate) fn sums(x: &[f32]) -> Vec<f32> {
    let row = |row: &[f32]| row.iter().zip(x).map(|(w, x)| w * x).sum();
    WEIGHTS.chunks(4).map(row).collect()
}

pub(crate) fn is(
    expected: impl Fn(&[f32]) -> Vec<f32>,
    lengths: &[i64],
    nodes: &[Vec<u8>],
    tensors: &[Vec<u8>],
) {
    let network = outcome(&graph(lengths, nodes, tensors)).unwrap();
    for x in [[1.0, -2.0, 0.5, 3.0], [40.0, -70.0, 10.0, 90.0], [-0.25, 0.5, 8.0, -16.0]] {
        let (found, expected) = (network.forward(&x), expected(&x));
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                (found - expected).abs() <= 1e-5 * expected.abs().max(1.0),
                "{found} {expected}"
            );
        }
    }
}
