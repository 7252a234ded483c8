//! What a file leaves in doubt is asked for, with what to do about it, and never guessed.

use std::path::Path;

use reachcast::policy::import::{Imported, Request, from_bytes};
use reachcast::policy::{Activation, Layer, Mlp, Rescale};

use super::layouts::file;
use super::{imported, named};
use crate::checkpoint::stated;

fn read(name: &str, content: &[u8], request: &Request) -> reachcast::Result<Imported> {
    from_bytes(Path::new(name), content, request)
}

/// Expects a refusal of a safetensors file with these words.
fn refusal(content: &[u8], request: &Request, words: &[&str]) {
    let error = read("x.safetensors", content, request).unwrap_err();
    let message = error.to_string();
    assert_eq!(error.exit_code(), 2);
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
}

fn default() -> Request {
    Request::default()
}

#[test]
fn activations_that_nobody_says_are_asked_for() {
    let content = file(&[("pi.0", [8, 4]), ("pi.2", [2, 8])], &[]);
    refusal(&content, &default(), &["--activation", "leaky_relu", "--output"]);
    let output = Some(Activation::Identity);
    refusal(&content, &Request { output, ..default() }, &["--activation"]);
    let activation = Some(Activation::Elu { alpha: 1.0 });
    let found = read("x.safetensors", &content, &Request { activation, ..default() }).unwrap();
    assert_eq!(found.network.hidden_words(), "elu");
    let single = file(&[("pi.0", [2, 4])], &[]);
    refusal(&single, &default(), &["follows its one layer", "--output"]);
    assert!(read("x.safetensors", &single, &Request { output, ..default() }).is_ok());
    // An actor beside a critic and a `log_std` is anybody's; in a file of rsl_rl, or beside its `std`, it is known.
    let parts = |outer: &str| {
        [("actor.0", [8, 4]), ("actor.2", [2, 8]), ("critic.0", [1, 4])]
            .map(|(name, shape)| (format!("{outer}{name}"), shape))
    };
    for (outer, deviation, is_known) in [
        ("", "log_std", false),
        ("", "std", true),
        ("model_state_dict.", "model_state_dict.log_std", true),
    ] {
        let layers = parts(outer);
        let layers: Vec<(&str, [usize; 2])> =
            layers.iter().map(|(name, shape)| (name.as_str(), *shape)).collect();
        let found = read("x.safetensors", &file(&layers, &[deviation]), &default());
        assert_eq!(found.is_ok(), is_known, "{outer}{deviation}: {found:?}");
    }
}

#[test]
fn statistics_are_applied_as_a_library_does_only_in_its_own_files() {
    let layers = [("net.0", [8, 4]), ("net.2", [2, 8])];
    for pair in [
        ["obs_normalizer.mean", "obs_normalizer.var"],
        ["running_mean_std.running_mean", "running_mean_std.running_var"],
        ["actor_obs_normalizer._mean", "actor_obs_normalizer._std"],
    ] {
        refusal(&file(&layers, &pair), &stated(), &[pair[0], "may act on", "ONNX"]);
    }
    let notes = imported("safe_control_gym.pt", &default()).notes.join("; ");
    assert!(notes.contains("sqrt(variance + 0.00000001), within 10"), "{notes}");
    let notes = imported("rsl_rl.pt", &default()).notes.join("; ");
    assert!(notes.contains("(x - mean) / (deviation + 0.01)"), "{notes}");
}

#[test]
fn means_of_exploration_that_depends_on_the_state_stay_within_their_limit() {
    let found = imported("sb3_sac_sde.zip", &default());
    assert_eq!(found.network.hidden_words(), "relu, hardtanh(-0.4,0.4)");
    assert!(found.notes.iter().any(|note| note.contains("0.4 (clip_mean), as `data` says")));
    let layers = named(&["actor.latent_pi", "actor.mu"]);
    let found = imported("sb3_sac_sde.zip", &layers);
    let note = "not in it: the sums of `actor.mu.0` stay within";
    assert!(found.notes[0].starts_with(note), "{:?}", found.notes);
}

#[test]
fn an_actor_whose_last_layer_gives_deviations_is_not_taken_whole() {
    let trunk = [("actor.trunk.0", [8, 4]), ("actor.trunk.2", [4, 8])];
    let words = ["pytorch_sac", "the first 2 would be the policy", "--network actor.trunk"];
    refusal(&file(&trunk, &[]), &stated(), &words);
    let odd = [("actor.trunk.0", [8, 4]), ("actor.trunk.2", [3, 8])];
    assert!(read("x.safetensors", &file(&odd, &[]), &stated()).is_ok());
    let found = imported("pytorch_sac.pt", &named(&["actor.trunk"]));
    assert!(found.notes[0].contains("all of them are outputs here"), "{:?}", found.notes);
    assert_eq!(found.network.widths().last(), Some(&4));
}

