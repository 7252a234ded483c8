//! Compiled modules of PyTorch are what their code applies, and are refused where it does more.

use std::io::{Cursor, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use reachcast::policy::Activation;
use reachcast::policy::import::{Imported, Origin, Request, from_bytes};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use crate::checkpoint::{bytes, stated};

const LINEAR: &str = "class Linear(Module):\n  weight : Tensor\n  bias : Tensor\n  def forward(self: Q,\n    input: Tensor) -> Tensor:\n    weight = self.weight\n    bias = self.bias\n    return torch.linear(input, weight, bias)\n";
const RELU: &str = "def relu(input: Tensor,\n    inplace: bool=False) -> Tensor:\n  if inplace:\n    result = torch.relu_(input)\n  else:\n    result = torch.relu(input)\n  return result\n";
/// Where they lie.
const LINEAR_FILE: &str = "code/__torch__/torch/nn/modules/linear.py";
const OWN_FILE: &str = "code/__torch__.py";
const FUNCTIONS_FILE: &str = "code/__torch__/torch/nn/functional.py";

/// The three layers `0`, `2`, `4` of a checkpoint as a compiled module with these files of code.
fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut old = ZipArchive::new(Cursor::new(bytes("sequential.pth"))).unwrap();
    let mut new = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut folder = String::new();
    let mut add = |name: &str, content: &[u8]| {
        new.start_file(name, options).unwrap();
        new.write_all(content).unwrap();
    };
    for index in 0..old.len() {
        let mut entry = old.by_index(index).unwrap();
        let name = entry.name().unwrap().into_owned();
        folder = name.split_once('/').unwrap().0.to_owned();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        add(&name, &content);
    }
    add(&format!("{folder}/constants.pkl"), b"\x80\x02).");
    files.iter().for_each(|(name, content)| add(&format!("{folder}/{name}"), content));
    new.finish().unwrap().into_inner()
}

/// The text of a class with the layers as its parts, and this function.
fn class(function: &str) -> String {
    let part =
        |key| format!("  __annotations__[\"{key}\"] = __torch__.torch.nn.modules.linear.Linear\n");
    let parts: String = ["0", "2", "4"].map(part).concat();
    format!("class P(Module):\n  __parameters__ = []\n{parts}{function}")
}

/// A `forward` that gives the last layer of an expression of its argument `x`.
fn forward(lines: &str) -> String {
    class(&format!(
        "  def forward(self: __torch__.P,\n    x: Tensor) -> Tensor:\n    _0 = getattr(self, \"0\")\n    \
         _2 = getattr(self, \"2\")\n    _4 = getattr(self, \"4\")\n{lines}"
    ))
}

/// The module of this class.
fn compiled(class: &str) -> Vec<u8> {
    archive(&[
        (OWN_FILE, class.as_bytes()),
        (LINEAR_FILE, LINEAR.as_bytes()),
        (FUNCTIONS_FILE, RELU.as_bytes()),
    ])
}

fn read(content: &[u8], request: &Request) -> reachcast::Result<Imported> {
    from_bytes(Path::new("x.pt"), content, request)
}

/// Expects a refusal with these words unless both activations are stated, and a note then.
fn does_more(content: &[u8], words: &str) {
    let half = Request { activation: Some(Activation::Relu), ..Request::default() };
    for request in [half, Request::default()] {
        let error = read(content, &request).expect_err(words).to_string();
        assert!(error.contains("does more than its layers") && error.contains(words), "{error}");
        assert!(error.contains("ONNX") && error.contains("--activation and --output"), "{error}");
        assert!(error.len() < 1200, "{} bytes", error.len());
    }
    let found = read(content, &stated()).unwrap();
    assert!(found.notes[0].starts_with("not in it: the code"), "{:?}", found.notes);
}

const PLAIN: &str = "    _5 = torch.relu((_0).forward(x, ))\n    _6 = torch.silu((_2).forward(_5, ))\n    return (_4).forward(_6, )\n";

