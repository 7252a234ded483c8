//! What is asked for is what is done: options that change nothing are refused, settings are blamed by
//! their own name, counts follow from claims, and what was not obtained shows in the exit code.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command::{Folder, document, done, reachcast, refused};
use reachcast::config::{Config, Overrides, Profile};
use reachcast::policy::Mlp;
use reachcast::race::DroneRace;
use reachcast::rollout::{MppiSettings, MppiSpec, Sigma};
use reachcast::system::System;
use safetensors::tensor::{Dtype, TensorView};

const RACE: &str = "configs/race.toml";
const SMOKE: &str = "configs/smoke.toml";
const LINE: &str = "configs/double_integrator.toml";
const POLICY: &str = "configs/policies/race_policy.safetensors";

#[test]
fn options_that_change_nothing_are_refused() {
    let scenarios = ["scenarios", "--epsilon", "0.1", "--beta", "1e-3"];
    let rollout = ["rollout", LINE, "--starts", "s.csv", "--measures", "/nowhere/m.csv"];
    let query = ["query", "/nowhere", "--states", "s.csv"];
    let import = ["policy", "import", "x.pth", "--out", "/nowhere/x.safetensors"];
    let lacks: [(&[&str], &[&str]); 8] = [
        (&scenarios, &["--set", "--seed", "--profile", "--out", "--overwrite"]),
        (&["devices"], &["--set", "--seed", "--profile", "--out", "--overwrite"]),
        (&["check", "/nowhere"], &["--set", "--seed", "--profile", "--out", "--overwrite"]),
        (&query, &["--set", "--seed", "--profile"]),
        (&rollout, &["--seed", "--out"]),
        (&["bench", "--quick"], &["--set", "--profile"]),
        (&import, &["--seed"]),
        (&["policy", "inspect", POLICY], &["--out"]),
    ];
    for (command, options) in lacks {
        for option in options {
            let value = match *option {
                "--set" => "seed=2",
                "--seed" => "2",
                "--profile" => "study",
                _ => "/nowhere/out",
            };
            let given = if *option == "--overwrite" { vec![*option] } else { vec![*option, value] };
            refused(&[command, &given].concat(), &["unexpected argument", option]);
        }
    }
    // Without a configuration there is nothing to set.
    let inspect = ["policy", "inspect", POLICY];
    refused(&[&inspect[..], &["--set", "seed=2"]].concat(), &["--set seed=2", "--config"]);
    refused(&[&inspect[..], &["--profile", "study"]].concat(), &["--profile", "--config"]);
    refused(&[&import[..], &["--set", "seed=2"]].concat(), &["--set seed=2", "--config"]);
    refused(&["certify", LINE, "--set", "box={}"], &["--set box={}", "sets nothing"]);
}

#[test]
fn options_of_every_command_are_taken_everywhere() {
    let all = ["--backend", "cpu", "--fallback", "--threads", "1", "--json", "-q"];
    done(&[&["scenarios", "--epsilon", "0.1", "--beta", "1e-3"][..], &all].concat());
    done(&[&["devices"][..], &all].concat());
    done(&[&["policy", "inspect", POLICY][..], &all].concat());
    // In the help they stand apart from the command's own.
    for command in ["certify", "rollout", "query", "check", "race", "sweep", "scenarios", "bench"] {
        let help = done(&[command, "--help"]);
        let (own, shared) = help.split_once("Options of every command:").unwrap();
        assert!(shared.contains("--threads") && !own.contains("--threads"), "{command}: {help}");
    }
    for (command, folder) in [
        ("certify", "reachcast-out"),
        ("race", "reachcast-race"),
        ("sweep", "reachcast-sweep"),
        ("train", "reachcast-train"),
    ] {
        let default = format!("[default: {folder}]");
        assert!(done(&[command, "--help"]).contains(&default), "{command}");
    }
}

