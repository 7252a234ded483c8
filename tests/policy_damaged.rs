//! What the importer of policies meets in damaged and hostile files: refusals, and nothing else.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod checkpoint;
mod damaged;

use std::path::Path;

use checkpoint::{bytes, import, pickle, refused_bytes, replaced, rewritten, stated, with_pickle};
use rand::SeedableRng;
use rand::rngs::StdRng;
use reachcast::policy::Mlp;
use reachcast::policy::import::Request;

/// The checkpoint that is damaged: three layers, 12-8-8-3.
const GOOD: &str = "sequential.pth";
/// Names of the file that is imported.
const PTH: &str = "damaged.pth";
const ONNX: &str = "damaged.onnx";

/// The network of these bytes, or the refusal, which has to be one of wrong input.
fn outcome(name: &str, content: &[u8]) -> Result<Mlp, String> {
    let request = if name == PTH { stated() } else { Request::default() };
    let found = import(Path::new(name), content, &request);
    found.map(|found| found.network).map_err(|error| {
        assert_eq!(error.exit_code(), 2, "{error}");
        error.to_string()
    })
}

/// Imports the good checkpoint with this pickle, and expects `words` in the refusal.
fn refused_pickle(pickle: &[u8], words: &[&str]) {
    refused_bytes(PTH, &with_pickle(GOOD, pickle), &Request::default(), words);
}

/// The same with `old` in its pickle replaced by `new`.
fn changed(old: &[u8], new: &[u8], words: &[&str]) {
    refused_pickle(&replaced(&pickle(GOOD), old, new), words);
}

/// A pickle that ends after these instructions.
fn program(parts: &[&[u8]]) -> Vec<u8> {
    [b"\x80\x02", parts.concat().as_slice(), b"."].concat()
}

/// A text as a pickle has it.
fn text(text: &str) -> Vec<u8> {
    [b"X", (text.len() as u32).to_le_bytes().as_slice(), text.as_bytes()].concat()
}

#[test]
fn names_of_functions_are_refused_and_nothing_is_executed() {
    let folder = tempfile::tempdir().unwrap();
    let mark = folder.path().join("mark");
    let command = format!("touch {}", mark.display());
    let names = [
        ("posix", "system"),
        ("os", "system"),
        ("subprocess", "getoutput"),
        ("builtins", "eval"),
        ("torch", "load"),
        ("torch._utils", "_rebuild_tensor"),
        ("collections", "Counter"),
        ("", "OrderedDict"),
        ("torch.storage", "FloatStorage"),
    ];
    for (module, name) in names {
        let global = format!("c{module}\n{name}\n");
        // As the whole of the pickle, and where a tensor is expected.
        let call = [global.as_bytes(), b"(", &text(&command), b"tR"];
        let words = [&*format!("`{module}.{name}`"), "nothing was executed"];
        refused_pickle(&program(&call), &words);
        changed(b"ctorch._utils\n_rebuild_tensor_v2\n", global.as_bytes(), &words);
    }
    // The other ways to make or call an object: INST, OBJ, EXT1, NEWOBJ, STACK_GLOBAL.
    for code in [b'i', b'o', b'\x82'] {
        refused_pickle(&program(&[&text("os"), &text("system"), &[code]]), &["instruction 0x"]);
    }
    refused_pickle(&program(&[&text("os"), &text("system"), b"\x81"]), &["no tuple"]);
    let stacked = program(&[&text("os"), &text("system"), b"\x93"]);
    refused_pickle(&stacked, &["`os.system`", "runs programs", "nothing was executed"]);
    assert!(!mark.exists());
    // Known names with arguments that are not theirs.
    let dict = b"ccollections\nOrderedDict\n";
    refused_pickle(&program(&[dict, &text("x"), b"\x85R"]), &["OrderedDict with arguments"]);
    refused_pickle(&program(&[b"ctorch\nFloatStorage\n)R"]), &["`torch.FloatStorage`"]);
    refused_pickle(&program(&[&text("x"), b")R"]), &["no name"]);
}

/// The pickle of the good checkpoint with more in its dictionary.
fn with_item(key: &str, value: &[u8]) -> Vec<u8> {
    let mut pickle = pickle(GOOD);
    assert_eq!(pickle.pop(), Some(b'.'));
    [&pickle, text(key).as_slice(), value, b"s."].concat()
}

