//! The layouts that no fixture has: names in a safetensors file are recognised as those in a checkpoint are.

use std::collections::BTreeMap;

use reachcast::policy::import::{Origin, Request, from_bytes};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, serialize};

use crate::checkpoint::stated;

/// Layers by their names, from 4 numbers to 2, each with so many outputs.
pub(super) type Layers<'a> = &'a [(&'a str, [usize; 2])];

/// A safetensors file of these layers, and of tensors of one number.
pub(super) fn file(layers: Layers<'_>, others: &[&str]) -> Vec<u8> {
    let mut numbers: BTreeMap<String, (Vec<usize>, Vec<u8>)> = BTreeMap::new();
    let bytes =
        |count: usize| (0..count).flat_map(|i| ((i as f32 * 0.7).sin()).to_le_bytes()).collect();
    for (name, [outputs, inputs]) in layers {
        numbers
            .insert(format!("{name}.weight"), (vec![*outputs, *inputs], bytes(outputs * inputs)));
        numbers.insert(format!("{name}.bias"), (vec![*outputs], bytes(*outputs)));
    }
    for name in others {
        numbers.insert((*name).to_owned(), (vec![1], bytes(1)));
    }
    let views = numbers.iter().map(|(name, (shape, bytes))| {
        (name.clone(), TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap())
    });
    serialize(views, None).unwrap()
}

#[test]
fn other_layouts_are_recognised() {
    let is = |layers: Layers<'_>, others: &[&str], layout: &str, words: [&str; 2]| {
        let found =
            from_bytes("x.safetensors".as_ref(), &file(layers, others), &Request::default());
        let found = found.unwrap_or_else(|error| panic!("{layout}: {error}"));
        assert_eq!(found.layout.as_deref(), Some(layout));
        assert_eq!(
            [found.network.hidden_words(), found.network.output().name()],
            words,
            "{layout}"
        );
        assert_eq!((found.activation_from, found.output_from), (Origin::Layout, Origin::Layout));
        assert_eq!(found.network.widths(), [4, 8, 2], "{layout}");
        found
    };
    let (body, head, value) = ([8, 4], [2, 8], [1, 4]);
    let gaussian = ["tanh", "identity"];
    let squashed = ["relu", "tanh"];
    let rsl_rl = [
        ("actor_state_dict.mlp.0", body),
        ("actor_state_dict.mlp.2", head),
        ("critic_state_dict.mlp.0", value),
    ];
    is(&rsl_rl, &["actor_state_dict.distribution.std_param"], "rsl_rl", ["elu", "identity"]);
    let spinning_up =
        [("pi.net.0", body), ("pi.mu_layer", head), ("pi.log_std_layer", head), ("q1.q.0", value)];
    let found = is(&spinning_up, &[], "Spinning Up (SAC)", squashed);
    assert!(found.notes[0].contains("largest action"), "{:?}", found.notes);
    let spinning_up = [("pi.mu_net.0", body), ("pi.mu_net.2", head), ("v.v_net.0", value)];
    is(&spinning_up, &["pi.log_std"], "Spinning Up (PPO)", gaussian);
    let gym = [
        ("actor.net.fcs.0", body),
        ("actor.mu_layer", head),
        ("actor.log_std_layer", head),
        ("q1.0", value),
    ];
    is(&gym, &[], "safe-control-gym (SAC)", squashed);
    let tianshou = [
        ("actor.preprocess.model.model.0", body),
        ("actor.last.model.0", head),
        ("critic.last.model.0", value),
    ];
    is(&tianshou, &[], "tianshou", squashed);
    let tianshou = [("preprocess.model.model.0", body), ("mu.model.0", head)];
    is(&tianshou, &["sigma_param"], "tianshou", squashed);
    let shared = [
        ("mlp_extractor.shared_net.0", [8, 4]),
        ("mlp_extractor.policy_net.0", [2, 8]),
        ("action_net", [2, 2]),
        ("value_net", value),
    ];
    let found =
        from_bytes("x.safetensors".as_ref(), &file(&shared, &[]), &Request::default()).unwrap();
    assert_eq!(found.network.widths(), [4, 8, 2, 2]);
    // What the file does not say is asked for.
    let omnisafe = file(&[("pi.net.0", body), ("pi.net.2", head)], &["obs_normalizer._count"]);
    let error = from_bytes("x.safetensors".as_ref(), &omnisafe, &Request::default()).unwrap_err();
    assert!(error.to_string().contains("means and deviations side by side"), "{error}");
    // The same names twice are no layout: it is asked which is meant.
    let twice = [("a.actor_mean.0", body), ("b.actor_mean.0", body)];
    let content = file(&twice, &["a.actor_logstd", "b.actor_logstd"]);
    let error = from_bytes("x.safetensors".as_ref(), &content, &Request::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("2 networks") && error.contains("b.actor_mean"), "{error}");
}

#[test]
fn what_may_act_on_a_network_is_not_dropped() {
    let layers = [("pi.fc1", [8, 4]), ("pi.fc2", [2, 8])];
    let refusal = |others: &[&str]| {
        let content = file(&layers, others);
        from_bytes("x.safetensors".as_ref(), &content, &Request::default()).unwrap_err().to_string()
    };
    for name in [
        "obs_rms.mean",
        "normalizer.loc",
        "encoder.conv.weight",
        "pi_scale",
        "obs.std",
        "alpha",
        "sigma_in",
        "cost_scale",
        "target_offset",
        "q1.scale",
        // A network that judges has layers of its own.
        "critic.scale",
        "c.weight",
        "encoder_old.conv.weight",
    ] {
        let error = refusal(&[name]);
        assert!(
            error.contains(&format!("`{name}` may act on")) && error.contains("--network pi"),
            "{error}"
        );
    }
    let content = file(&layers, &["log_std", "optimizer.lr", "epoch"]);
    let found = from_bytes("x.safetensors".as_ref(), &content, &stated()).unwrap();
    assert_eq!(found.left_out, ["epoch", "log_std", "optimizer.lr"]);
    // What is a policy file is none to be imported.
    let own = found.network.to_bytes();
    let error =
        from_bytes("x.safetensors".as_ref(), &own, &Request::default()).unwrap_err().to_string();
    assert!(error.contains("a policy file already"), "{error}");
}

#[test]
fn an_order_that_the_names_do_not_say_is_asked_for() {
    let chain = |names: [&'static str; 3], networks: &[&str]| {
        let content = file(&names.map(|name| (name, [4, 4])), &[]);
        let networks = super::named(networks).networks;
        from_bytes("x.safetensors".as_ref(), &content, &Request { networks, ..stated() })
    };
    let refusal = |names| chain(names, &[]).unwrap_err().to_string();
    let error = refusal(["fc1", "log_std", "mean"]);
    assert!(
        error.contains("`log_std` may give deviations") && error.contains("fc1,mean"),
        "{error}"
    );
    assert_eq!(
        chain(["fc1", "log_std", "mean"], &["fc1", "mean"]).unwrap().layers,
        ["fc1", "mean"]
    );
    let error = refusal(["body", "gas", "steer"]);
    assert!(
        error.contains("both on the layer before") && error.contains("body,gas,steer"),
        "{error}"
    );
    assert!(chain(["body", "gas", "steer"], &["body", "gas", "steer"]).is_ok());
    assert_eq!(chain(["fc1", "fc2", "mu"], &[]).unwrap().layers, ["fc1", "fc2", "mu"]);
}

/// A safetensors file of two layers, with this metadata and a tensor of integers.
fn told(metadata: &[(&str, &str)], integers: &[&str]) -> Vec<u8> {
    let layers = file(&[("layers.0", [8, 4]), ("layers.1", [2, 8])], &[]);
    let tensors = safetensors::SafeTensors::deserialize(&layers).unwrap();
    let mut views: Vec<(String, TensorView<'_>)> =
        tensors.iter().map(|(name, view)| (name.to_owned(), view)).collect();
    let zeros = [0; 32];
    for name in integers {
        let view = TensorView::new(Dtype::I64, vec![4], &zeros).unwrap();
        views.push(((*name).to_owned(), view));
    }
    let entry = |(key, text): &(&str, &str)| ((*key).to_owned(), (*text).to_owned());
    serialize(views, Some(metadata.iter().map(entry).collect())).unwrap()
}

#[test]
fn what_a_file_says_beside_its_tensors_is_not_dropped() {
    let read = |content: &[u8]| from_bytes("x.safetensors".as_ref(), content, &stated());
    let refusal = |content: &[u8]| read(content).unwrap_err().to_string();
    let error = refusal(&told(&[("obs_mean", "[0.1, 0.2]"), ("action_scale", "2.0")], &[]));
    assert!(error.contains("`action_scale`, `obs_mean` may act on"), "{error}");
    let found =
        read(&told(&[("format", "pt"), ("author", "a name"), ("epoch", "7")], &[])).unwrap();
    assert_eq!(found.left_out, ["epoch", "author"]);
    let error = refusal(&told(&[], &["permutation"]));
    assert!(error.contains("`permutation` may act on"), "{error}");
    // A policy file that is damaged is none of another program.
    let error = refusal(&told(&[("activation", "swish"), ("output", "identity")], &[]));
    assert!(error.contains("a policy file already, which is damaged: activation"), "{error}");
    let whole = told(&[("activation", "elu"), ("output", "identity")], &[]);
    assert!(refusal(&whole).contains("needs no import"));
}