/// Every document says which layout it has.
#[test]
fn every_document_has_the_version_of_its_layout() {
    let folder = Folder::new();
    let at = |name: &str| folder.path(name);
    std::fs::write(at("s.csv"), "0.5,0\n").unwrap();
    let (states, cert, race) = (at("s.csv"), at("cert"), at("race"));
    let small = "--set global.draws=500 --set slice.x.step=0.5 --set slice.y.step=0.5";
    let commands = [
        "devices".to_owned(),
        "scenarios --epsilon 0.1 --beta 1e-3".to_owned(),
        format!("policy inspect {POLICY}"),
        format!("policy import tests/fixtures/checkpoints/silu.onnx --out {}", at("p.safetensors")),
        format!("rollout {LINE} --starts {states} --measures {}", at("m.csv")),
        format!("certify {LINE} --out {cert} {small}"),
        format!("query {cert} --states {states}"),
        format!("query {cert} --states {states} --out {}", at("answers")),
        format!("check {cert}"),
        format!("race {SMOKE} --starts 2 --controllers mppi --set race.steps=2 --out {race}"),
        format!("sweep {LINE} --of certificate --radius 0.02 --out {} {small}", at("sweep")),
        format!("bench --export {}", at("export")),
    ];
    for command in &commands {
        let words: Vec<&str> = command.split_whitespace().chain(["--backend", "cpu"]).collect();
        assert!(document(&words)["schema"].as_u64().is_some_and(|schema| schema > 0), "{command}");
    }
    for file in
        ["cert/certificate.json", "race/results.json", "race/timing.json", "sweep/sweep.json"]
    {
        let text = std::fs::read_to_string(at(file)).unwrap();
        let document: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert!(document["schema"].is_u64(), "{file}");
    }
}