#[test]
fn plain_numbers_beside_a_network_are_not_dropped() {
    let number = [b"G".as_slice(), &2.0_f64.to_be_bytes()].concat();
    let list = [b"](".as_slice(), &number, &number, b"e"].concat();
    let words = ["may act on what the network is given or gives", "--network 0,2,4"];
    for (key, value) in
        [("action_scale", &number), ("obs_mean", &list), ("shift", &b"K\x03".to_vec())]
    {
        let name = format!("`{key}`");
        let pickle = with_item(key, value);
        refused_pickle(&pickle, &[&words[..], &[name.as_str()]].concat());
        let networks = ["0", "2", "4"].map(str::to_owned).to_vec();
        let named = Request { networks, ..Request::default() };
        let found = import(PTH.as_ref(), &with_pickle(GOOD, &pickle), &named).unwrap();
        assert_eq!(found.left_out, [key]);
    }
    let counted = with_pickle(GOOD, &with_item("epoch", b"K\x07"));
    let found = import(PTH.as_ref(), &counted, &stated()).unwrap();
    assert_eq!(found.left_out, ["epoch"]);
}

#[test]
fn tensors_with_another_sign_than_their_storage_are_refused() {
    let mut pickle = pickle(GOOD);
    // Behind the hooks, the last argument of a tensor so far.
    let end = pickle.windows(5).position(|w| w[..3] == *b")Rq" && w[4] == b't').unwrap() + 4;
    let mark = [b"}".as_slice(), &text("neg"), b"\x88s"].concat();
    pickle.splice(end..end, mark);
    refused_pickle(&pickle, &["marked `neg`", "resolve_neg()"]);
}

#[test]
fn names_that_read_files_are_refused_beside_a_network() {
    for name in ["io\nopen", "numpy\nload", "glob\nglob", "operator\nattrgetter", "torch\nload"] {
        let value = [b"c", name.as_bytes(), b"\n"].concat();
        let shown = format!("`{}`", name.replace('\n', "."));
        refused_pickle(&with_item("extra", &value), &[&shown, "nothing was executed"]);
    }
    refused_pickle(
        &replaced(&pickle(GOOD), b"ctorch\nFloatStorage", b"ctorch\nQInt8Storage"),
        &["`torch.QInt8Storage`", "x.float()"],
    );
}

#[test]
fn shapes_that_do_not_fit() {
    let fits = "does not fit the 96 numbers";
    changed(b"K\x08K\x0c\x86", b"K\x08K\x0d\x86", &["`0.weight`", "[8, 13]", fits]);
    changed(b"K\x0cK\x01\x86", b"K\x0dK\x01\x86", &["`0.weight`", "[13, 1]", fits]);
    changed(b"QK\x00K\x08K\x0c", b"QK\x01K\x08K\x0c", &["from element 1", fits]);
    let far = [b"Q\x8a\x08".as_slice(), &i64::MAX.to_le_bytes(), b"K\x08K\x0c"].concat();
    changed(b"QK\x00K\x08K\x0c", &far, &["from element 9223372036854775807", fits]);
    // An expanded tensor, which needs few numbers and would take much memory.
    let vast = [b"J".as_slice(), &i32::MAX.to_le_bytes()].concat();
    let shape = [b"K\x08", vast.as_slice(), b"\x86q\tK\x00K\x00\x86"].concat();
    changed(b"K\x08K\x0c\x86q\tK\x0cK\x01\x86", &shape, &["does not fit", "expanded"]);
    changed(b"K\x08K\x0c\x86", b"K\x08K\x00\x86", &["[8, 0]", fits]);
    changed(b"K\x08K\x0c\x86", b"J\xff\xff\xff\xffK\x0c\x86", &["no whole number"]);
    changed(b"QK\x00K\x08K\x0c", b"QJ\xff\xff\xff\xffK\x08K\x0c", &["offset"]);
    let many = [b"(".as_slice(), &b"K\x01".repeat(65), b"t"].concat();
    changed(b"K\x08K\x0c\x86", &many, &["65 dimensions"]);
    changed(b"K\x08\x85q\x11", b"K\x07\x85q\x11", &["`0.bias` has shape [7]", "8 rows"]);
    let turned = b"K\x04K\x10\x86q\x19K\x10K\x01\x86";
    changed(b"K\x08K\x08\x86q\x19K\x08K\x01\x86", turned, &["`2.bias` has shape [8]", "4 rows"]);
    changed(b"K\x08K\x08\x86q\x19", b"K\x08K\x07\x86q\x19", &["`2.weight` takes 7", "gives 8"]);
    changed(b"0.weight", b"0.heavys", &["`0.heavys` of shape [8, 12]"]);
    changed(b"2.weight", b"0.weight", &["two tensors are called `0.weight`"]);
    let swapped = replaced(&pickle(GOOD), b"0.weight", b"3.weight");
    refused_pickle(&replaced(&swapped, b"0.bias", b"3.bias"), &["`3.weight` takes 12", "gives 8"]);
}

