//! `policy import` and `policy inspect` from outside: files, documents, words and refusals.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, document, done, reachcast, refused};
use reachcast::files::{npy_bytes, read_npz};
use reachcast::policy::Mlp;
use reachcast::policy::import::{Request, read};
use safetensors::SafeTensors;

const TIANSHOU: &str = "tests/fixtures/checkpoints/tianshou.pth";
const GRAPH: &str = "tests/fixtures/checkpoints/silu.onnx";
const POLICY: &str = "configs/policies/race_policy.safetensors";
const RACE: &str = "configs/race.toml";

#[test]
fn an_imported_actor_flies() {
    let folder = Folder::new();
    let out = folder.path("new/policy.safetensors");
    let import = ["policy", "import", TIANSHOU, "--network", "actor1_old", "--config", RACE];
    let import = [&import[..], &["--out", &out]].concat();
    let report = document(&import);
    assert_eq!(report["widths"], serde_json::json!([12, 8, 8, 8, 8, 3]));
    assert_eq!(report["layers"][4], "actor1_old.last.model.0");
    assert_eq!((&report["activation"], &report["output"]), (&"relu".into(), &"tanh".into()));
    assert_eq!(report["activation_from"], "default");
    assert_eq!(report["state_order"][11], "opp_vz");
    // The same file from the same checkpoint, and another library reads it.
    let bytes = std::fs::read(&out).unwrap();
    done(&import);
    assert_eq!(std::fs::read(&out).unwrap(), bytes);
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    assert_eq!(tensors.tensor("layers.4.weight").unwrap().shape(), [3, 8]);
    let network = Mlp::from_bytes(&bytes).unwrap();
    let request = Request { networks: vec!["actor1_old".to_owned()], ..Request::default() };
    let direct = read(TIANSHOU.as_ref(), &request).unwrap().network;
    assert_eq!(network.layers(), direct.layers());
    assert_eq!(report["digest"], direct.digest());
    // As the policy of a configuration.
    let set = format!("policy.file={out}");
    let measures = folder.path("measures.npy");
    let starts = "configs/race_starts_500.csv";
    let rollout = ["rollout", RACE, "--starts", starts, "--measures", &measures, "--set", &set];
    assert_eq!(document(&[&rollout[..], &["--backend", "cpu"]].concat())["starts"], 500);
}

#[test]
fn words_say_what_the_file_does_not() {
    let folder = Folder::new();
    let out = folder.path("critic.safetensors");
    let words = done(&["policy", "import", TIANSHOU, "--network", "critic", "--out", &out]);
    for word in ["18-8-8-8-8-1", "relu (the default", "--activation does", "identity", "not named"]
        .into_iter()
        // What stands beside it in the file is told.
        .chain([
            "left out    ",
            "actor1.last.model.0 (2 tensors)",
            "critic_old.preprocess.model.model (8 tensors)",
            "no part of the policy",
        ])
    {
        assert!(words.contains(word), "no `{word}` in: {words}");
    }
    let words = done(&["policy", "import", GRAPH, "--out", &out, "--overwrite"]);
    assert!(words.contains("silu (as the file has it)"), "{words}");
    assert_eq!(done(&["policy", "import", GRAPH, "--out", &out, "-q"]), "");
    let names = "a,b,c,d,e,f,g,h,i,j,k,l";
    done(&["policy", "import", GRAPH, "--out", &out, "--state-order", names, "--overwrite"]);
    let order = document(&["policy", "inspect", &out])["state_order"].clone();
    assert_eq!(order.as_array().unwrap().len(), 12);
    assert_eq!(folder.entries(), ["critic.safetensors"]);
}