#[test]
fn settings_are_blamed_by_their_own_name() {
    let folder = Folder::new();
    let config = folder.path("mine.toml");
    std::fs::write(&config, "system.name = 'double-integrator'\npolicy.formula = 'bang-bang'\n")
        .unwrap();
    let certify = |sets: &[&str], words: &[&str], not: &str| {
        let sets = sets.iter().flat_map(|set| ["--set", *set]);
        let arguments: Vec<&str> = ["certify", &config].into_iter().chain(sets).collect();
        let (code, _, message) = reachcast(&arguments);
        assert_eq!(code, Some(2), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
        assert!(not.is_empty() || !message.contains(not), "{message}");
    };
    certify(&["rollout.horizon=ten"], &["error: --set rollout.horizon=ten: "], "mine.toml");
    let two = ["rollout.horizon=20", "deviation.joint=all"];
    certify(&two, &["error: --set deviation.joint=all: "], "mine.toml");
    certify(&["deviation.joint=all", "seed=3"], &["error: --set deviation.joint=all: "], "mine");
    certify(&["system.name=dubins"], &["error: --set system.name=dubins: "], "mine.toml");
    certify(&["profile=fast"], &["error: --set profile=fast: ", "rigorous"], "mine.toml");
    certify(&["policy.file=x"], &["error: --set policy.file=x: policy: both"], "");
    // What is wrong in the file stays its own, whatever is set over other keys.
    std::fs::write(&config, "system.name = 'double-integrator'\nseed = 'one'\n").unwrap();
    certify(&["rollout.horizon=20"], &["mine.toml", "seed"], "");
    std::fs::write(&config, "system = 'double-integrator'\n").unwrap();
    certify(&[], &["mine.toml: system", "[system]"], "");
    std::fs::write(&config, "profile = 3\nsystem.name = 'double-integrator'\n").unwrap();
    certify(&[], &["mine.toml: profile", "3 is no text"], "");
    // What shows only once it is used has its line, or the setting.
    let text = "system.name = 'double-integrator'\npolicy.formula = 'bang-bang'\n\
                slice.x.step = 1e-9\ngrowth.rounds = 3\n";
    std::fs::write(&config, text).unwrap();
    certify(&[], &["mine.toml:3: slice.x: 2400000000 values"], "");
    certify(&["slice.x.step=0.1", "growth.rounds=0"], &["error: --set growth.rounds=0: 0"], "mine");
    certify(&["slice.y.state=position"], &["slice.x: 2400000000 values"], "");
    std::fs::write(&config, "system.name = 'double-integrator'\n").unwrap();
    certify(&[], &["mine.toml: policy: no policy"], "");
    // The nearest key is one of the same section.
    certify(&["state.x=1"], &["--set state.x=1: ", "`state.position`"], "mine.toml");
}

/// The pairs and the starts of a round that a configuration comes to.
fn counts(path: &str, sets: &[&str]) -> [u64; 2] {
    let set = sets.iter().map(|set| (*set).to_owned()).collect();
    let overrides = reachcast::config::Overrides { set, ..Default::default() };
    let config = Config::load(path.as_ref(), &overrides).unwrap();
    [config.deviation.scenarios, config.growth.scenarios]
}

#[test]
fn scenario_counts_follow_from_what_is_asked_for() {
    // The published counts are those of the profiles' own claims.
    assert_eq!(counts(RACE, &[]), [159, 159]);
    assert_eq!(counts(RACE, &["profile=study"]), [158, 158]);
    // The simple bound: ceil(2 / epsilon (ln(1 / beta) + d)).
    assert_eq!(counts(RACE, &["deviation.epsilon=0.01"]), [1582, 159]);
    assert_eq!(counts(RACE, &["growth.epsilon=0.05"]), [159, 317]);
    // Shrinking, beta over the rounds: ceil(20 (ln 20,000 + 1)).
    assert_eq!(counts(RACE, &["growth.method=shrinking"]), [159, 219]);
    assert_eq!(counts(RACE, &["deviation.joint=variables"]), [739, 159]);
    assert_eq!(counts(RACE, &["deviation.joint=variables", "rollout.horizon=10"]), [339, 159]);
    assert_eq!(counts(RACE, &["growth.rounds=1"]), [159, 159]);
    // What is given stays, and is held against the claim.
    assert_eq!(counts(RACE, &["deviation.scenarios=300", "deviation.epsilon=0.05"]), [300, 159]);
    let few = ["deviation.epsilon=0.01", "deviation.scenarios=300"];
    let set: Vec<&str> = few.iter().flat_map(|set| ["--set", *set]).collect();
    refused(&[&["certify", LINE][..], &set].concat(), &["300 scenarios", "at least 688"]);
    // A file's own count is that of the file's own claim.
    let folder = Folder::new();
    let own = folder.path("own.toml");
    let text = "system.name = 'double-integrator'\npolicy.formula = 'bang-bang'\n\
                deviation = { epsilon = 0.05, scenarios = 400 }\n";
    std::fs::write(&own, text).unwrap();
    assert_eq!(counts(&own, &[])[0], 400);
    assert_eq!(counts(&own, &["deviation.epsilon=0.01"])[0], 1582);
    assert_eq!(counts(&own, &["rollout.gamma=0.9"])[0], 400);
    // What no count supports is refused where it is checked.
    refused(&["certify", LINE, "--set", "deviation.epsilon=0"], &["deviation.epsilon"]);
}

#[test]
fn a_point_that_does_not_hold_shows_in_the_exit_code() {
    let folder = Folder::new();
    let out = folder.path("out");
    let small = "--of certificate --set global.draws=500 --set slice.x.step=0.5 --set \
                 slice.y.step=0.5 --backend cpu -q";
    let mut arguments = vec!["sweep", LINE, "--out", &out, "--radius", "0.02,0.9"];
    arguments.extend(small.split_whitespace());
    let (code, _, message) = reachcast(&arguments);
    assert_eq!(code, Some(3), "{message}");
    // Its tables name each column once.
    let table = std::fs::read_to_string(format!("{out}/sweep.csv")).unwrap();
    let mut names: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "{names:?}");
    assert!(names.contains(&"radius") && names.contains(&"ball_radius"));
    // Rows that other values leave out are told, and come back with theirs.
    let again = |radius: &str| {
        let mut arguments = vec!["sweep", LINE, "--out", &out, "--radius", radius, "--json"];
        arguments.extend(small.split_whitespace());
        let record: serde_json::Value = serde_json::from_str(&reachcast(&arguments).1).unwrap();
        record["notes"].to_string()
    };
    assert!(again("0.02").contains("not asked for now: 1; they are kept in `points`"));
    assert!(!again("0.02,0.9").contains("not asked for now"));
}