#[test]
fn activations_are_those_of_the_code() {
    let content = compiled(&forward(PLAIN));
    let found = read(&content, &Request::default()).unwrap();
    let network = &found.network;
    let each: Vec<String> = (0..3).map(|i| network.layers()[i].activation.name()).collect();
    assert_eq!(each, ["relu", "silu", "identity"]);
    assert_eq!([found.activation_from, found.output_from], [Origin::File; 2]);
    assert!(found.notes[0].contains("relu, silu, identity"), "{:?}", found.notes);
    // What is stated is compared with it.
    for (activation, output, flag) in [
        (Some(Activation::Relu), None, "--activation is not"),
        (None, Some(Activation::Tanh), "--output is not"),
    ] {
        let request = Request { activation, output, ..Request::default() };
        let error = read(&content, &request).unwrap_err().to_string();
        assert!(error.contains(flag) && error.contains("relu, silu, identity"), "{error}");
    }
    let output = Some(Activation::Identity);
    assert!(read(&content, &Request { output, ..Request::default() }).is_ok());
    let found = read(&content, &stated()).unwrap();
    assert!(found.notes[0].starts_with("as stated, while the code"), "{:?}", found.notes);
    // A function of PyTorch, settings, an activation that stands alone, and none.
    let lines = "    _5 = __torch__.torch.nn.functional.relu((_0).forward(x, ), False, )\n    \
                 a = torch.leaky_relu_((_2).forward(_5, ), 0.5)\n    b = (_4).forward(a, )\n    \
                 return torch.hardtanh(b, -2., 2.)\n";
    let found = read(&compiled(&forward(lines)), &Request::default()).unwrap();
    assert!(found.notes[0].contains("relu, leaky_relu(0.5), hardtanh(-2,2)"), "{:?}", found.notes);
    let found = from_bytes(Path::new("x.pt"), &bytes("script.pt"), &Request::default()).unwrap();
    assert!(found.notes[0].contains("relu, relu, tanh"), "{:?}", found.notes);
}

#[test]
fn functions_that_do_more_are_refused() {
    for (lines, words) in [
        // A factor, a residual, a branch, parts in another order, one that is applied twice, and one that is not.
        (
            "    _5 = torch.mul((_0).forward(x, ), 2.)\n    return (_4).forward((_2).forward(_5, ), )\n",
            "torch.mul",
        ),
        (
            "    a = (_0).forward(x, )\n    b = torch.add(a, (_2).forward(a, ))\n    return (_4).forward(b, )\n",
            "torch.add",
        ),
        (
            "    a = (_0).forward(x, )\n    b = (_2).forward(a, )\n    return (_4).forward(a, )\n",
            "(_4).forward(a, )",
        ),
        (
            "    return (_4).forward((_0).forward((_2).forward(x, ), ), )\n",
            "it applies 2, then 0, then 4",
        ),
        (
            "    a = (_2).forward((_0).forward((_0).forward(x, ), ), )\n    return (_4).forward(a, )\n",
            "it applies 0, then 0, then 2, then 4",
        ),
        ("    return (_4).forward((_0).forward(x, ), )\n", "`2` is not applied"),
        ("    return ((_4).forward((_2).forward((_0).forward(x, ), ), ), x)\n", "return ("),
        ("    if torch.gt(x, 0):\n      return x\n", "if torch.gt"),
        // An activation before the first layer, and two behind one.
        (
            "    a = (_2).forward((_0).forward(torch.tanh(x), ), )\n    return (_4).forward(a, )\n",
            "tanh stands before its first layer",
        ),
        (
            "    a = (_2).forward((_0).forward(x, ), )\n    return (_4).forward(torch.tanh(torch.relu(a)), )\n",
            "relu, then tanh behind `2`",
        ),
    ] {
        does_more(&compiled(&forward(lines)), words);
    }
    // Expressions that are deep or long are not followed to their end, nor shown.
    let deep =
        |count| format!("    return {}x{}\n", "torch.tanh(".repeat(count), ")".repeat(count));
    does_more(&compiled(&forward(&deep(1000))), "nested more than 64 deep");
    does_more(&compiled(&forward(&deep(300_000))), "too long to be followed");
}

