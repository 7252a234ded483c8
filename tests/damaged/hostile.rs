//! Files that are made to be read wrongly: names that run programs, lengths that are not there, and claims.

use std::io::{Cursor, Read, Write};
use std::path::Path;

use reachcast::policy::import::{Request, from_bytes};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::content;
use crate::checkpoint::replaced;

fn refused(name: &str, content: &[u8], words: &[&str]) {
    let error = from_bytes(Path::new(name), content, &Request::default());
    let error = error.err().unwrap_or_else(|| panic!("{name} was imported"));
    assert_eq!(error.exit_code(), 2, "{error}");
    let message = error.to_string();
    assert!(words.iter().all(|word| message.contains(word)), "{name}: {words:?} in {message}");
}

/// A short text as protocol 4 has it.
fn short(text: &str) -> Vec<u8> {
    [&[0x8c, text.len() as u8], text.as_bytes()].concat()
}

/// The archive with another entry.
fn with_entry(archive: &[u8], name: &str, new: &[u8]) -> Vec<u8> {
    let mut old = ZipArchive::new(Cursor::new(archive)).unwrap();
    let mut made = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for index in 0..old.len() {
        let mut entry = old.by_index(index).unwrap();
        let own = entry.name().unwrap().into_owned();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        made.start_file(own.clone(), options).unwrap();
        made.write_all(if own == name { new } else { &content }).unwrap();
    }
    made.finish().unwrap().into_inner()
}

#[test]
fn parameters_that_would_run_programs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mark = folder.path().join("mark");
    let command = format!("touch {}", mark.display());
    let good = content("brax_numpy.pkl");
    // In the place of the class of the statistics, and of the function that makes arrays.
    let class = replaced(&good, &short("brax.training.acme.running_statistics"), &short("posix"));
    let class = replaced(&class, &short("RunningStatisticsState"), &short("system"));
    refused("brax.pkl", &class, &["`posix.system`", "nothing was executed"]);
    let array = replaced(&good, &short("_reconstruct"), &short("_system"));
    refused("brax.pkl", &array, &["_system", "nothing was executed"]);
    let call = [
        b"\x80\x04".as_slice(),
        &short("os"),
        &short("system"),
        b"\x93",
        &short(&command),
        b"\x85R.",
    ]
    .concat();
    refused("brax.pkl", &call, &["`os.system`", "nothing was executed"]);
    // The order of bytes of a kind of numbers that several arrays share.
    let swapped = replaced(&good, &short("<"), &short(">"));
    refused("brax.pkl", &swapped, &["most significant byte first", "astype"]);
    let old = replaced(
        &content("legacy.pth"),
        b"ctorch._utils\n_rebuild_tensor_v2\n",
        b"cbuiltins\neval\n",
    );
    refused("old.pth", &old, &["`builtins.eval`", "nothing was executed"]);
    assert!(!mark.exists());
}

#[test]
fn models_that_claim_something_else_are_refused() {
    let good = content("sb3_ppo.zip");
    refused("model.zip", &with_entry(&good, "data", b"{"), &["`data`", "no JSON"]);
    let unknown = br#"{"policy_kwargs": {"activation_fn": "<class 'os.system'>"}}"#;
    refused(
        "model.zip",
        &with_entry(&good, "data", unknown),
        &["<class 'os.system'>", "none that is known"],
    );
    let discrete =
        br#"{"action_space": {":type:": "<class 'gymnasium.spaces.discrete.Discrete'>"}}"#;
    refused(
        "model.zip",
        &with_entry(&good, "data", discrete),
        &["Discrete", "largest output", "--network"],
    );
    let wide = br#"{"action_space": {":type:": "Box", "low": "[-1 -1 -1]", "high": "[1 2 3]"}}"#;
    refused("model.zip", &with_entry(&good, "data", wide), &["2 numbers", "takes 3"]);
    refused("model.zip", &with_entry(&good, "policy.pth", b"PK\x03\x04"), &["not a whole archive"]);
    for (data, class) in [
        (
            r#"{"policy_kwargs": {"features_extractor_class": "<class 'x.Norm'>"}}"#,
            "<class 'x.Norm'>",
        ),
        (r#"{"policy_class": {"__module__": "mine.policies"}}"#, "mine.policies"),
    ] {
        let own = with_entry(&good, "data", data.as_bytes());
        refused("model.zip", &own, &[class, "--network imports the layers alone"]);
        let networks = ["mlp_extractor.policy_net", "action_net"].map(str::to_owned).to_vec();
        let named = Request { networks, ..Request::default() };
        assert!(from_bytes(Path::new("model.zip"), &own, &named).is_ok());
    }
    let flat = br#"{"policy_kwargs": {"features_extractor_class":
        "<class 'stable_baselines3.common.torch_layers.FlattenExtractor'>"}}"#;
    let flat = with_entry(&good, "data", flat);
    assert!(from_bytes(Path::new("model.zip"), &flat, &Request::default()).is_ok());
    // Objects in it are texts that nobody looks at.
    let pickled = br#"{"policy_class": {":type:": "x", ":serialized:": "Y29zCnN5c3RlbQo="}}"#;
    let model = with_entry(&good, "data", pickled);
    assert!(from_bytes(Path::new("model.zip"), &model, &Request::default()).is_ok());
}

