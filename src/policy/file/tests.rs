//! Files of networks: what is written is read, and what is no part of a network is refused by name.

use super::*;
use crate::digest;

/// Layers with everything that a file can say of them.
fn whole() -> Mlp {
    let norm = Norm { scale: vec![1.5, -0.5], shift: vec![0.1, 0.2], epsilon: 1e-5 };
    let first = Layer::dense(vec![0.1, 0.2, 0.3, -0.4, 0.5, 0.6], vec![0.1, -0.2]);
    let first = Layer { norm: Some(norm), ..first.activated(Activation::Elu { alpha: 0.5 }) };
    let second = Layer::dense(vec![0.7, -0.8], vec![0.0]).activated(Activation::Gelu);
    let last = Layer::dense(vec![2.0, 3.0], vec![0.5, 0.25])
        .activated(Activation::Hardtanh { low: -2.0, high: 2.0 });
    let input = Rescale::affine(vec![0.5, 1.0, 2.0], vec![0.0, 0.1, -0.2]);
    let output =
        Rescale { high: vec![f32::INFINITY, 0.25], ..Rescale::affine(vec![2.0; 2], vec![0.1; 2]) };
    Mlp::from_layers(vec![first, second, last])
        .and_then(|mlp| mlp.with_input(input))
        .and_then(|mlp| mlp.with_output(output))
        .and_then(|mlp| mlp.with_state_order(["a", "b", "c"].map(str::to_owned).to_vec()))
        .expect("a network")
}

/// The file of `mlp` with its header as `edit` leaves it.
fn edited(
    mlp: &Mlp,
    edit: impl FnOnce(&mut Map<String, Value>),
) -> std::result::Result<Mlp, String> {
    let bytes = mlp.to_bytes();
    let (length, rest) = bytes.split_at(8);
    let length = u64::from_le_bytes(length.try_into().expect("8 bytes")) as usize;
    let mut header: Map<String, Value> = serde_json::from_slice(&rest[..length]).expect("a header");
    edit(&mut header);
    let header = Value::Object(header).to_string().into_bytes();
    Mlp::from_bytes(
        &[&(header.len() as u64).to_le_bytes(), header.as_slice(), &rest[length..]].concat(),
    )
}

fn refused(mlp: &Mlp, edit: impl FnOnce(&mut Map<String, Value>), words: &[&str]) {
    let problem = edited(mlp, edit).expect_err("refused");
    words.iter().for_each(|word| assert!(problem.contains(word), "no `{word}` in: {problem}"));
}

/// Gives the tensor or entry `from` another name.
fn rename<'a>(from: &'a str, to: &'a str) -> impl FnOnce(&mut Map<String, Value>) + 'a {
    move |header| {
        let tensor = header.remove(from).expect("a tensor of that name");
        header.insert(to.to_owned(), tensor);
    }
}

/// Says `value` in the entry `key` of the metadata, or nothing.
fn say<'a>(key: &'a str, value: Option<&'a str>) -> impl FnOnce(&mut Map<String, Value>) + 'a {
    move |header| {
        let entries = header["__metadata__"].as_object_mut().expect("metadata");
        match value {
            Some(value) => _ = entries.insert(key.to_owned(), value.into()),
            None => _ = entries.remove(key).expect("an entry of that name"),
        }
    }
}

#[test]
fn what_is_written_is_read() {
    let mlp = whole();
    let read = Mlp::from_bytes(&mlp.to_bytes()).expect("a network");
    assert_eq!(read, mlp);
    assert_eq!((read.digest(), read.to_bytes()), (mlp.digest(), mlp.to_bytes()));
    assert_eq!(edited(&mlp, |_| ()), Ok(mlp));
    let layers = vec![Layer::dense(vec![1.0], vec![0.0])];
    for hidden in [Activation::Tanh, Activation::Mish] {
        let single = Mlp::new(layers.clone(), hidden, Activation::Identity).expect("a network");
        assert_eq!(Mlp::from_bytes(&single.to_bytes()), Ok(single), "a word without a layer");
    }
}

/// Networks that could be said before there were other activations, norms and maps.
#[test]
fn old_networks_have_their_digests_and_bytes() {
    let layers =
        || vec![Layer::dense(vec![0.5, -1.0], vec![0.25]), Layer::dense(vec![2.0], vec![1.0])];
    let mlp = Mlp::new(layers(), Activation::Silu, Activation::Tanh).expect("a network");
    assert_eq!(mlp.digest(), "50990e1cf2256fa2378d45fed7d9f7682635c27d9626211e7f60612924d716eb");
    assert_eq!(
        digest::sha256([mlp.to_bytes().as_slice()]),
        "3c4a2c9f474eccbf68f13477b05a4e53969360cfabc6018600d62657e86b5c5f"
    );
    let single = Mlp::new(layers()[1..].to_vec(), Activation::Tanh, Activation::Identity)
        .expect("a network");
    assert_eq!(single.digest(), "3b7456aa1325bef179ed4c035a9060eb3696f0fa502d59ba9e068f8b273dbf50");
}

