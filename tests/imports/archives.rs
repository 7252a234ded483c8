//! What `data` in an archive of stable-baselines3 says beside the layers, and what a state dict of its leaves open.

use std::io::{Cursor, Read, Write};

use reachcast::policy::Activation;
use reachcast::policy::import::{Imported, Request, from_bytes, read};
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use super::layouts::file;
use super::{imported, named, path};

/// The archive with another `data`.
fn with_data(content: &[u8], change: &dyn Fn(&mut Value)) -> Vec<u8> {
    let mut old = ZipArchive::new(Cursor::new(content)).unwrap();
    let mut new = ZipWriter::new(Cursor::new(Vec::new()));
    for index in 0..old.len() {
        let mut entry = old.by_index(index).unwrap();
        let name = entry.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        if name == "data" {
            let mut data = serde_json::from_slice(&bytes).unwrap();
            change(&mut data);
            bytes = serde_json::to_vec(&data).unwrap();
        }
        new.start_file(name, SimpleFileOptions::default()).unwrap();
        new.write_all(&bytes).unwrap();
    }
    new.finish().unwrap().into_inner()
}

#[test]
fn what_an_archive_says_of_observations_is_told() {
    let sb3 = |change: &dyn Fn(&mut Value)| {
        let content = std::fs::read(path("sb3_ppo.zip")).unwrap();
        from_bytes("x.zip".as_ref(), &with_data(&content, change), &Request::default())
    };
    let space = |class: &str, key: &str, said: &str| {
        let (class, said) = (format!("<class 'gymnasium.spaces.{class}'>"), said.to_owned());
        sb3(&|data| data["observation_space"] = json!({ ":type:": class, key: said }))
    };
    for (class, key, said, words) in [
        ("discrete.Discrete", "n", "4", "one of 4 choices"),
        ("multi_discrete.MultiDiscrete", "nvec", "[3 1]", "choices of [3 1]"),
        ("dict.Dict", "spaces", "{'b': Box(2,), 'a': Box(2,)}", "in the order of {'b': Box"),
    ] {
        let notes = space(class, key, said).unwrap().notes.join("; ");
        assert!(notes.contains(words), "{notes}");
    }
    let image = |high: &str| {
        sb3(&|data| {
            data["observation_space"] = json!({ ":type:": "<class 'gymnasium.spaces.box.Box'>",
                "dtype": "uint8", "_shape": [1, 2, 2], "low": "[[[0 0]\n [0 0]]]", "high": high });
        })
    };
    let error = image("[[[255 255]\n [255 255]]]").unwrap_err().to_string();
    assert!(
        error.contains("images of shape [1,2,2]") && error.contains("divides by 255"),
        "{error}"
    );
    assert!(image("[[[9 9]\n [9 9]]]").is_ok());
    // The tensors alone say nothing of actions.
    let layers = [("actor.mu.0", [8, 4]), ("actor.mu.2", [2, 8]), ("actor_target.mu.0", [8, 4])];
    let content = file(&layers, &[]);
    let found = from_bytes("x.safetensors".as_ref(), &content, &Request::default()).unwrap();
    assert!(found.notes[0].contains("here within -1 and 1"), "{:?}", found.notes);
    assert!(!imported("sb3_td3.zip", &Request::default()).notes.join(" ").contains("here within"));
}

#[test]
fn a_clip_of_0_is_none() {
    let content = std::fs::read(path("sb3_sac_sde.zip")).unwrap();
    let content = with_data(&content, &|data| {
        data["policy_kwargs"]["clip_mean"] = json!(0.0);
    });
    let found = from_bytes("x.zip".as_ref(), &content, &Request::default()).unwrap();
    assert_eq!(found.network.hidden_words(), "relu");
}

/// A box of Gymnasium from [-0.12345678, -2.7182817] to [0.98765433, 3.1415927], as a model has it.
const BOX: &str = "gAWViQEAAAAAAACMFGd5bW5hc2l1bS5zcGFjZXMuYm94lIwDQm94lJOUKYGUfZQojAVkdHlwZZSMBW51bXB5lIwF\
    ZHR5cGWUk5SMAmY0lImIh5RSlChLA4wBPJROTk5K/////0r/////SwB0lGKMBl9zaGFwZZRLAoWUjANsb3eUjBNu\
    dW1weS5fY29yZS5udW1lcmljlIwLX2Zyb21idWZmZXKUk5QolggAAAAAAAAA6db8vVT4LcCUaAtLAoWUjAFDlHSU\
    UpSMDWJvdW5kZWRfYmVsb3eUaBMolgIAAAAAAAAAAQGUaAiMAmIxlImIh5RSlChLA4wBfJROTk5K/////0r/////\
    SwB0lGJLAoWUaBZ0lFKUjARoaWdolGgTKJYIAAAAAAAAAOrWfD/bD0lAlGgLSwKFlGgWdJRSlIwNYm91bmRlZF9h\
    Ym92ZZRoEyiWAgAAAAAAAAABAZRoHUsChZRoFnSUUpSMCGxvd19yZXBylE6MCWhpZ2hfcmVwcpROjApfbnBfcmFu\
    ZG9tlE51Yi4=";