#[test]
fn storages_that_are_not_there_or_not_whole() {
    let refused = |content: Vec<u8>, words: &[&str]| {
        refused_bytes(PTH, &content, &Request::default(), words);
    };
    let without = |entry: &str| rewritten(GOOD, |name, old| (name != entry).then_some(old));
    refused(without("data/0"), &["`0.weight`", "no entry `data/0`"]);
    refused(without("data.pkl"), &["no entry `data.pkl`"]);
    let with = |entry: &str, new: &[u8]| {
        rewritten(GOOD, |name, old| Some(if name == entry { new.to_vec() } else { old }))
    };
    refused(with("data/0", &[0; 95 * 4]), &["does not fit the 95 numbers"]);
    refused(with("data/0", &[]), &["does not fit the 0 numbers"]);
    refused(with("data/2", &[0xff; 256]), &["layers.1.weight[0] is NaN, not finite"]);
    refused(with("byteorder", b"big"), &["most significant byte first"]);
    // The key of a storage is no path.
    let folder = replaced(&pickle(GOOD), b"X\x01\x00\x00\x000", &text("../data.pkl"));
    refused_pickle(&folder, &["no entry `data/../data.pkl`"]);
}

#[test]
fn pickles_that_ask_for_too_much() {
    refused_pickle(b"", &["byte 0", "cut off"]);
    refused_pickle(b"\x80\x04\x95", &["cut off"]);
    refused_pickle(b"\x80\x06", &["protocol 6", "pickle_protocol"]);
    refused_pickle(&program(&[b"X\xff\xff\xff\xff"]), &["cut off"]);
    refused_pickle(&program(&[b"N"]), &["no dictionary"]);
    refused_pickle(&program(&[b"h\x07"]), &["never remembered"]);
    refused_pickle(&program(&[b"a"]), &["a value is needed"]);
    refused_pickle(&program(&[b"}(NNNu"]), &["a key without a value"]);
    refused_pickle(&program(&[b"](NNu"]), &["keys and values"]);
    refused_pickle(&program(&[b"}N(s"]), &["a value is needed"]);
    refused_pickle(&program(&[b"}(a"]), &["a value is needed"]);
    refused_pickle(&program(&[b"}"]), &["no dense layer among its 0 tensors"]);
    refused_pickle(&program(&[&b"N".repeat(70_000)]), &["65536 values"]);
    refused_pickle(&program(&[&b"(".repeat(70_000)]), &["65536 marks"]);
    refused_pickle(&vec![b'N'; (1 << 24) + 1], &["16777217 bytes"]);
    // Tuples in tuples, 60,000 deep; a dictionary in itself; 2^40 ways to a tensor.
    refused_pickle(&program(&[b")", &b"\x85".repeat(60_000)]), &["16 deep"]);
    refused_pickle(&program(&[b"}q\x00", &text("x"), b"h\x00s"]), &["16 deep"]);
    let layer = |i: u8| {
        let keys = (0..32).flat_map(|key| [b'K', key, b'h', i]).collect::<Vec<u8>>();
        [b"}q".as_slice(), &[i + 1], b"(", &keys, b"u"].concat()
    };
    let tower: Vec<u8> = (0..6).flat_map(layer).collect();
    refused_pickle(&program(&[b"}q\x00", &tower]), &["entries in its dictionaries"]);
    let key = text(&"x".repeat(300));
    refused_pickle(&program(&[b"}", &key, b"Ns"]), &["a key of 300 bytes"]);
    // A hundred layers that share the numbers of one.
    let good = pickle(GOOD);
    let tensor = good.windows(2).position(|pair| pair == b"q\x19").unwrap();
    let begin = good[..tensor].windows(4).rposition(|window| window == b"h\x03((").unwrap();
    let end = tensor + good[tensor..].iter().position(|&code| code == b'R').unwrap();
    let end = end + 1 + good[end + 1..].iter().position(|&code| code == b'R').unwrap() + 1;
    let head = good[..begin].iter().rposition(|&code| code == b'X').unwrap();
    let many = (10..110)
        .flat_map(|i| [text(&format!("{i}.weight")).as_slice(), &good[begin..end]].concat());
    let many: Vec<u8> = [&good[..head], &many.collect::<Vec<u8>>(), b"u."].concat();
    refused_pickle(&many, &["101 layers", "at most 64"]);
}