/// Nothing that makes another network of it leaves its digest as it is.
#[test]
fn digests_tell_networks_apart() {
    let mlp = whole();
    let layers = || mlp.layers().to_vec();
    let rebuilt = |layers| Mlp::from_layers(layers).expect("a network");
    let mut seen = vec![mlp.digest(), rebuilt(layers()).digest()];
    let mut tell = |mlp: Mlp| {
        assert!(!seen.contains(&mlp.digest()), "{mlp:?}");
        seen.push(mlp.digest());
    };
    let edit = |change: fn(&mut Vec<Layer>)| {
        let mut layers = layers();
        change(&mut layers);
        rebuilt(layers)
    };
    tell(edit(|layers| layers[0].norm = None));
    tell(edit(|layers| layers[0].norm.as_mut().expect("a norm").epsilon = 1e-6));
    tell(edit(|layers| layers[0].norm.as_mut().expect("a norm").scale[1] = 0.5));
    tell(edit(|layers| layers[1].activation = Activation::GeluTanh));
    tell(edit(|layers| layers[0].activation = Activation::Elu { alpha: 0.25 }));
    let map = || mlp.output_map().expect("a map").clone();
    let with = |map: Rescale| rebuilt(layers()).with_output(map).expect("a map");
    tell(with(map()));
    tell(with(Rescale { low: vec![-5.0; 2], ..map() }));
    tell(with(Rescale { shift: vec![0.2; 2], ..map() }));
}

#[test]
fn gaps_and_unknown_parts_are_refused_by_name() {
    let mlp = whole();
    refused(&mlp, rename("layers.1.weight", "layers.7.weight"), &["layers.1.weight", "gap"]);
    refused(
        &mlp,
        rename("layers.2.bias", "layers.2.offset"),
        &["tensor `layers.2.offset`", "no part"],
    );
    refused(&mlp, rename("layers.2.bias", "layers.02.bias"), &["tensor `layers.02.bias`"]);
    refused(&mlp, rename("input.scale", "input.mean"), &["tensor `input.mean`"]);
    refused(&mlp, rename("input.scale", "log_std"), &["tensor `log_std`"]);
    refused(&mlp, say("squash", Some("tanh")), &["metadata `squash`", "used without it"]);
    refused(&mlp, say("layers.3.norm.epsilon", Some("1")), &["`layers.3.norm.epsilon`"]);
    edited(&mlp, say("format", Some("pt"))).expect("who wrote it is no matter");
}

#[test]
fn halves_of_norms_maps_and_lists_are_refused() {
    let mlp = whole();
    refused(&mlp, |header| _ = header.remove("layers.0.norm.bias"), &["safetensors"]);
    refused(&mlp, rename("layers.0.norm.bias", "layers.1.norm.bias"), &["layers.0.norm.bias"]);
    refused(&mlp, say("layers.0.norm.epsilon", None), &["no `layers.0.norm.epsilon`"]);
    refused(&mlp, say("layers.0.norm.epsilon", Some("0")), &["norm.epsilon is 0", "not above 0"]);
    refused(&mlp, say("layers.0.norm.epsilon", Some("tiny")), &["`tiny` is no number"]);
    refused(&mlp, say("layers.1.norm.epsilon", Some("1")), &["no tensor `layers.1.norm.weight`"]);
    refused(&mlp, say("activations", Some("relu tanh")), &["are 2", "3 layers"]);
    refused(&mlp, say("activations", Some("relu tanh swish")), &["`swish` is none of identity"]);
    refused(&mlp, say("activations", None), &["no `activation`", "softsign"]);
    refused(&mlp, say("output", Some("tanh")), &["both `activations` and `output`"]);
    refused(&mlp, say("state_order", Some("a,b")), &["state_order", "expected 3 names"]);
    for hidden in ["a,b,c\u{1b}[2J", "a,b,c\n.", "a,b,c\u{202e}", "a,\u{200b}b,c"] {
        refused(&mlp, say("state_order", Some(hidden)), &["state_order", "control a terminal"]);
    }
    let swap = |header: &mut Map<String, Value>| {
        let [low, high] = ["low", "high"].map(|kind| header[&format!("output.{kind}")].clone());
        header.insert("output.low".to_owned(), high);
        header.insert("output.high".to_owned(), low);
    };
    refused(&mlp, swap, &["output.low[0] is inf", "not below"]);
}

#[test]
fn maps_and_norms_of_other_sizes_are_refused() {
    let mlp = whole();
    let problem = |map: Rescale| mlp.clone().with_input(map).expect_err("refused").to_string();
    let map = || Rescale::affine(vec![1.0; 3], vec![0.0; 3]);
    assert!(
        problem(Rescale::affine(vec![1.0; 2], vec![0.0; 2])).contains("input.scale has 2 entries")
    );
    assert!(
        problem(Rescale { shift: vec![0.0, f32::NAN, 0.0], ..map() })
            .contains("input.shift[1] is NaN")
    );
    assert!(problem(Rescale { low: vec![f32::NAN; 3], ..map() }).contains("input.low[0] is NaN"));
    let mut layers = mlp.layers().to_vec();
    layers[0].norm.as_mut().expect("a norm").scale.pop();
    let problem = Mlp::from_layers(layers).expect_err("refused").to_string();
    assert!(problem.contains("layers.0.norm.weight has 1 entries"), "{problem}");
}

#[test]
fn an_entry_that_is_there_twice_is_refused() {
    let bytes = whole().to_bytes();
    let (length, rest) = bytes.split_at(LENGTH);
    let length = u64::from_le_bytes(length.try_into().expect("8 bytes")) as usize;
    let header = std::str::from_utf8(&rest[..length]).expect("a text");
    let twice = |old: &str, new: &str| {
        let header = header.replacen(old, new, 1);
        let parts = [&(header.len() as u64).to_le_bytes(), header.as_bytes(), &rest[length..]];
        Mlp::from_bytes(&parts.concat()).expect_err("refused")
    };
    let key = "\"state_order\":";
    let problem = twice(key, &format!("{key}\"c,b,a\",{key}"));
    assert!(problem.contains("`state_order` is there twice"), "{problem}");
    let metadata = "\"__metadata__\":";
    let problem = twice(metadata, &format!("{metadata}{{\"output\":\"tanh\"}},{metadata}"));
    assert!(problem.contains("duplicate field `__metadata__`"), "{problem}");
}