#[test]
fn limits_of_actions_are_read_in_every_shape_or_their_lack_is_no_silence() {
    let changed = |name: &str, shape: Value, low: &str, high: &str| {
        with_data(&std::fs::read(path(name)).unwrap(), &|data| {
            let space = &mut data["action_space"];
            (space["_shape"], space["low"], space["high"]) =
                (shape.clone(), json!(low), json!(high));
        })
    };
    let with = |name: &str, shape: Value, low: &str, high: &str| {
        let content = changed(name, shape, low, high);
        from_bytes("x.zip".as_ref(), &content, &Request::default())
    };
    let notes = |found: reachcast::Result<Imported>| found.unwrap().notes.join("; ");
    let rows = with("sb3_sac.zip", json!([2, 1]), "[[-3.]\n [-1.]]", "[[1.]\n [5.]]");
    assert!(
        notes(rows).contains("scaled to the limits of the actions, [-3.0, -1.0] to [1.0, 5.0]")
    );
    for [low, high] in [["[-1. ... -1.]", "[1. ... 1.]"], ["[-1.]", "[1.]"], ["-inf", "[inf inf]"]]
    {
        let error = with("sb3_sac.zip", json!([2]), low, high).unwrap_err().to_string();
        assert!(error.contains("gives the output scaled to the limits"), "{error}");
        assert!(error.contains("--network imports the layers alone"), "{error}");
        let content = changed("sb3_sac.zip", json!([2]), low, high);
        let layers = named(&["actor.latent_pi", "actor.mu"]);
        let note = notes(from_bytes("x.zip".as_ref(), &content, &layers));
        assert!(note.contains("not in it: predict() gives the output scaled to"), "{note}");
        let note = notes(with("sb3_ppo.zip", json!([2]), low, high));
        assert!(note.contains("not in it: predict() gives the output kept within"), "{note}");
    }
    // The space itself has all digits, whatever NumPy was asked to print, and layers by name come without it.
    let content = with_data(&std::fs::read(path("sb3_sac.zip")).unwrap(), &|data| {
        let space = &mut data["action_space"];
        (space[":serialized:"], space["low"], space["high"]) =
            (json!(BOX), json!("[-0.1 -3.]"), json!("[1. 3.]"));
    });
    let exact =
        "[-0.12345678359270096, -2.7182817459106445] to [0.9876543283462524, 3.1415927410125732]";
    let note = notes(from_bytes("x.zip".as_ref(), &content, &Request::default()));
    assert!(note.contains(exact) && !note.contains("not in it"), "{note}");
    let note =
        notes(from_bytes("x.zip".as_ref(), &content, &named(&["actor.latent_pi", "actor.mu"])));
    assert!(
        note.contains(&format!(
            "not in it: the output is scaled to the limits of the actions, {exact}"
        )),
        "{note}"
    );
}

#[test]
fn an_activation_of_ones_own_is_none_of_pytorch() {
    let with = |class: &str| {
        let content = std::fs::read(path("sb3_ppo.zip")).unwrap();
        let content = with_data(&content, &|data| {
            data["policy_kwargs"]["activation_fn"] = json!(class);
        });
        move |request: &Request| from_bytes("x.zip".as_ref(), &content, request)
    };
    let usual = with("<class 'torch.nn.modules.activation.ELU'>")(&Request::default());
    assert_eq!(usual.unwrap().network.hidden_words(), "elu");
    for class in ["<class 'mine.ELU'>", "<class '__main__.ReLU'>", "<class 'torch.nn.Unheard'>"] {
        let error = with(class)(&Request::default()).unwrap_err().to_string();
        assert!(error.contains(class) && error.contains("--activation states"), "{error}");
        let stated = Request { activation: Some(Activation::Silu), ..Request::default() };
        assert_eq!(with(class)(&stated).unwrap().network.hidden_words(), "silu");
    }
}

#[test]
fn a_part_of_an_archive_has_the_activations_of_no_whole() {
    let error = read(&path("sb3_ppo.zip"), &named(&["action_net"])).unwrap_err().to_string();
    assert!(error.contains("what follows its one layer") && error.contains("--output"), "{error}");
    let output = Some(Activation::Identity);
    let found = read(&path("sb3_ppo.zip"), &Request { output, ..named(&["action_net"]) });
    assert_eq!(found.unwrap().layers, ["action_net"]);
}