#[test]
fn improvements_without_end_are_refused() {
    let folder = Folder::new();
    let out = folder.path("out");
    let race = ["race", RACE, "--starts", "2", "--controllers", "mppi", "--backend", "cpu"];
    let with = |sets: &[&'static str]| {
        let sets = sets.iter().flat_map(|set| ["--set", *set]);
        race.into_iter().chain(["--out", &out]).chain(sets).collect::<Vec<_>>()
    };
    let many = with(&["race.mppi.iterations=10000000"]);
    refused(&many, &["race.mppi.iterations", "10000000", "at most 1000"]);
    let sets = [
        "race.mppi.iterations=1000",
        "race.mppi.samples=1000000",
        "race.mppi.horizon=512",
        "race.steps=10000",
    ];
    refused(&with(&sets), &["steps of samples", "1.0e16", "1e16"]);
}

#[test]
fn a_control_without_width_is_fixed_and_an_infinite_one_is_named() {
    let spec = |bounds: [f32; 2]| {
        let mut settings = MppiSettings::new(&DroneRace::default().controls(), 8, 4);
        settings.sigma = Sigma::PerControl(vec![0.1; 3]);
        settings.bounds[1] = bounds;
        MppiSpec::new(settings).map(drop).map_err(|error| error.to_string())
    };
    assert_eq!(spec([0.0, 0.0]), Ok(()));
    assert!(spec([1.0, -1.0]).unwrap_err().contains("empty interval"));
    for bounds in [[f32::NEG_INFINITY, 1.0], [0.0, f32::INFINITY], [f32::NAN, 1.0]] {
        let message = spec(bounds).unwrap_err();
        assert!(message.contains("not finite") && !message.contains("empty"), "{message}");
    }
}

#[test]
fn a_certificate_of_an_unknown_plant_says_what_it_is() {
    for (config, words) in [
        (serde_json::json!("dubins"), "`dubins`"),
        (serde_json::json!({"system": {"name": "dubins"}}), "the system `dubins`"),
        (serde_json::json!(null), "a system without a name"),
    ] {
        let message = Config::from_json(&config).unwrap_err().to_string();
        let all = [words, "another program defines", "double-integrator", "can check it"];
        assert!(all.iter().all(|word| message.contains(word)), "{message}");
    }
}

/// A policy file with these tensors, `[out, in]` or `[out]` each.
fn policy(tensors: &[(&str, &[usize])]) -> Result<Mlp, String> {
    let zeros: Vec<Vec<u8>> =
        tensors.iter().map(|(_, shape)| vec![0; 4 * shape.iter().product::<usize>()]).collect();
    let views = tensors.iter().zip(&zeros).map(|((name, shape), bytes)| {
        (*name, TensorView::new(Dtype::F32, shape.to_vec(), bytes).unwrap())
    });
    let words = [("activation", "relu"), ("output", "tanh")];
    let words = words.map(|(key, word)| (key.to_owned(), word.to_owned()));
    let bytes = safetensors::serialize(views, Some(words.into_iter().collect())).unwrap();
    Mlp::from_bytes(&bytes)
}