#[test]
fn truncated_files_are_refused() {
    let whole = bytes(GOOD);
    for length in 0..whole.len() {
        assert!(outcome(PTH, &whole[..length]).is_err(), "{length} of {}", whole.len());
    }
    let pickle = pickle(GOOD);
    for length in 0..pickle.len() {
        assert!(outcome(PTH, &with_pickle(GOOD, &pickle[..length])).is_err(), "{length}");
    }
    // A graph that ends early may be whole but for its version.
    let whole = bytes("relu.onnx");
    let expected = outcome(ONNX, &whole).unwrap();
    let mut found = 0;
    for length in 0..whole.len() {
        if let Ok(network) = outcome(ONNX, &whole[..length]) {
            assert_eq!(network, expected, "{length}");
            found += 1;
        }
    }
    assert!(found <= 8, "{found} truncated graphs were imported");
}

/// Every entry has a checksum, so a changed bit is refused or lies where nothing is read.
#[test]
fn changed_bits_of_a_checkpoint_are_refused_or_change_nothing() {
    let whole = bytes(GOOD);
    let expected = outcome(PTH, &whole).unwrap();
    let mut refused = 0;
    for bit in 0..8 * whole.len() {
        let mut changed = whole.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        match outcome(PTH, &changed) {
            Ok(network) => assert_eq!(network, expected, "bit {bit}"),
            Err(_) => refused += 1,
        }
    }
    // The weights and the pickle at the least.
    assert!(refused > 8 * (4 * 203 + pickle(GOOD).len()), "{refused}");
}

/// Bytes changed at random behind the checksums, where the readers themselves have to notice.
#[test]
fn changed_bytes_of_pickles_and_graphs_crash_nothing() {
    let mut draw = StdRng::seed_from_u64(1);
    let mut outcomes = [0, 0];
    let mut damage = |whole: &[u8]| checkpoint::damaged(whole, &mut draw);
    let whole = pickle("tianshou.pth");
    let request = Request { networks: vec!["critic_old".to_owned()], ..Request::default() };
    for _ in 0..2_000 {
        let content = with_pickle("tianshou.pth", &damage(&whole));
        outcomes[usize::from(import(Path::new(PTH), &content, &request).is_ok())] += 1;
    }
    for name in [GOOD, "training.pt"] {
        let whole = pickle(name);
        for _ in 0..6_000 {
            let content = with_pickle(name, &damage(&whole));
            outcomes[usize::from(outcome(PTH, &content).is_ok())] += 1;
        }
    }
    for name in ["relu.onnx", "silu.onnx", "products.onnx"] {
        let whole = bytes(name);
        for _ in 0..20_000 {
            outcomes[usize::from(outcome(ONNX, &damage(&whole)).is_ok())] += 1;
        }
    }
    let [refused, taken] = outcomes;
    println!("{refused} refused, {taken} imported");
    assert!(refused > 10_000 && taken > 1_000, "{refused} refused, {taken} imported");
}

#[test]
fn graphs_that_are_no_plain_network() {
    let good = bytes("products.onnx");
    let changed = |old: &[u8], new: &[u8], words: &[&str]| {
        refused_bytes(ONNX, &replaced(&good, old, new), &Request::default(), words);
    };
    changed(b"\x0a\x01f\x12\x01g", b"\x0a\x01f\x12\x01f", &["two operations give `f`"]);
    changed(b"\x0a\x01f\x12\x01g", b"\x0a\x01g\x12\x01g", &["`g` is given by nothing"]);
    changed(b"\x12\x01f", b"\x12\x01g", &["two operations give `g`"]);
    changed(b"\"\x04Relu", b"\"\x04Sign", &["operation `Sign`; what a dense network may have is"]);
    changed(b"\x08\x08\x08\x08\x10\x01", b"\x08\x04\x08\x10\x10\x01", &["8 numbers", "takes 4"]);
    changed(b"\x08\x08\x08\x03\x10\x01", b"\x08\x03\x08\x08\x10\x01", &["8 numbers", "takes 3"]);
    changed(b"\x08\x08\x08\x03\x10\x01", b"\x08\x08\x08\x04\x10\x01", &["24 numbers", "[8, 4]"]);
    changed(b"\x08\x08\x08\x03\x10\x01", b"\x08\x08\x08\x03\x10\x09", &["`4.weight`", "no floats"]);
    let vast = b"\x08\xff\xff\x7f\x10\x01";
    changed(b"\x08\x08\x08\x03\x10\x01", vast, &["24 numbers", "[2097151]"]);
    changed(b"\x08\x08\x08\x03\x10\x01", b"\x08\x08\x08\x00\x10\x01", &["24 numbers", "[8, 0]"]);
    changed(b"2.weightJ", b"2.heavysJ", &["`2.weight` is given by nothing"]);
}
