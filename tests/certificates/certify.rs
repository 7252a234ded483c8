//! `certify`, `query` and `check` end to end on the CPU: files, exit codes, determinism, Ctrl-C.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::path::Path;
use std::process::{Command, Output};

use reachcast::scenario::record::Record;
use serde_json::Value;

/// The program with these arguments, in the repository's folder, on the CPU.
fn reachcast(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reachcast"));
    command.args(arguments).args(["--backend", "cpu"]).current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Certifies into `out`; the certificate that is printed.
fn certify(config: &str, out: &Path, more: &[&str]) -> Value {
    let out = out.to_str().unwrap();
    let output = reachcast(&[&["certify", config, "--json", "--out", out], more].concat());
    assert_eq!(text(&output.stderr), "");
    let record: Value = serde_json::from_slice(&output.stdout).unwrap();
    // 3 where a claim was not obtained.
    let expected = if record["holds"].as_bool().unwrap() { 0 } else { 3 };
    assert_eq!(output.status.code(), Some(expected));
    record
}

/// The certificate stored in `folder`.
fn stored(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("certificate.json")).unwrap()).unwrap()
}

/// `record` without the part that a second run may change, and its digests.
fn untimed(mut record: Value) -> Value {
    record.as_object_mut().unwrap().shift_remove("timing").unwrap();
    let digests = record["digests"].as_object_mut().unwrap();
    digests.retain(|path, _| !path.starts_with("timing."));
    record
}