#[test]
fn no_tensor_of_a_policy_file_is_left_out() {
    let whole: [(&str, &[usize]); 4] = [
        ("layers.0.weight", &[4, 2]),
        ("layers.0.bias", &[4]),
        ("layers.1.weight", &[1, 4]),
        ("layers.1.bias", &[1]),
    ];
    assert_eq!(policy(&whole).unwrap().widths(), [2, 4, 1]);
    let with = |name, shape| policy(&[&whole[..], &[(name, shape)]].concat()).unwrap_err();
    for (name, shape) in [("obs_mean", &[2][..]), ("layers.0.norm", &[4]), ("a", &[0]), ("", &[1])]
    {
        let message = with(name, shape);
        assert!(message.contains(&format!("tensor `{name}`")), "{message}");
    }
    assert!(with("layers.3.weight", &[1, 1]).contains("no `layers.2.weight`"));
    assert!(with("layers.2.bias", &[1]).contains("no `layers.2.weight`"));
    let mut gap = whole;
    (gap[2].0, gap[3].0) = ("layers.2.weight", "layers.2.bias");
    assert!(policy(&gap).unwrap_err().contains("no `layers.1.weight`"));
    let mut wide = whole;
    wide[1].1 = &[4, 1];
    assert!(policy(&wide).unwrap_err().contains("layers.0.bias has shape [4, 1], expected [4]"));
}

#[test]
fn answers_say_what_they_are_about() {
    let folder = Folder::new();
    let (states, out) = (folder.path("s.csv"), folder.path("out"));
    std::fs::write(&states, "velocity,position\n0.5,100000\n0.1,0.2\n").unwrap();
    let measures = folder.path("m.csv");
    let rollout = ["rollout", LINE, "--starts", &states, "--measures", &measures];
    let summary = document(&[&rollout[..], &["--backend", "cpu"]].concat());
    let notes = summary["notes"].as_array().unwrap();
    assert!(notes[0].as_str().unwrap().contains("only at the samples"), "{notes:?}");
    assert!(notes[1].as_str().unwrap().contains("position = 100000 m"), "{notes:?}");
    let certify = ["certify", LINE, "--set", "global.draws=500", "--backend", "cpu", "--out", &out];
    let record = document(&certify);
    let statements = record["statements"].to_string();
    assert!(statements.contains("only at the samples") && statements.contains("in a step"));
    assert_eq!(record["gamma"], 0.95);
    let text = serde_json::to_string(&record["provenance"]["config"]).unwrap();
    let long = |number: &&str| number.contains('.') && number.contains("00000");
    let mut numbers = text.split([':', ',', '[', ']', '{', '}']);
    assert_eq!(numbers.find(long), None, "a number of f32 as it was written: {text}");
    let answers = document(&["query", &out, "--states", &states, "--backend", "cpu"]);
    let rows = &answers["rows"];
    assert_eq!((&rows[0]["index"], &rows[1]["index"]), (&0.into(), &1.into()));
}

/// Costs of a million at each stage leave no differences in f32.
#[test]
fn plans_whose_weights_say_little_are_told() {
    let folder = Folder::new();
    let out = folder.path("out");
    let race = |more: &str| {
        let all = format!(
            "race {SMOKE} --starts 2 --controllers mppi --set race.steps=2 --backend cpu \
             --overwrite --out {out} {more}"
        );
        let all: Vec<&str> = all.split_whitespace().collect();
        document(&all)["notes"].to_string()
    };
    let plain = race("");
    assert!(plain.contains("only at the samples") && !plain.contains("mppi:"), "{plain}");
    let flat = race("--set race.mppi.temperature=1e9");
    assert!(flat.contains("of 500 samples are effective"), "{flat}");
    let drowned = race("--set race.mppi.cost.lane=1e12");
    assert!(drowned.contains("apart in f32"), "{drowned}");
    let page = std::fs::read_to_string(format!("{out}/report.html")).unwrap();
    assert!(page.contains("To be kept in mind") && page.contains("apart in f32"));
}