#[test]
fn imports_that_are_refused_write_nothing() {
    let folder = Folder::new();
    let out = folder.path("policy.safetensors");
    let import = |file: &str, more: &[&str], words: &[&str]| {
        refused(&[&["policy", "import", file], more].concat(), words);
        assert!(folder.entries().is_empty());
    };
    import("nowhere.pth", &["--out", &out], &["nowhere.pth", "No such file"]);
    import(TIANSHOU, &[], &["--out", "missing"]);
    import(TIANSHOU, &["--out", &folder.path("policy.pth")], &["--out", ".safetensors"]);
    import(TIANSHOU, &["--out", &out], &["tianshou.pth", "6 networks", "actor1_old"]);
    import(GRAPH, &["--out", &out, "--activation", "relu"], &["--activation", "silu"]);
    import(GRAPH, &["--out", &out, "--activation", "gelu"], &["gelu", "silu"]);
    import(GRAPH, &["--out", &out, "--activation", "wave"], &["wave", "leaky_relu", "softsign"]);
    import(GRAPH, &["--out", &out, "--output", "elu(x)"], &["elu(x)"]);
    import(GRAPH, &["--out", &out, "--state-order", "x,y"], &["--state-order", "12 names"]);
    let twice = "a,b,c,d,e,f,g,h,i,j,k,a";
    import(GRAPH, &["--out", &out, "--state-order", twice], &["--state-order", "all different"]);
    let critic = ["--network", "critic", "--config", RACE, "--out", &out];
    import(TIANSHOU, &critic, &["18 inputs to 1 outputs", "12 states and 3 controls"]);
    let both = ["--out", &out, "--state-order", "x", "--config", RACE];
    import(GRAPH, &both, &["cannot be used with"]);
    let (code, _, message) =
        reachcast(&["policy", "import", GRAPH, "--out", "/proc/none/policy.safetensors"]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("cannot write"), "{message}");
}

#[test]
fn a_policy_is_inspected() {
    let report = document(&["policy", "inspect", POLICY, "--config", RACE]);
    let network = Mlp::load(POLICY.as_ref()).unwrap();
    assert_eq!(report["digest"], network.digest());
    assert_eq!(report["parameter_count"], network.parameter_count());
    assert_eq!(report["widths"], serde_json::json!(network.widths()));
    assert_eq!(report["layers"].as_array().unwrap().len(), network.layers().len());
    assert_eq!(report["low"].as_array().unwrap().len(), 12);
    assert!(report["lipschitz_bound"].as_f64().unwrap() > 1.0);
    for action in report["actions"].as_array().unwrap() {
        let range = |key: &str| [0, 1].map(|end| action[key][end].as_f64().unwrap());
        let ([low, high], [least, most]) = (range("interval"), range("seen"));
        assert!(low <= least && least < most && most <= high, "{action}");
    }
    // Without a configuration the box is another, and the actions have numbers.
    let plain = document(&["policy", "inspect", POLICY]);
    assert_eq!((&plain["low"][1], &plain["actions"][2]["name"]), (&(-1.0).into(), &"2".into()));
    assert_eq!(plain["layers"], report["layers"]);
    let other = document(&["policy", "inspect", POLICY, "--seed", "2"]);
    assert_ne!(other["actions"][0]["seen"], plain["actions"][0]["seen"]);
    let words = done(&["policy", "inspect", POLICY, "--config", RACE]);
    for word in ["activation  relu", "spectral norm at most", "Lipschitz", "within", "seen"] {
        assert!(words.contains(word), "no `{word}` in: {words}");
    }
    refused(&["policy", "inspect", TIANSHOU], &["tianshou.pth", "policy import"]);
    refused(&["policy", "inspect", "nowhere.safetensors"], &["No such file"]);
    let value = "configs/policies/race_value.safetensors";
    refused(&["policy", "inspect", value, "--config", RACE], &["maps 12 inputs to 1 outputs"]);
    refused(&["policy"], &["import", "inspect"]);
}

