//! What a file is, told by its first bytes, and what to do with one that holds no policy that is read.

use std::path::Path;

use super::text;

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// A zip archive: a checkpoint of PyTorch, or of stable-baselines3.
    Archive,
    /// A pickle: of JAX, or of PyTorch before 1.6.
    Pickle,
    /// A safetensors file.
    Safetensors,
    /// An ONNX graph.
    Graph,
    /// The text of ACAS networks.
    Nnet,
    /// The text of Sherlock and POLAR.
    Polar,
}

/// First bytes of other files, what they are, and what to do.
const OTHERS: [(&[u8], &str, &str); 13] = [
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file, as Keras writes it (or MATLAB 7.3)", KERAS),
    (b"MATLAB 5.0", "a MATLAB file", MATLAB),
    (b"MATLAB 7.3", "a MATLAB file of version 7.3, which is HDF5", MATLAB_HDF5),
    (b"\x1f\x8b", "compressed with gzip", "unpack it first: gunzip -k FILE"),
    (
        b"version https://git-lfs",
        "a pointer of Git LFS, and not the file itself",
        "fetch it first: git lfs pull",
    ),
    (b"\x93NUMPY", "one NumPy array (.npy)", NUMPY),
    (b"<!DOCTYPE", "an HTML page, and not the file itself", HTML),
    (b"<!doctype", "an HTML page, and not the file itself", HTML),
    (b"<html", "an HTML page, and not the file itself", HTML),
    (b"BZh", "compressed with bzip2", "unpack it first: bunzip2 -k FILE"),
    (b"\xfd7zXZ\0", "compressed with xz", "unpack it first: xz -dk FILE"),
    (
        b"\x28\xb5\x2f\xfd",
        "compressed with zstd",
        "unpack it first: zstd -d FILE; of Orbax, save the parameters alone",
    ),
    (b"Rar!", "a RAR archive", "unpack it first"),
];
const KERAS: &str =
    "convert it to ONNX: python -m tf2onnx.convert --keras FILE --output policy.onnx";
const MATLAB: &str = "export the network to ONNX in MATLAB: exportONNXNetwork(net, 'policy.onnx'); or save its weights, \
                      [out, in], as safetensors in Python: safetensors.numpy.save_file({'0.weight': \
                      numpy.ascontiguousarray(scipy.io.loadmat(FILE)['W1'], 'f4'), '0.bias': \
                      scipy.io.loadmat(FILE)['b1'].ravel().astype('f4')}, 'policy.safetensors'); a weight [in, out] goes \
                      under '0.kernel'";
const MATLAB_HDF5: &str = "export the network to ONNX in MATLAB: exportONNXNetwork(net, 'policy.onnx'); or save it again \
                           with save(FILE, '-v7'), and import that";
const NUMPY: &str = "save all arrays of the network as safetensors: safetensors.numpy.save_file({'0.weight': w0, \
                     '0.bias': b0}, 'policy.safetensors'), each w [out, in]; one that is [in, out] goes under '0.kernel'";
/// A file in an archive of arrays that `policy export` writes.
const EXPORTED: &[u8] = b"layers.0.weight.npy";
/// The refusal of such an archive.
pub(super) const OWN_ARRAYS: &str = "the arrays of a policy file, as `reachcast policy export` writes them for other programs \
                                     (.npz); use the policy file, or export it with --to onnx, which is imported again";
const HTML: &str = "download it again, from the address of the raw file";
const FLAX: &str = "write its parameters as safetensors: p = flax.serialization.msgpack_restore(open(FILE, 'rb').read()); \
                    safetensors.flax.save_file(flax.traverse_util.flatten_dict(p, sep='.'), 'policy.safetensors')";

impl Format {
    /// The format of the file `path` with this content.
    ///
    /// # Errors
    /// What it is instead, and what to do.
    pub(super) fn of(path: &Path, bytes: &[u8]) -> Result<Self, String> {
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        let ending = ending.as_deref().and_then(|ending| ending.to_str()).unwrap_or_default();
        if let Some((_, what, remedy)) = OTHERS.iter().find(|(first, ..)| bytes.starts_with(first))
        {
            return Err(format!("{what}; {remedy}"));
        }
        Ok(match bytes {
            [b'P', b'K', 3, 4, ..] if ending == "npz" && has(bytes, EXPORTED) => {
                return Err(OWN_ARRAYS.to_owned());
            }
            [b'P', b'K', 3, 4, ..] if ending == "npz" => {
                return Err(format!("NumPy arrays (.npz); {NUMPY}"));
            }
            [b'P', b'K', 3, 4, ..] => Self::Archive,
            _ if ending == "onnx" => Self::Graph,
            _ if ending == "mat" => return Err(format!("a MATLAB file of version 4; {MATLAB}")),
            // The length of its header may begin like a pickle.
            _ if is_safetensors(bytes) => Self::Safetensors,
            [0x80, 2..=5, ..] => Self::Pickle,
            _ if ending == "nnet" => Self::Nnet,
            _ if text::is_numbers(bytes) => Self::Polar,
            // A map of up to 15 entries whose first key is a text: what flax writes.
            [0x80..=0x8f, 0xa0..=0xbf | 0xd9, ..] => {
                return Err(format!("MessagePack, as flax writes it; {FLAX}"));
            }
            [] => return Err("an empty file".to_owned()),
            _ => return Err(unknown(bytes)),
        })
    }
}

/// Whether `bytes` hold a text.
fn has(bytes: &[u8], text: &[u8]) -> bool {
    bytes.windows(text.len()).any(|window| window == text)
}

/// Whether `bytes` begin with the length of a header in JSON that may be in them.
fn is_safetensors(bytes: &[u8]) -> bool {
    let length = bytes.first_chunk().map(|length| u64::from_le_bytes(*length));
    let fits = length.is_some_and(|length| length <= bytes.len() as u64);
    bytes.get(8) == Some(&b'{') && (fits || bytes[6..8] == [0, 0])
}

/// The refusal of a file that nothing is known of.
fn unknown(bytes: &[u8]) -> String {
    let text = std::str::from_utf8(bytes.get(..64).unwrap_or(bytes)).is_ok();
    let what = if text { "a text" } else { "a file" };
    format!(
        "{what} of a format that is not known: neither a checkpoint of PyTorch (a zip archive), a pickle, safetensors, \
         .nnet, \
         the text of Sherlock or POLAR (two lines of a whole number each at its beginning), nor called .onnx"
    )
}