#[test]
fn classes_that_are_not_the_usual_ones_are_refused() {
    let own = forward(PLAIN);
    let with = |own: &str, linear: &str, functions: &str| {
        archive(&[
            (OWN_FILE, own.as_bytes()),
            (LINEAR_FILE, linear.as_bytes()),
            (FUNCTIONS_FILE, functions.as_bytes()),
        ])
    };
    // A layer of PyTorch whose function was changed, or that has a hook; another function, spelling or name of it.
    let changed = LINEAR.replace("torch.linear(input, weight, bias)", "torch.neg(input)");
    does_more(&with(&own, &changed, RELU), "torch.neg");
    let bare = LINEAR.replace("weight, bias)", "weight)");
    does_more(&with(&own, &bare, RELU), "with other biases");
    let hooked = LINEAR.replace("  weight", "  __forward_hooks__ = [\"hook\", ]\n  weight");
    does_more(&with(&own, &hooked, RELU), "__forward_hooks__");
    does_more(&compiled(&own.replace("def forward(", "def act(")), "has no function `forward`");
    does_more(&compiled(&own.replace("def forward(", "def  forward(")), "`def  forward(self");
    does_more(&compiled(&format!("{own}{own}")), "is there twice");
    let functional = own.replace("torch.relu(", "__torch__.torch.nn.functional.relu(");
    assert!(read(&compiled(&functional), &Request::default()).is_ok());
    let other = RELU.replace("torch.relu(input)", "torch.neg(input)");
    does_more(&with(&functional, LINEAR, &other), "functional.relu");
    // A class that is no part of the module, code in another encoding, and none.
    let wide: Vec<u8> = own.encode_utf16().flat_map(u16::to_le_bytes).collect();
    does_more(&archive(&[(OWN_FILE, &[&[0xff, 0xfe], wide.as_slice()].concat())]), "UTF-8");
    let stray =
        "class X(Module):\n  def forward(self: X,\n    x: Tensor) -> Tensor:\n    return x\n";
    does_more(&compiled(&format!("{own}{stray}")), "no part of each other");
    does_more(&archive(&[]), "no code");
    does_more(&archive(&[(OWN_FILE, b"")]), "no code");
}

#[test]
fn what_is_left_out_at_random_is_refused() {
    let named = |name: &str, train: &str, words: &[&str]| {
        let content = bytes(name);
        let error = read(&content, &Request::default()).map(|found| found.notes);
        match words {
            [] => assert!(error.unwrap().join(" ").contains("identity, identity"), "{train}"),
            _ => {
                let error = error.unwrap_err().to_string();
                words.iter().for_each(|word| assert!(error.contains(word), "{train}: {error}"));
            }
        }
    };
    // Compiled by PyTorch with a Dropout and an Identity between two layers, before and after `eval()`.
    let random = ["numbers are left out at random", "`1.training` is true", "module.eval()"];
    named("dropout_train.pt", "compiled in training", &random);
    named("dropout_eval.pt", "compiled for use", &[]);
    named("identity_traced.pt", "traced", &[]);
    // A flag of another name decides as `training` does.
    let lines = "    training = self.always\n    a = torch.dropout((_0).forward(x, ), 0.5, training)\n    \
                 return (_4).forward((_2).forward(a, ), )\n";
    let own = forward(lines)
        .replace("  __parameters__ = []\n", "  __parameters__ = []\n  always : bool\n");
    does_more(&compiled(&own), "torch.dropout");
}

#[test]
fn many_files_of_code_are_not_read() {
    let names: Vec<String> = (0..30_000).map(|i| format!("code/__torch__/m{i}.py")).collect();
    let files: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b"a"[..])).collect();
    let content = archive(&files);
    let start = Instant::now();
    does_more(&content, "30000 files of code");
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}
