//! Nothing is lost: outputs spare inputs and the results of others, and every refusal names them.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::command::{Folder, done, refused};

const RACE: &str = "configs/race.toml";
const SMOKE: &str = "configs/smoke.toml";
const LINE: &str = "configs/double_integrator.toml";
const POLICY: &str = "configs/policies/race_policy.safetensors";
const GRAPH: &str = "tests/fixtures/checkpoints/silu.onnx";
const CPU: [&str; 3] = ["--backend", "cpu", "-q"];

/// The files below `folder` with their content.
fn content(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(content(&path));
        } else {
            found.insert(path.display().to_string(), fs::read(&path).unwrap());
        }
    }
    found
}

/// Runs and expects a refusal with `words` that leaves everything below `folder` as it was.
fn keeps(folder: &Path, arguments: &[&str], words: &[&str]) {
    let before = content(folder);
    let cpu = if arguments.contains(&"--backend") { &[][..] } else { &CPU };
    refused(&[arguments, cpu].concat(), words);
    assert_eq!(content(folder), before, "{arguments:?}");
}

/// A configuration of the smoke test with its policy in `folder`; its path.
fn own_config(folder: &Path) -> String {
    fs::copy(POLICY, folder.join("policy.safetensors")).unwrap();
    let text = fs::read_to_string(SMOKE).unwrap();
    let text = text.replace("policies/race_policy.safetensors", "policy.safetensors");
    assert!(text.contains("\"policy.safetensors\""));
    let path = folder.join("config.toml");
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn an_output_is_never_an_input() {
    let folder = Folder::new();
    let at = |name: &str| folder.path(name);
    fs::write(at("s.csv"), "0.1,0.2\n0.3,0.4\n").unwrap();
    fs::write(at("c.csv"), fs::read(LINE).unwrap()).unwrap();
    fs::hard_link(at("s.csv"), at("hard.csv")).unwrap();
    std::os::unix::fs::symlink(at("s.csv"), at("link.csv")).unwrap();
    fs::create_dir(at("inner")).unwrap();
    let dotted = at("inner/../s.csv");
    let root = at("");
    let root = Path::new(&root);
    for measures in [&at("s.csv"), &at("hard.csv"), &at("link.csv"), &dotted] {
        let rollout = ["rollout", LINE, "--starts", &at("s.csv"), "--measures", measures];
        keeps(root, &rollout, &["input", "s.csv"]);
        // Not even where results may be replaced.
        keeps(root, &[&rollout[..], &["--overwrite"]].concat(), &["input", "s.csv"]);
    }
    let rollout = ["rollout", &at("c.csv"), "--starts", &at("s.csv"), "--measures", &at("c.csv")];
    keeps(root, &rollout, &["input", "c.csv"]);
    // A policy imported over its own source.
    fs::copy(GRAPH, at("x.safetensors")).unwrap();
    let import = ["policy", "import", &at("x.safetensors"), "--out", &at("x.safetensors")];
    keeps(root, &import, &["input", "x.safetensors"]);
}

#[test]
fn a_folder_with_an_input_in_it_is_no_place_for_results() {
    let folder = Folder::new();
    let root = folder.path("");
    let root = Path::new(&root);
    fs::create_dir(folder.path("mine")).unwrap();
    let mine = folder.path("mine");
    let config = own_config(Path::new(&mine));
    fs::write(folder.path("mine/starts.csv"), fs::read("configs/race_starts_500.csv").unwrap())
        .unwrap();
    let starts = folder.path("mine/starts.csv");
    std::os::unix::fs::symlink(&mine, folder.path("way")).unwrap();
    for out in [&mine, &folder.path(""), &folder.path("way"), &folder.path("mine/../mine")] {
        for overwrite in [&[][..], &["--overwrite"]] {
            let more = [&["--out", out.as_str()], overwrite].concat();
            keeps(root, &[&["certify", &config][..], &more].concat(), &["input", "config.toml"]);
            let race = ["race", RACE, "--starts", &starts, "--controllers", "policy"];
            keeps(root, &[&race[..], &more].concat(), &["input", "starts.csv"]);
            let sweep = ["sweep", RACE, "--starts", &starts, "--samples", "8,16"];
            keeps(root, &[&sweep[..], &more].concat(), &["input", "starts.csv"]);
            let of = ["sweep", &config, "--of", "certificate", "--epsilon", "0.1,0.2"];
            keeps(root, &[&of[..], &more].concat(), &["input", "config.toml"]);
            keeps(root, &[&["train", &config][..], &more].concat(), &["input", "config.toml"]);
        }
    }
}

#[test]
fn a_certificate_spares_what_is_in_its_folder() {
    let folder = Folder::new();
    let out = folder.path("out");
    let root = Path::new(&out);
    let certify = ["certify", SMOKE, "--out", &out];
    fs::create_dir(&out).unwrap();
    for name in ["policy.safetensors", "report.html", "slice.npy", "sweep.csv", "train.json"] {
        fs::write(root.join(name), "mine").unwrap();
        keeps(root, &certify, &["out", name, "--out", "--overwrite"]);
        fs::remove_file(root.join(name)).unwrap();
    }
    fs::write(root.join("notes.txt"), "mine").unwrap();
    done(&[&certify[..], &CPU].concat());
    let first = content(root);
    // A run that repeats it may replace its own, and another may not.
    done(&[&certify[..], &CPU].concat());
    assert_eq!(content(root).len(), first.len());
    for more in [["--seed", "2"], ["--set", "global.draws=1999"], ["--profile", "study"]] {
        let other = [&certify[..], &more].concat();
        keeps(root, &other, &["experiment.json", "a certificate", "--overwrite"]);
    }
    for other in [
        vec!["race", SMOKE, "--starts", "2", "--controllers", "policy", "--out", &out],
        vec!["sweep", SMOKE, "--starts", "2", "--samples", "8,16", "--out", &out],
    ] {
        keeps(root, &other, &["experiment.json", "a certificate", "--overwrite"]);
    }
    done(&[&certify[..], &CPU, &["--seed", "2", "--overwrite"]].concat());
    let second = content(root);
    assert_ne!(second, first);
    assert_eq!(fs::read(root.join("notes.txt")).unwrap(), b"mine");
}

#[test]
fn races_and_sweeps_make_way_when_they_are_told_to() {
    let folder = Folder::new();
    let out = folder.path("out");
    let root = Path::new(&out);
    let race = ["race", SMOKE, "--set", "race.steps=3", "--controllers", "policy", "--out", &out];
    let race = |starts| [&race[..], &["--starts", starts]].concat();
    done(&[&race("2")[..], &CPU].concat());
    assert!(root.join("races").is_dir());
    let sweep = ["sweep", SMOKE, "--set", "race.steps=3", "--starts", "2", "--samples", "8,16"];
    let sweep = [&sweep[..], &["--out", &out]].concat();
    keeps(root, &race("3"), &["another experiment", "races", "--overwrite"]);
    keeps(root, &sweep, &["another experiment", "races", "--overwrite"]);
    done(&[&race("3")[..], &CPU, &["--overwrite"]].concat());
    done(&[&sweep[..], &CPU, &["--overwrite"]].concat());
    assert!(root.join("points").is_dir() && !root.join("races").exists());
    assert!(!root.join("results.json").exists());
    // The same sweep goes on, asked to overwrite or not.
    let points = content(&root.join("points"));
    done(&[&sweep[..], &CPU, &["--overwrite"]].concat());
    assert_eq!(content(&root.join("points")), points);
    let certify = ["certify", SMOKE, "--out", &out, "--overwrite"];
    done(&[&certify[..], &CPU].concat());
    let mut names: Vec<String> =
        content(root).keys().map(|name| name.rsplit('/').next().unwrap().to_owned()).collect();
    names.sort();
    let expected = [
        "certificate.json",
        "counterexamples.csv",
        "deviation.csv",
        "experiment.json",
        "policy.safetensors",
        "report.html",
        "slice.npy",
    ];
    assert_eq!(names, expected);
}

#[test]
fn files_that_were_named_are_replaced_when_that_is_asked_for() {
    let folder = Folder::new();
    let root = folder.path("");
    let root = Path::new(&root);
    fs::write(folder.path("s.csv"), "0.1,0.2\n0.3,0.4\n").unwrap();
    let (starts, measures) = (folder.path("s.csv"), folder.path("m.csv"));
    fs::write(&measures, "notes").unwrap();
    let rollout = ["rollout", LINE, "--starts", &starts, "--measures", &measures];
    keeps(root, &rollout, &["m.csv", "--overwrite"]);
    done(&[&rollout[..], &CPU, &["--overwrite"]].concat());
    assert!(fs::read_to_string(&measures).unwrap().starts_with("measure\n"));
    // An import that comes to the same file again replaces nothing.
    let policy = folder.path("p.safetensors");
    let import = ["policy", "import", GRAPH, "--out", &policy];
    done(&import);
    done(&import);
    let names = ["--state-order", "a,b,c,d,e,f,g,h,i,j,k,l"];
    let other = [&import[..], &names].concat();
    keeps(root, &other, &["p.safetensors", "--overwrite"]);
    done(&[&other[..], &["--overwrite"]].concat());
    // Answers of a query, and records of a benchmark.
    let out = folder.path("out");
    done(&[&["certify", LINE, "--set", "global.draws=500", "--out", &out][..], &CPU].concat());
    let query = ["query", &out, "--states", &starts, "--out", &out];
    done(&[&query[..], &CPU].concat());
    done(&[&query[..], &CPU].concat());
    fs::write(folder.path("s.csv"), "0.1,0.2\n").unwrap();
    keeps(root, &query, &["query.csv", "--overwrite"]);
    done(&[&query[..], &CPU, &["--overwrite"]].concat());
    let states = folder.path("out/query.csv");
    keeps(root, &["query", &out, "--states", &states, "--out", &out], &["input", "query.csv"]);
    fs::write(folder.path("bench.json"), "mine").unwrap();
    let bench = ["bench", "--quick", "--workload", "none", "--out", root.to_str().unwrap()];
    keeps(root, &bench, &["bench.json", "--overwrite"]);
}

/// A limit on the size of files is met by a message, and what was there stays.
#[test]
fn a_limit_on_files_is_told() {
    let folder = Folder::new();
    let starts = folder.path("s.csv");
    fs::write(&starts, "0.1,0.2\n".repeat(40_000)).unwrap();
    let limited = |command: &str| {
        let script = format!("ulimit -f 64; exec {} {command}", env!("CARGO_BIN_EXE_reachcast"));
        let mut shell = Command::new("sh");
        let output =
            shell.args(["-c", &script]).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{command}: {message}");
        assert!(message.contains("ulimit -f"), "{message}");
    };
    let measures = folder.path("m.npy");
    limited(&format!("rollout {LINE} --backend cpu --starts {starts} --measures {measures}"));
    let out = folder.path("out");
    limited(&format!("certify {SMOKE} --backend cpu --out {out}"));
    assert!(!Path::new(&measures).exists());
    assert!(!Path::new(&out).exists());
}

/// The first interruption ends the work at the next chance, the second the program at once.
#[test]
fn a_second_interrupt_stops_at_once() {
    let folder = Folder::new();
    let out = folder.path("out");
    let send = |signal: &str, id: u32| {
        let id = id.to_string();
        assert!(Command::new("kill").args([signal, &id]).status().unwrap().success());
    };
    // The work may look up between the two: a few attempts.
    let stopped = (0..5).any(|_| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_reachcast"))
            .args(["certify", SMOKE, "--backend", "cpu", "--threads", "1", "--out", &out])
            .args(["--set", "global.draws=100000000"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(1000));
        // Both are there when it goes on.
        for signal in ["-STOP", "-INT", "-TERM", "-CONT"] {
            send(signal, child.id());
        }
        let code = child.wait().unwrap().code();
        let mut message = String::new();
        child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        assert_eq!(code, Some(1), "{message}");
        assert!(message.contains("again to stop at once"), "{message}");
        message.contains("stopped at once")
    });
    assert!(stopped);
    let left = fs::read_dir(&out).map_or(0, |entries| {
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| !name.ends_with(".part")).count()
    });
    assert_eq!(left, 0);
}