#[test]
fn orders_that_the_names_do_not_say_are_asked_for() {
    let is = |layers: &[(&str, [usize; 2])], networks: &[&str], words: &[&str]| {
        let networks = named(networks).networks;
        refusal(&file(layers, &[]), &Request { networks, ..stated() }, words);
    };
    // Two wide layers of one shape, with a narrow one between them, in one of two orders.
    let wide = [("net.a", [8, 4]), ("net.b", [4, 8]), ("net.c", [8, 4]), ("net.mu", [2, 8])];
    is(&wide, &[], &["in which order they are applied", "--network net.a,net.b,net.c,net.mu"]);
    is(&wide, &["net"], &["net.c,net.b,net.a,net.mu"]);
    let each = named(&["net.c", "net.b", "net.a", "net.mu"]).networks;
    let found =
        read("x.safetensors", &file(&wide, &[]), &Request { networks: each, ..stated() }).unwrap();
    assert_eq!(found.layers, ["net.c", "net.b", "net.a", "net.mu"]);
    // A loop may begin anywhere.
    is(&[("net.up", [8, 4]), ("net.down", [4, 8])], &[], &["in which order"]);
    // Numbers, and names of first and last layers, say it.
    for names in [&["fc1", "fc2", "fc3"][..], &["in", "out"]] {
        let layers: Vec<(&str, [usize; 2])> = names.iter().map(|name| (*name, [4, 4])).collect();
        let found = read("x.safetensors", &file(&layers, &[]), &stated()).unwrap();
        assert_eq!(found.layers, names);
    }
    // What is in no order is told, with the one that fits.
    let reverse = [("net.a", [2, 8]), ("net.b", [8, 4])];
    is(&reverse, &[], &["takes 4 numbers", "in this order: --network net.b,net.a"]);
    let apart = [("net.a", [8, 4]), ("net.b", [8, 4])];
    is(&apart, &[], &["takes 4 numbers", "in no order", "ONNX"]);
    let several = [("net.mu", [2, 8]), ("net.a", [8, 8]), ("net.b", [8, 8]), ("net.c", [8, 4])];
    is(&several, &["net.mu", "net.a", "net.b", "net.c"], &["several orders fit"]);
}

#[test]
fn norms_are_named_with_what_keeps_them() {
    let layers = [("net.0", [8, 4]), ("net.3", [2, 8])];
    for (tensors, what) in [
        (&["net.1.weight", "net.1.bias"][..], "`net.1` is a LayerNorm or GroupNorm"),
        (&["net.1.weight", "net.1.bias", "net.1.running_mean"], "`net.1` is a BatchNorm"),
        (&["net.1.weight"], "`net.1` is a PReLU"),
        (&["net.LayerNorm_0.scale"], "`net.LayerNorm_0` is a LayerNorm"),
        (&["head.norm.weight", "head.norm.bias"], "`head.norm` is a LayerNorm"),
    ] {
        refusal(&file(&layers, tensors), &stated(), &[what, "torch.onnx.export"]);
    }
}

#[test]
fn names_and_pairs_of_jax_are_layers() {
    let content = file(&[("mlp/~/linear_0", [8, 4]), ("mlp/~/linear_1", [2, 8])], &[]);
    let content = {
        let tensors = safetensors::SafeTensors::deserialize(&content).unwrap();
        let views = tensors.iter().map(|(name, view)| (name.replace(".weight", "/w"), view));
        let views = views.map(|(name, view)| (name.replace(".bias", "/b"), view));
        let transposed = views.map(|(name, view)| {
            let shape: Vec<usize> = view.shape().iter().rev().copied().collect();
            (name, safetensors::tensor::TensorView::new(view.dtype(), shape, view.data()).unwrap())
        });
        safetensors::serialize(transposed.collect::<Vec<_>>(), None).unwrap()
    };
    let found = read("x.safetensors", &content, &stated()).unwrap();
    assert_eq!(found.layers, ["mlp.~.linear_0", "mlp.~.linear_1"]);
    assert_eq!(found.network.widths(), [4, 8, 2]);
}

#[test]
fn inputs_far_from_zero_keep_their_digits() {
    let layer = Layer::dense(vec![1.0, 0.0, 0.0, 1.0], vec![0.0, 0.0]);
    let center = vec![100.0, 0.0];
    let input = Rescale { center, ..Rescale::affine(vec![20.0, 3.0], vec![0.0, 0.5]) };
    let plain = Mlp::new(vec![layer], Activation::Relu, Activation::Identity).unwrap();
    let network = plain.clone().with_input(input.clone()).unwrap();
    assert_eq!(network.forward(&[100.062_5_f32, 2.0]), [1.25, 6.5]);
    assert_eq!(Mlp::from_bytes(&network.to_bytes()).unwrap(), network);
    let other = Rescale { center: vec![0.0; 2], ..input.clone() };
    assert_ne!(plain.clone().with_input(other).unwrap().digest(), network.digest());
    let wrong = Rescale { center: vec![f32::NAN, 0.0], ..input.clone() };
    assert!(plain.clone().with_input(wrong).unwrap_err().to_string().contains("input.center[0]"));
    let short = Rescale { center: vec![1.0], ..input };
    assert!(plain.with_input(short).unwrap_err().to_string().contains("input.center has 1"));
    // It is written as an operation of its own, and read as what it was.
    let onnx = reachcast::policy::onnx_bytes(&network);
    assert_eq!(read("x.onnx", &onnx, &default()).unwrap().network.digest(), network.digest());
}

#[test]
fn a_matlab_file_of_version_7_3_is_called_so() {
    let error = read("x.mat", b"MATLAB 7.3 MAT-file", &default()).unwrap_err();
    assert!(error.to_string().contains("version 7.3, which is HDF5"), "{error}");
}