/// `record` with digests that fit.
fn sealed(record: &Value) -> Value {
    let record: Record = serde_json::from_str(&record.to_string()).unwrap();
    // By way of the text, in which an f32 is short.
    let text = serde_json::to_string(&record.sealed().unwrap()).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Sorted names of the files in `folder`.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name();
    let mut names: Vec<_> = entries.map(|e| name(e).into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_certificate_is_written_queried_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("race");
    let record = certify("configs/smoke.toml", &out, &[]);
    assert_eq!(record, stored(&out));
    let files = [
        "certificate.json",
        "counterexamples.csv",
        "deviation.csv",
        "experiment.json",
        "policy.safetensors",
        "report.html",
        "slice.npy",
    ];
    assert_eq!(names(&out), files);
    let config = &record["provenance"]["config"];
    // Defaults are filled in.
    assert_eq!(config["deviation"]["joint"], "fixed-shape");
    let report = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("confidence"), "{report}");

    let bytes = std::fs::read(out.join("slice.npy")).unwrap();
    let slice = npyz::NpyFile::new(bytes.as_slice()).unwrap();
    assert_eq!(slice.shape(), [13, 6]);
    let margins: Vec<Value> =
        slice.into_vec::<f32>().unwrap().into_iter().map(Value::from).collect();
    let recorded = record["slice"]["check_margin"].as_array().unwrap();
    let same = |(a, b): (&Value, &Value)| a.as_f64().unwrap() as f32 == b.as_f64().unwrap() as f32;
    assert!(recorded.len() == 78 && recorded.iter().zip(&margins).all(same));

    let table = std::fs::read_to_string(out.join("deviation.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!((lines[0], lines.len()), ("step,bound,largest,exact", 32));
    let last: Vec<f64> = lines[31].split(',').map(|field| field.parse().unwrap()).collect();
    assert_eq!(last[0], 30.0);
    assert_eq!(last[1], record["deviation"]["bound"][30].as_f64().unwrap());

    // The state itself is of the tier that the certificate says.
    let x: Vec<String> = record["state"]["x"]
        .as_array()
        .unwrap()
        .iter()
        .map(|value| (value.as_f64().unwrap() as f32).to_string())
        .collect();
    let states = folder.path().join("states.csv");
    std::fs::write(&states, x.join(",") + "\n").unwrap();
    let (dir, states) = (out.to_str().unwrap(), states.to_str().unwrap());
    let output = reachcast(&["query", dir, "--states", states, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let rows: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(rows["rows"][0]["tier"], record["state"]["tier"]);
    let plain = text(&reachcast(&["query", dir, "--states", states]).stdout);
    assert!(
        plain.starts_with("index,tier,check_margin,target_margin,score,measure,calibrated\n0,"),
        "{plain}"
    );
    let answers = folder.path().join("answers");
    let output = reachcast(&["query", dir, "--states", states, "--out", answers.to_str().unwrap()]);
    assert!(text(&output.stdout).contains("tier 0 (in the target)"));
    assert_eq!(std::fs::read_to_string(answers.join("query.csv")).unwrap(), plain);

    let output = reachcast(&["check", dir]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    assert!(text(&output.stdout).contains("the certificate holds"));
}

#[test]
fn the_same_seed_gives_the_same_certificate() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        untimed(certify("configs/smoke.toml", &out, more))
    };
    let one = run("one", &["--threads", "1"]);
    let two = run("two", &["--threads", "2"]);
    assert_eq!(one, two);
    let other = run("other", &["--seed", "2"]);
    assert_ne!(one["deviation"]["largest"], other["deviation"]["largest"]);
}

#[test]
fn a_formula_needs_no_policy_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("line");
    let record = certify("configs/double_integrator.toml", &out, &[]);
    assert_eq!(record["provenance"]["policy"], "bang-bang");
    assert!(!names(&out).contains(&"policy.safetensors".to_owned()));
    let output = reachcast(&["check", out.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["holds"], true);
    // Numbers are numbers, on both sides.
    let finding = |name: &str| -> [Value; 2] {
        let all = found["findings"].as_array().unwrap().iter();
        let one = all.clone().find(|finding| finding["name"].as_str().unwrap().contains(name));
        ["stored", "found"].map(|side| one.unwrap()[side].clone())
    };
    assert!(finding("certified starts").iter().all(Value::is_u64));
    for name in ["constant of the target", "deviation bound", "radius of the verified ball"] {
        assert!(finding(name).iter().all(Value::is_f64), "{name}: {:?}", finding(name));
    }
    assert!(finding("conditional failure on fresh")[0]["at_most"].is_f64());
    assert!(finding("conditional failure on fresh")[1]["failures"].is_u64());
    assert!(finding("certified share on fresh")[1][0].is_f64());
    assert_eq!(finding("all claims obtained"), [true, true].map(Value::from));
}

#[test]
fn certificates_that_are_not_theirs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("race");
    let record = certify("configs/smoke.toml", &out, &[]);
    let (path, dir) = (out.join("certificate.json"), out.to_str().unwrap());
    let check = |words: &[&str], code: i32| {
        let output = reachcast(&["check", dir]);
        let said = text(&output.stderr) + &text(&output.stdout);
        assert_eq!(output.status.code(), Some(code), "{said}");
        for word in words {
            assert!(said.contains(word), "no `{word}` in: {said}");
        }
    };
    let store = |record: &Value| std::fs::write(&path, record.to_string()).unwrap();

    // Edited by hand: `tests/certificates/tamper.rs` goes through every field.
    let mut bold = record.clone();
    bold["global"]["accepted"] = (record["global"]["accepted"].as_u64().unwrap() + 500).into();
    store(&bold);
    check(&["refused", "`global.accepted` was changed"], 2);
    // With digests that fit, a certificate that claims more than its scenarios showed.
    store(&sealed(&bold));
    check(&["FAILS certified starts", "no longer holds"], 3);

    let mut other = record.clone();
    other["provenance"]["config"]["system"]["ego_gain"] = 0.6.into();
    store(&sealed(&other));
    check(&["refused", "physics_sha256"], 2);
    other["schema"] = 99.into();
    store(&other);
    check(&["refused", "schema is 99"], 2);
    std::fs::write(&path, "{\"schema\": 1, \"holds\"").unwrap();
    check(&["certificate.json", "not a certificate"], 2);
    std::fs::write(&path, "{\"schema\": 1}").unwrap();
    check(&["certificate.json", "damaged certificate"], 2);

    store(&record);
    let policy = out.join("policy.safetensors");
    let mut bytes = std::fs::read(&policy).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&policy, &bytes).unwrap();
    check(&["refused", "policy_sha256"], 2);
    std::fs::remove_file(&policy).unwrap();
    check(&["policy.safetensors", "No such file"], 2);
    std::fs::remove_file(&path).unwrap();
    check(&["certificate.json", "No such file"], 2);
    let output = reachcast(&["check", dir, "--seed", "3"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--seed"), "{}", text(&output.stderr));
}

/// Ctrl-C in the middle of the work: exit code 1, the old result whole, nothing beside it.
#[test]
#[cfg(target_os = "linux")]
fn an_interrupted_run_leaves_the_old_result() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("race");
    certify("configs/smoke.toml", &out, &[]);
    let before: Vec<_> = names(&out)
        .into_iter()
        .map(|name| (std::fs::read(out.join(&name)).unwrap(), name))
        .collect();
    // Hours of work.
    let draws = ["certify", "configs/smoke.toml", "--set", "global.draws=100000000000", "--out"];
    let run = command(&[&draws[..], &[out.to_str().unwrap(), "--overwrite"]].concat())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", run.id());
    // Until the program handles SIGINT, number 2: the second bit of the mask of caught signals.
    let catches = |status: &str| {
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        u64::from_str_radix(mask.trim(), 16).unwrap() & 2 != 0
    };
    while !catches(&std::fs::read_to_string(&status).unwrap()) {
        std::thread::yield_now();
    }
    let kill = Command::new("kill").args(["-INT", &run.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = run.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("interrupted"), "{}", text(&output.stderr));
    let after: Vec<_> = names(&out)
        .into_iter()
        .map(|name| (std::fs::read(out.join(&name)).unwrap(), name))
        .collect();
    assert!(before == after, "{:?}", names(&out));
}
