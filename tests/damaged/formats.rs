//! What a file is when it holds no policy that is read, and what to do with it.

use std::path::Path;

use reachcast::policy::import::{Request, from_bytes};

#[test]
fn files_of_other_formats_are_named_with_a_remedy() {
    let at = |name: &str, content: &[u8], words: &[&str]| {
        let error = from_bytes(Path::new(name), content, &Request::default()).unwrap_err();
        let message = error.to_string();
        assert_eq!(error.exit_code(), 2);
        assert!(words.iter().all(|word| message.contains(word)), "{name}: {message}");
    };
    at("net.h5", b"\x89HDF\r\n\x1a\n\0\0", &["HDF5", "Keras", "tf2onnx"]);
    at("net.mat", b"MATLAB 5.0 MAT-file, Platform", &["MATLAB", "exportONNXNetwork", "loadmat"]);
    at("net.onnx.gz", b"\x1f\x8b\x08\0", &["gzip", "gunzip -k"]);
    at("net.onnx", b"version https://git-lfs.github.com/spec/v1\n", &["Git LFS", "git lfs pull"]);
    at("net.npy", b"\x93NUMPY\x01\0", &["NumPy array", "safetensors.numpy.save_file"]);
    at("net.pth", b"<!DOCTYPE html><html>", &["HTML", "download it again"]);
    at(
        "net.msgpack",
        b"\x81\xa6params\x82\xa7Dense_0",
        &["MessagePack", "flax", "msgpack_restore"],
    );
    at("net.txt", b"a network of mine", &["a text", "not known"]);
    at("net.pth", b"\xff\xfe\xfd\xfc", &["a file", "not known"]);
    at("net.npz", &super::content("sb3_ppo.zip"), &["NumPy arrays (.npz)"]);
}