/// A configuration of the double integrator with these lines and settings; the refusal in words.
fn configured(lines: &str, sets: &[&str], profile: Option<Profile>) -> Result<Config, String> {
    let text = format!("system.name = 'double-integrator'\npolicy.formula = 'bang-bang'\n{lines}");
    let set = sets.iter().map(|set| (*set).to_owned()).collect();
    let overrides = Overrides { profile, set, ..Default::default() };
    let table = toml::from_str(&text).unwrap();
    Config::from_table(table, "mine.toml", &overrides).map_err(|error| error.to_string())
}

/// Keys of claims that are not asked for, and what would ask for them.
const UNREAD: [(&str, &str); 12] = [
    ("drops.pilot=50", "global.tightening=drops"),
    ("drops.epsilon=0.2", "global.tightening=drops"),
    ("calibration.discards=2", "global.tightening=drops"),
    ("global.risk=0.01", "global.tightening=drops"),
    ("global.share_draws=500", "global.tightening=drops"),
    ("deterministic.starts=50", "deterministic.kind=tube"),
    ("sequential.epsilon=0.2", "sequential.of=box"),
    ("sequential.radius=0.2", "sequential.of=ball"),
    ("growth.factor=1.5", "growth.method=upward"),
    ("growth.pilot=500", "growth.shape=box"),
    ("growth.split_beta=true", "growth.method=shrinking"),
    ("calibration.beta=0.01", "calibration.epsilon=0.2"),
];
/// None of these claims.
const NONE: [&str; 3] =
    ["global.tightening=lipschitz", "growth.method=shrinking", "growth.shape=ball"];

#[test]
fn keys_that_nothing_reads_are_refused() {
    for (key, switch) in UNREAD {
        let name = key.split('=').next().unwrap();
        let mut none = NONE.to_vec();
        match name {
            "growth.split_beta" => none[1] = "growth.method=upward",
            "growth.pilot" => none[1] = "growth.method=upward",
            "calibration.beta" => {
                none[0] = "global.tightening=drops";
                none.push("calibration.epsilon=1");
            }
            _ => {}
        }
        let refused = configured("", &[&none[..], &[key]].concat(), None).unwrap_err();
        let words =
            [&format!("--set {key}"), "nothing reads it", switch.split('=').next().unwrap()];
        assert!(words.iter().all(|word| refused.contains(word)), "{key}: {refused}");
        let read = configured("", &[&none[..], &[key, switch]].concat(), None);
        let config = read.unwrap_or_else(|error| panic!("{key}, {switch}: {error}"));
        // What is stored has every key, read or not.
        Config::from_json(&config.to_json().unwrap()).unwrap();
    }
    // What switches nothing on asks for no more than it says.
    for none in ["calibration.epsilon=1", "global.risk=1", "sequential.of=none"] {
        configured("", &[&NONE[..], &[none]].concat(), None).unwrap();
    }
}

#[test]
fn what_a_file_has_is_turned_off_by_name_alone() {
    let sequential = "sequential.epsilon = 0.2\n";
    let refused = configured(sequential, &[], None).unwrap_err();
    assert!(refused.contains("mine.toml: sequential.epsilon"), "{refused}");
    configured(sequential, &["sequential.of=set"], None).unwrap();
    configured(sequential, &["sequential.of=none"], None).unwrap();
    let drops = "profile = 'rigorous'\ndrops.pilot = 50\nglobal.tightening = 'drops'\n";
    configured(drops, &[], None).unwrap();
    configured(drops, &["global.tightening=lipschitz"], None).unwrap();
    let of_profile = "profile = 'study'\ndrops.pilot = 50\n";
    assert!(configured(of_profile, &[], None).is_err());
    configured(of_profile, &[], Some(Profile::Paper)).unwrap();
    let folder = Folder::new();
    let out = folder.path("out");
    let certify = ["certify", LINE, "--out", &out, "--set", "sequential.most=500"];
    crate::command::refused(
        &certify,
        &["--set sequential.most=500", "nothing reads it", "--sequential"],
    );
}