#[test]
fn lengths_that_are_not_there_take_no_memory() {
    let text = |numbers: &str, words: &[&str]| refused("net.txt", numbers.as_bytes(), words);
    text("1000000\n1000000\n1\n1000000\n", &["cut off", "a weight"]);
    text("4\n2\n99999999\n", &["`99999999`", "no whole number"]);
    text("4\n2\n63\n", &["cut off"]);
    text("4\n2\n64\n", &["65 layers"]);
    text("4\n2\n1\n8\nReLU\nsoftmax\n", &["`softmax`"]);
    text("1\n1\n1\n1\n1\nnan\n1\n1\n", &["`nan`", "no finite number"]);
    let acas = |text: &str, words: &[&str]| refused("net.nnet", text.as_bytes(), words);
    acas("60,1000000,2,1000000,\n", &["cut off"]);
    acas("1,1,1,1,\n1,1,\n0,\n-1,\n1,\n0,0,\n0,1,\n1,\n0,\n", &["range", "not positive"]);
    acas(
        "1,1,1,1,\n1,1,\n0,\n1,\n-1,\n0,0,\n1,1,\n1,\n0,\n",
        &["input 0", "least value 1", "above"],
    );
    acas("1,2,1,2,\n1,1,\n", &["widths [1, 1]"]);
    acas("1,1,1,1,\n1,1,\n0,\n-1,\n1,\n0,0,\n1,1,\n1,\n0,\n7", &["1 words behind"]);
    // A length of a storage, of bytes in a pickle, and of a header.
    let old = content("legacy.pth");
    let storage = old.windows(8).rposition(|window| window == 64_u64.to_le_bytes()).unwrap();
    let mut long = old.clone();
    long[storage..storage + 8].copy_from_slice(&(u64::MAX / 8).to_le_bytes());
    refused("old.pth", &long, &["storage", "cut off"]);
    let bytes = [b"\x80\x05\x8e".as_slice(), &u64::MAX.to_le_bytes()].concat();
    refused("x.pkl", &bytes, &["cut off"]);
    let mut header = content("foreign.safetensors");
    header[..6].copy_from_slice(&[0xff; 6]);
    refused("x.safetensors", &header, &["not a whole safetensors file"]);
    // A text that stands for bytes is turned into them once, however often it is asked for.
    let latin = [b"X\x00\x00\x10\x00".as_slice(), &b"a".repeat(1 << 20), b"q\x00"].concat();
    let call = b"c_codecs\nencode\nh\x00X\x06\x00\x00\x00latin1\x86R0".repeat(20_000);
    refused("x.pkl", &[b"\x80\x02", latin.as_slice(), &call, b"."].concat(), &["no dictionary"]);
    refused(
        "x.pkl",
        &[b"\x80\x02".as_slice(), &b"]0".repeat(1 << 22)].concat(),
        &["4194304 instructions"],
    );
}
