//! What lies beside a policy in a pickle, and is no tensor: refused where it may act on it, and else named.

use reachcast::policy::Activation;
use reachcast::policy::import::{Imported, Request, from_bytes};

use super::layouts::{Layers, file};
use super::named;
use crate::checkpoint::stated;

/// A text.
fn text(text: &str) -> Vec<u8> {
    [b"X", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// A dictionary.
fn dict(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let entries = entries.iter().flat_map(|(key, value)| [text(key), value.clone()].concat());
    [b"}(".to_vec(), entries.collect(), b"u".to_vec()].concat()
}

/// An array of NumPy of this shape, remembered under `number` before it has its numbers.
fn array(shape: &[u8], number: u8) -> Vec<u8> {
    let count: usize = shape.iter().map(|length| usize::from(*length)).product();
    let numbers: Vec<u8> = (0..count).flat_map(|i| (i as f32 * 0.7).sin().to_le_bytes()).collect();
    let lengths: Vec<u8> = shape.iter().flat_map(|length| [b'K', *length]).collect();
    [
        b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85C\x01b\x87R".to_vec(),
        vec![b'q', number],
        [&b"(K\x01("[..], &lengths, b"tcnumpy\ndtype\n", &text("f4"), b"\x89\x88\x87R"].concat(),
        [&b"(K\x03"[..], &text("<"), b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"].concat(),
        [&b"\x89B"[..], &(numbers.len() as u32).to_le_bytes(), &numbers, b"tb"].concat(),
    ]
    .concat()
}

/// Two layers from 4 numbers to 2, the last bias of which is `bias`, beside these entries.
fn pickle(bias: Vec<u8>, entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let layer = |weight: [u8; 2], bias: Vec<u8>| dict(&[("w", array(&weight, 0)), ("b", bias)]);
    let layers = [("linear_0", layer([4, 8], array(&[8], 1))), ("linear_1", layer([8, 2], bias))];
    let entries = [&[("params", dict(&layers))], entries].concat();
    [b"\x80\x02".to_vec(), dict(&entries), b".".to_vec()].concat()
}

fn read(content: &[u8], request: &Request) -> reachcast::Result<Imported> {
    from_bytes("x.pkl".as_ref(), content, request)
}

/// The refusal of the two layers beside this entry, which `--network params` leaves out.
fn refusal(key: &str, value: Vec<u8>) -> String {
    let content = pickle(array(&[2], 2), &[(key, value)]);
    let found = read(&content, &Request { networks: named(&["params"]).networks, ..stated() });
    let left_out = found.unwrap().left_out.join(" ");
    assert!(left_out.contains(key), "no {key} in {left_out}");
    read(&content, &stated()).unwrap_err().to_string()
}

/// What is left out beside the two layers.
fn left_out(entries: &[(&str, Vec<u8>)]) -> Vec<String> {
    read(&pickle(array(&[2], 2), entries), &stated()).unwrap().left_out
}

const OBJECT: &[u8] = b"c__main__\nRunningMeanStd\n)\x81";

#[test]
fn an_array_that_is_there_twice_is_one_both_times() {
    let twice = |key: &'static str| pickle(b"h\x09".to_vec(), &[(key, b"h\x09".to_vec())]);
    let first = [("optimizer", dict(&[("a", array(&[2], 9))]))];
    let whole = |mut rest: Vec<u8>| {
        let entry = [text(first[0].0), first[0].1.clone()].concat();
        rest.splice(4..4, entry);
        rest
    };
    let found = read(&whole(twice("epoch_opt")), &stated()).unwrap();
    assert_eq!(found.network.widths(), [4, 8, 2]);
    let plain = read(&pickle(array(&[2], 2), &[]), &stated()).unwrap();
    assert_eq!(found.network.digest(), plain.network.digest());
    let error = read(&whole(twice("obs_scale")), &stated()).unwrap_err().to_string();
    assert!(error.contains("`obs_scale` may act on"), "{error}");
}

#[test]
fn objects_beside_a_policy_are_refused_by_name() {
    let error = refusal("obs_rms", dict(&[("rms", OBJECT.to_vec())]));
    let words =
        "`obs_rms.rms` (an object of `__main__.RunningMeanStd`, which was not made) may act";
    assert!(error.contains(words), "{error}");
    // It is no part of the policy's dictionary in a list, either.
    let layers = dict(&[("w", array(&[4, 2], 0)), ("b", array(&[2], 1))]);
    let list = [b"\x80\x02](".to_vec(), layers, OBJECT.to_vec(), b"e.".to_vec()].concat();
    let error = read(&list, &stated()).unwrap_err().to_string();
    assert!(error.contains("`1` (an object of"), "{error}");
    let found = read(&list, &Request { networks: named(&["0"]).networks, ..stated() }).unwrap();
    assert_eq!(found.left_out, ["1 (__main__.RunningMeanStd)"]);
    // Those of training, and a device are not.
    let device = b"ctorch\ndevice\nX\x03\x00\x00\x00cpu\x85R".to_vec();
    let names = left_out(&[
        ("scheduler", dict(&[("x", OBJECT.to_vec())])),
        ("where", dict(&[("d", device)])),
    ]);
    assert_eq!(names, ["scheduler.x (__main__.RunningMeanStd)", "where.d (torch.device)"]);
}

#[test]
fn what_objects_are_called_with_is_not_lost() {
    // Statistics of Brax by name are read; those that it is called with, in a row or by name, are an object's.
    const CLASS: &[u8] = b"cbrax.running_statistics\nRunningStatisticsState\n";
    let statistics = |arguments: &[u8]| [CLASS, arguments].concat();
    let mean = || array(&[4], 5);
    let attributes = statistics(&[&b")\x81"[..], &dict(&[("mean", mean())]), b"b"].concat());
    assert!(refusal("normalizer", attributes).contains("`normalizer.mean` may act on"));
    let is_object = |value: Vec<u8>| {
        let error = refusal("normalizer", value);
        assert!(error.contains("`normalizer` (an object of `brax"), "{error}");
    };
    is_object(statistics(&[mean(), b"\x85R".to_vec()].concat()));
    is_object(statistics(&[mean(), b"\x85\x81".to_vec()].concat()));
    is_object(statistics(&[&b")R"[..], &mean(), b"\x85R"].concat()));
    let by_name = [&b")"[..], &dict(&[("mean", mean())]), b"\x92"].concat();
    assert!(refusal("normalizer", statistics(&by_name)).contains("`normalizer.mean` may act on"));
    let dictionary = [&b"ccollections\nOrderedDict\n)"[..], &dict(&[("mean", mean())]), b"\x92"];
    let content = pickle(array(&[2], 2), &[("normalizer", dictionary.concat())]);
    let error = read(&content, &stated()).unwrap_err().to_string();
    assert!(error.contains("named arguments of what takes none"), "{error}");
}

#[test]
fn attributes_of_tensors_and_dictionaries_are_refused() {
    let slots = |state: Vec<u8>| [&b"N"[..], &state, b"\x86"].concat();
    let state = || dict(&[("scale", text("2"))]);
    let built = |value: Vec<u8>, state: Vec<u8>| [value, state, b"b".to_vec()].concat();
    for value in
        [built(dict(&[]), state()), built(dict(&[]), slots(state())), built(b"]".to_vec(), state())]
    {
        let error = read(&pickle(array(&[2], 2), &[("more", value)]), &stated()).unwrap_err();
        assert!(error.to_string().contains("the attribute `scale`"), "{error}");
    }
    // Versions of modules, and none.
    let versions = dict(&[("_metadata", dict(&[]))]);
    assert!(left_out(&[("more", built(dict(&[]), versions))]).is_empty());
    // As PyTorch writes them, of a tensor and of a parameter.
    let inner = |name: &str| [b"ctorch._tensor\n", name.as_bytes()].concat();
    let typed = |state: Vec<u8>| {
        let parts = [
            inner("_rebuild_from_type_v2\n"),
            b"(ccollections\nOrderedDict\nctorch\nTensor\n)".to_vec(),
        ];
        [parts.concat(), state, b"tR".to_vec()].concat()
    };
    let parameter = |state: Vec<u8>| {
        let name = b"ctorch._utils\n_rebuild_parameter_with_state\n(".to_vec();
        [name, array(&[2], 7), b"\x88}".to_vec(), state, b"tR".to_vec()].concat()
    };
    for value in [typed(state()), typed(slots(state())), parameter(state())] {
        let error = read(&pickle(array(&[2], 2), &[("epoch", value)]), &stated()).unwrap_err();
        assert!(error.to_string().contains("the attribute `scale`"), "{error}");
    }
    assert_eq!(left_out(&[("optimizer", parameter(b"}".to_vec()))]), ["optimizer"]);
}

#[test]
fn plain_values_of_all_sorts_are_refused_or_named() {
    let long = [b"\x8a\x09", &[1; 9][..]].concat();
    let flags = b"](\x88\x89e".to_vec();
    let numbers = [b"](".to_vec(), text("0.1"), text("0.2"), b"e".to_vec()].concat();
    let raw = b"C\x04\x00\x00\x80\x3f".to_vec();
    for (key, value) in [
        ("normalize", b"\x88".to_vec()),
        ("off", b"\x89".to_vec()),
        ("big", long),
        ("max_action", text("2.0")),
        ("flags", flags),
        ("low", numbers.clone()),
        ("raw", raw),
        // Several numbers are no count.
        ("gamma", numbers),
        ("tau", array(&[4], 3)),
    ] {
        let error = refusal(key, value);
        assert!(error.contains(&format!("`{key}` may act on")), "{error}");
    }
    let words = [b"](".to_vec(), text("x"), text("y"), b"e".to_vec()].concat();
    let others = [
        ("author", text("a name")),
        ("torch_version", text("2.1")),
        ("gamma", text("0.99")),
        ("columns", words),
        ("nothing", b"N".to_vec()),
    ];
    assert_eq!(left_out(&others), ["torch_version", "gamma", "author", "columns"]);
}

#[test]
fn words_that_name_another_activation_are_refused() {
    let config = |key: &str, word: &str| {
        let layers = dict(&[(key, text(word))]);
        pickle(array(&[2], 2), &[("cfg", layers)])
    };
    let activation = Some(Activation::Relu);
    let is = |key: &str, word: &str, request: &Request| read(&config(key, word), request);
    // Nothing is said of the output.
    let half = Request { activation, ..Request::default() };
    let error = is("output_activation", "identity", &half).unwrap_err().to_string();
    assert!(error.contains("`cfg.output_activation` says `identity`, and `tanh`"), "{error}");
    assert!(error.contains("--output"), "{error}");
    assert!(is("output_activation", "Tanh", &half).is_ok());
    assert!(is("activation", "elu", &half).is_ok());
    for key in ["hidden_act", "activation_fn", "act", "nonlinearity"] {
        let error = is(key, "elu", &named(&["params"])).unwrap_err().to_string();
        assert!(error.contains(&format!("`cfg.{key}` says `elu`")), "{error}");
        assert!(is(key, "relu", &named(&["params"])).is_ok());
    }
    let network = named(&["params"]);
    let error = is("activation", "elu", &network).unwrap_err().to_string();
    assert!(error.contains("says `elu`, and `relu` would be used"), "{error}");
    assert!(is("activation", "nn.ReLU()", &network).is_ok());
}

const CLEANRL: Layers<'_> = &[("fc1", [8, 4]), ("fc2", [8, 8]), ("fc_mu", [2, 8])];

#[test]
fn statistics_of_others_and_of_nobody_are_not_taken() {
    let refusal = |layers: Layers<'_>, others: &[&str]| {
        let content = file(layers, others);
        from_bytes("x.safetensors".as_ref(), &content, &Request::default()).unwrap_err().to_string()
    };
    for key in ["_mean", "_std", "std", "var", "1.obs_mean"] {
        let error = refusal(CLEANRL, &["action_scale", "action_bias", key]);
        assert!(error.contains(&format!("`{key}` may act on")), "{error}");
        assert!(
            error.contains("--network fc1,fc2,fc_mu --activation 'relu' --output 'tanh'"),
            "{error}"
        );
    }
    // What `--network` would find in a module is not there for it.
    let item = [("0.fc1", [8, 4]), ("0.fc2", [8, 8]), ("0.fc_mu", [2, 8])];
    let error = refusal(&item, &["0.action_scale", "0.action_bias", "1.obs_mean"]);
    assert!(error.contains("--network 0.fc1,0.fc2,0.fc_mu --activation"), "{error}");
    let rsl_rl = [("actor.0", [8, 4]), ("actor.2", [2, 8]), ("critic.0", [1, 4])];
    let error = refusal(&rsl_rl, &["std", "actor.0.std"]);
    assert!(error.contains("`actor.0.std` may act on"), "{error}");
    assert!(
        error.contains("--network actor.0,actor.2 --activation 'elu' --output 'identity'"),
        "{error}"
    );
    let gym = [("agent.actor.pi_net.fcs.0", [8, 4]), ("agent.actor.pi_net.fcs.1", [2, 8])];
    let other = ["adversary.obs_normalizer.mean", "adversary.obs_normalizer.var"];
    let error = refusal(&gym, &["agent.actor.logstd", other[0], other[1]]);
    assert!(error.contains("`adversary.obs_normalizer.mean` may act on"), "{error}");
    // The central value of rl_games has its own.
    let rl_games = [
        ("model.a2c_network.actor_mlp.0", [8, 4]),
        ("model.a2c_network.mu", [2, 8]),
        ("model.a2c_network.value", [1, 8]),
    ];
    let central = "assymetric_vf_nets.model.running_mean_std";
    let [mean, variance] = ["mean", "var"].map(|key| format!("{central}.running_{key}"));
    let content = file(&rl_games, &[&mean, &variance]);
    let found = from_bytes("x.safetensors".as_ref(), &content, &Request::default()).unwrap();
    assert_eq!((found.notes.len(), found.left_out.contains(&mean)), (0, true));
}