#[test]
fn a_policy_is_evaluated_as_its_reference() {
    let folder = Folder::new();
    let (inputs, outputs) = (folder.path("x.npy"), folder.path("u.npy"));
    let network = Mlp::load(POLICY.as_ref()).unwrap();
    let (takes, gives) = (network.widths()[0], *network.widths().last().unwrap());
    let numbers: Vec<f32> = (0..7 * takes).map(|i| (i as f32 * 0.37).sin()).collect();
    std::fs::write(&inputs, npy_bytes(&numbers, [7, takes])).unwrap();
    let eval = ["policy", "eval", POLICY, "--inputs", &inputs, "--outputs", &outputs];
    let report = document(&eval);
    assert_eq!((&report["count"], &report["not_finite"]), (&7.into(), &0.into()));
    let expected: Vec<f32> = numbers.chunks(takes).flat_map(|x| network.forward(x)).collect();
    let read = |path: &str| {
        let bytes = std::fs::read(path).unwrap();
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        (file.shape().to_vec(), file.into_vec::<f32>().unwrap())
    };
    assert_eq!(read(&outputs), (vec![7, gives as u64], expected.clone()));
    // One state of f64.
    let mut one =
        b"\x93NUMPY\x01\0\x76\0{'descr': '<f8', 'fortran_order': False, 'shape': (12,), }".to_vec();
    one.resize(127, b' ');
    one.push(b'\n');
    one.extend(numbers[..takes].iter().flat_map(|&x| f64::from(x).to_le_bytes()));
    std::fs::write(&inputs, &one).unwrap();
    let words = done(&[&eval[..], &["--overwrite"]].concat());
    assert!(words.contains("1 outputs"), "{words}");
    assert_eq!(read(&outputs), (vec![gives as u64], expected[..gives].to_vec()));
    std::fs::write(&inputs, npy_bytes(&[f32::NAN; 24], [2, 12])).unwrap();
    let words = done(&[&eval[..], &["--overwrite"]].concat());
    assert!(words.contains("2 of them have a number that is not finite"), "{words}");
    std::fs::write(&inputs, npy_bytes(&[0.0; 22], [2, 11])).unwrap();
    refused(&eval, &["x.npy", "[2, 11]", "[N, 12]"]);
    std::fs::write(&inputs, &one[..200]).unwrap();
    refused(&eval, &["x.npy"]);
    refused(&["policy", "eval", POLICY, "--inputs", &inputs, "--outputs", &inputs], &["x.npy"]);
    let text = folder.path("u.txt");
    refused(
        &["policy", "eval", POLICY, "--inputs", &inputs, "--outputs", &text],
        &["--outputs", ".npy"],
    );
}

#[test]
fn a_policy_is_exported_and_comes_back() {
    let folder = Folder::new();
    let (graph, back) = (folder.path("p.onnx"), folder.path("p.safetensors"));
    let report = document(&["policy", "export", POLICY, "--to", "onnx", "--out", &graph]);
    let found = document(&["policy", "import", &graph, "--out", &back]);
    assert_eq!(found["digest"], report["digest"]);
    assert_eq!(std::fs::read(&back).unwrap(), std::fs::read(POLICY).unwrap());
    let arrays = folder.path("p.npz");
    done(&["policy", "export", POLICY, "--to", "npz", "--out", &arrays]);
    let arrays = read_npz(arrays.as_ref()).unwrap();
    let network = Mlp::load(POLICY.as_ref()).unwrap();
    for (i, layer) in network.layers().iter().enumerate() {
        let array = &arrays[&format!("layers.{i}.weight")];
        assert_eq!(array.shape, [layer.outputs, layer.inputs]);
        assert_eq!(array.data.as_f32().unwrap(), layer.weight);
        assert_eq!(arrays[&format!("layers.{i}.bias")].data.as_f32().unwrap(), layer.bias);
    }
    let metadata: serde_json::Value =
        serde_json::from_slice(arrays["metadata"].data.as_u8().unwrap()).unwrap();
    assert_eq!(metadata["activation"], "relu");
    assert_eq!(arrays.len(), 2 * network.layers().len() + 1);
    refused(&["policy", "export", POLICY, "--to", "npz", "--out", &graph], &["--out", ".npz"]);
    refused(&["policy", "export", POLICY, "--to", "onnx"], &["--out", "missing"]);
    std::fs::write(&graph, "mine").unwrap();
    let again = ["policy", "export", POLICY, "--to", "onnx", "--out", &graph];
    refused(&again, &["p.onnx", "--overwrite"]);
}
