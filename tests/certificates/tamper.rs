//! Edited by hand: certificates, field by field, and what `check` and `query` say about each; stored
//! races and points, and links that lead elsewhere.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use crate::command;
use std::fs;

use crate::command::{Folder, reachcast};
use crate::common::cpu;
use reachcast::Error;
use reachcast::backend::Program;
use reachcast::config::{Config, PolicySource};
use reachcast::files::{Data, npz_bytes, read_npz};
use reachcast::rollout::States;
use reachcast::scenario::record::Record;
use reachcast::scenario::{Unwatched, check, query};
use serde_json::{Value, json};

/// Few draws and rounds of a small system: a check takes a few milliseconds.
const QUICK: [&str; 6] = [
    "certify",
    "configs/double_integrator.toml",
    "--set=global.draws=1000",
    "--set=growth.scenarios=200",
    "--backend=cpu",
    "-q",
];

/// A certificate in a folder of its own.
fn certified() -> (Folder, String, Value) {
    let folder = Folder::new();
    let out = folder.path("out");
    let (code, _, message) = reachcast(&[&QUICK[..], &["--out", &out]].concat());
    assert!(matches!(code, Some(0 | 3)), "{message}");
    let text = fs::read_to_string(format!("{out}/certificate.json")).unwrap();
    let record = serde_json::from_str(&text).unwrap();
    (folder, out, record)
}

/// Where a value lies in a document: keys, and places in lists.
type Path = Vec<Value>;

fn at<'a>(document: &'a mut Value, path: &[Value]) -> &'a mut Value {
    path.iter().fold(document, |value, step| match step {
        Value::String(key) => &mut value[key.as_str()],
        place => &mut value[place.as_u64().unwrap() as usize],
    })
}

/// Every leaf, list and object below the digests; of long lists the first, a middle and the last.
fn places(value: &Value, path: &Path, found: &mut Vec<Path>) {
    let mut step = |inner: Value, below: &Value| {
        let mut path = path.clone();
        path.push(inner);
        found.push(path.clone());
        places(below, &path, found);
    };
    match value {
        Value::Object(fields) => {
            fields.iter().filter(|(key, _)| *key != "digests").for_each(|(k, v)| step(json!(k), v));
        }
        Value::Array(items) => {
            let mut some = vec![0, items.len() / 2, items.len().saturating_sub(1)];
            some.dedup();
            some.retain(|i| *i < items.len());
            some.into_iter().for_each(|i| step(json!(i), &items[i]));
        }
        _ => {}
    }
}

/// What a hand may do to the value at `path`; each with the edited document.
fn edits(document: &Value, path: &Path) -> Vec<(&'static str, Value)> {
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut edited = document.clone();
        change(at(&mut edited, path));
        edited
    };
    let (last, outer) = path.split_last().unwrap();
    let mut edits = match document.pointer(&pointer(path)).unwrap() {
        Value::Number(number) if number.is_u64() => {
            vec![("nudged", changed(&|v| *v = json!(v.as_u64().unwrap() + 1)))]
        }
        Value::Number(_) => vec![("nudged", changed(&|v| *v = json!(nudged(v.as_f64().unwrap()))))],
        Value::String(_) => {
            vec![("changed", changed(&|v| *v = json!(format!("{} ", v.as_str().unwrap()))))]
        }
        Value::Bool(_) => vec![("flipped", changed(&|v| *v = json!(!v.as_bool().unwrap())))],
        Value::Null => vec![("filled", changed(&|v| *v = json!(1)))],
        Value::Array(items) if items.is_empty() => {
            vec![("filled", changed(&|v| v.as_array_mut().unwrap().push(json!(1))))]
        }
        Value::Array(_) => vec![
            ("shortened", changed(&|v| _ = v.as_array_mut().unwrap().pop())),
            ("turned", changed(&|v| v.as_array_mut().unwrap().rotate_left(1))),
        ],
        Value::Object(_) => vec![("added to", changed(&|v| v["extra"] = json!(1)))],
    };
    if let Value::String(key) = last {
        let mut edited = document.clone();
        at(&mut edited, outer).as_object_mut().unwrap().shift_remove(key.as_str());
        edits.push(("removed", edited));
    }
    edits.retain(|(_, edited)| edited != document);
    edits
}

/// The next number, in the smallest step that a file shows.
fn nudged(value: f64) -> f64 {
    if value == 0.0 { 1e-300 } else { f64::from_bits(value.to_bits() + 1) }
}

fn pointer(path: &Path) -> String {
    path.iter()
        .map(|step| format!("/{}", step.as_str().map_or(step.to_string(), Into::into)))
        .collect()
}

/// The name of the field that holds the place: keys up to the first list.
fn field(path: &Path) -> String {
    let keys: Vec<&str> = path.iter().map_while(Value::as_str).collect();
    keys.join(".")
}

/// Every edit of every place, however small, is refused when the record is read, with its name.
#[test]
fn every_field_is_sealed() {
    let (_folder, _, record) = certified();
    Record::read(&record.to_string()).unwrap();
    let mut found = Vec::new();
    places(&record, &Vec::new(), &mut found);
    let mut count = 0;
    for path in &found {
        for (how, edited) in edits(&record, path) {
            let error = Record::read(&edited.to_string()).unwrap_err();
            assert!(matches!(error, Error::Refused(_)), "{error}");
            let (message, name) = (error.to_string(), field(path));
            assert!(message.contains(&name), "{name} {how}: {message}");
            count += 1;
        }
    }
    assert!(count > 500, "{count} edits");
    for path in record["digests"].as_object().unwrap().keys() {
        for digest in [None, Some("0".repeat(64))] {
            let mut edited = record.clone();
            let digests = edited["digests"].as_object_mut().unwrap();
            match digest {
                Some(digest) => _ = digests.insert(path.clone(), json!(digest)),
                None => _ = digests.shift_remove(path.as_str()),
            }
            let message = Record::read(&edited.to_string()).unwrap_err().to_string();
            assert!(message.contains(path.as_str()), "{path}: {message}");
        }
    }
}

/// From outside, of each field one edit; nothing is rolled out for it.
#[test]
fn check_and_query_name_the_field() {
    let (folder, out, record) = certified();
    let states = folder.path("states.csv");
    fs::write(&states, "0.5,0.1\n").unwrap();
    let path = format!("{out}/certificate.json");
    let says = |command: &str| match command {
        "check" => reachcast(&["check", &out, "--backend=cpu"]),
        _ => reachcast(&["query", &out, "--states", &states, "--backend=cpu"]),
    };
    for command in ["check", "query"] {
        let (code, output, message) = says(command);
        assert_eq!(code, Some(0), "{command}: {message}{output}");
    }
    let mut found = Vec::new();
    places(&record, &Vec::new(), &mut found);
    found.retain(|path| path.iter().all(Value::is_string));
    for place in found {
        let Some((how, edited)) = edits(&record, &place).into_iter().next() else { continue };
        fs::write(&path, edited.to_string()).unwrap();
        for command in ["check", "query"] {
            let (code, output, message) = says(command);
            let name = field(&place);
            assert_eq!((code, output.as_str()), (Some(2), ""), "{command}, {name} {how}");
            for word in [name.as_str(), "certificate.json", "refused"] {
                assert!(message.contains(word), "{command}, {name} {how}: {message}");
            }
        }
    }
}

/// Files beside the certificate that say something else.
#[test]
fn edited_files_beside_the_certificate_are_noticed() {
    let (_folder, out, _) = certified();
    for name in ["slice.npy", "deviation.csv", "counterexamples.csv", "report.html"] {
        let path = format!("{out}/{name}");
        let whole = fs::read(&path).unwrap();
        let mut edited = whole.clone();
        *edited.last_mut().unwrap() ^= 1;
        fs::write(&path, &edited).unwrap();
        let (code, output, message) = reachcast(&["check", &out, "--backend=cpu"]);
        assert_eq!(code, Some(3), "{name}: {message}{output}");
        assert!(output.contains(&format!("FAILS {name}")), "{output}");
        fs::write(&path, whole).unwrap();
    }
    assert_eq!(reachcast(&["check", &out, "--backend=cpu"]).0, Some(0));
}

/// What `check` and `query` object to in a record whose digests were made to fit an edit; none where
/// they do not.
fn verdict(
    config: &Config,
    program: &Program<'_>,
    record: &Value,
) -> reachcast::Result<[Option<String>; 2]> {
    let record: Record = serde_json::from_value(record.clone()).unwrap();
    let states = &program.plant().model.states;
    let settings = config.settings(states)?;
    let checked = match check(program, &record, &settings, 7, &Unwatched) {
        Ok(report) if report.holds => None,
        Ok(report) => {
            let failed = report.findings.iter().filter(|finding| !finding.holds);
            Some(failed.map(|f| format!("{}: {}\n", f.name, f.found)).collect())
        }
        Err(error) => Some(error.to_string()),
    };
    let state = vec![0.5; states.len()];
    let queried = query(program, &record, &settings, States::one(&state));
    Ok([checked, queried.err().map(|error| error.to_string())])
}

/// What only rollouts can tell, so that `query` takes it from the record as it is.
const ROLLED_OUT: [&str; 39] = [
    "constants.region",
    "deviation.bound",
    "deviation.largest",
    "deviation.scale",
    "deviation.support",
    "deviation.non_finite",
    "drops.target_shape",
    "drops.constraint_shape",
    "drops.level",
    "drops.largest",
    "drops.widest",
    "drops.non_finite",
    "drops.by_constants",
    "sequence.pilot",
    "sequence.levels",
    "calibration.level",
    "calibration.failing",
    "growth.around",
    "global.accepted",
    "global.claim.failures",
    "global.reached",
    "global.non_finite",
    "global.f32_error",
    "global.f32_apart",
    "global.f64_reruns",
    "whole_box.failures",
    "whole_box.non_finite",
    "whole_box.f64_reruns",
    "whole_box.starts",
    "whole_box.pairs",
    "state.check_margin",
    "slice.check_margin",
    "growth.center",
    "growth.rounds",
    "growth.samples",
    "picture",
    "timing",
    "provenance.config",
    "digests",
];
/// What a run on another machine changes too.
const FREE: [&str; 5] =
    ["timing", "digests", "provenance.backend", "provenance.device", "provenance.version"];

/// Whoever edits a field and its digest meets what follows from the other fields, and in `check` the
/// whole certificate computed again.
#[test]
fn forged_digests_do_not_help() {
    let (_folder, _, record) = certified();
    let config = Config::from_json(&record["provenance"]["config"]).unwrap();
    let formula = PolicySource::Formula("bang-bang".to_owned());
    let backend = cpu(1);
    let program = backend.prepare(&config.plant(&formula).unwrap()).unwrap();
    let verdict = |document: &Value| verdict(&config, &program, document);
    assert_eq!(verdict(&record).unwrap(), [None, None]);
    let under = |name: &str, names: &[&str]| {
        names.iter().any(|outer| {
            name.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        })
    };
    let mut found = Vec::new();
    places(&record, &Vec::new(), &mut found);
    let original: Record = serde_json::from_value(record.clone()).unwrap();
    let (mut counts, mut taken) = ([0; 3], Vec::new());
    for path in found {
        let name = field(&path);
        if under(&name, &FREE) || under(&name, &["provenance.config", "schema"]) {
            continue;
        }
        for (how, mut edited) in edits(&record, &path) {
            let value = at(&mut edited, &path[..path.len() - 1]);
            let inner = path.last().unwrap();
            // Single precision does not show the smallest step of a number in double precision.
            if how == "nudged" && record.pointer(&pointer(&path)).unwrap().is_f64() {
                let place = match inner {
                    Value::String(key) => &mut value[key.as_str()],
                    i => &mut value[i.as_u64().unwrap() as usize],
                };
                *place = json!(place.as_f64().unwrap() * 1.001 + 1e-4);
            }
            // One that does not parse, or says the same, is nothing to check.
            match serde_json::from_value::<Record>(edited.clone()) {
                Ok(other) if other != original => {}
                _ => continue,
            }
            let [checked, queried] = verdict(&edited)
                .unwrap_or_else(|error| [Some(error.to_string()), Some(error.to_string())]);
            let checked = checked.unwrap_or_else(|| panic!("check takes {name} {how}"));
            let last = path.last().unwrap().as_str().unwrap_or(&name).to_owned();
            println!("{name} {how}: {checked}");
            counts[0] += 1;
            counts[1] += usize::from(checked.contains(&last) || checked.contains(&name));
            match queried {
                Some(_) => counts[2] += 1,
                None if under(&name, &ROLLED_OUT) => {}
                None => taken.push(format!("{name} {how}")),
            }
        }
    }
    assert!(taken.is_empty(), "query takes {taken:?}");
    println!("{counts:?}: edits, named by check, refused by query");
    assert!(counts[0] > 200 && counts[1] == counts[0] && counts[2] > 100, "{counts:?}");
}

/// A race and a sweep, small.
fn raced(folder: &Folder) -> (Vec<String>, String) {
    let out = folder.path("race");
    let words = "race configs/smoke.toml --backend cpu -q --starts 3 --set race.steps=12 \
                 --set race.mppi.samples=16 --set race.soft.samples=16 --controllers mppi,mppi-soft";
    let mut arguments: Vec<String> = words.split_whitespace().map(str::to_owned).collect();
    arguments.extend(["--out".to_owned(), out.clone()]);
    (arguments, out)
}

/// Runs and expects a refusal that names the file and the remedy.
fn refuses(arguments: &[String], words: &[&str]) {
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    command::refused(&arguments, words);
}

#[test]
fn logs_of_races_that_were_edited_or_swapped_are_noticed() {
    let folder = Folder::new();
    let (arguments, out) = raced(&folder);
    let run = || command::done(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    run();
    let results = || fs::read(format!("{out}/results.json")).unwrap();
    let before = results();
    let [one, other] =
        ["mppi", "mppi-soft"].map(|name| format!("{out}/races/{name}-seed1-from0.npz"));
    let whole = fs::read(&one).unwrap();
    let remedy = "remove the file, and the races are flown again";
    // The same starts, steps and shapes, of another controller.
    fs::copy(&other, &one).unwrap();
    refuses(&arguments, &["mppi-seed1-from0.npz", "of another controller", remedy]);
    // Each array in turn: one number, checksums and all.
    let arrays = read_npz(std::path::Path::new(&other)).unwrap();
    fs::write(&one, &whole).unwrap();
    let arrays_of = |name: &str| read_npz(std::path::Path::new(name)).unwrap();
    for name in arrays.keys().filter(|name| *name != "steps") {
        let mut edited = arrays_of(&one);
        match &mut edited.get_mut(name).unwrap().data {
            Data::F32(values) => values[20] = if values[20] == 0.5 { 0.25 } else { 0.5 },
            Data::F64(values) => values[7] += 1e-9,
            Data::U8(values) => values[3] = if values[3] == 0 { 1 } else { 0 },
            Data::U32(values) => values[3] += 1,
            Data::U64(values) => values[3] += 1,
        }
        let edited: Vec<_> =
            edited.iter().map(|(name, array)| (name.as_str(), array.clone())).collect();
        let path = format!("{out}/races/mppi-seed1-from0.npz");
        fs::write(&path, npz_bytes(&edited).unwrap()).unwrap();
        refuses(&arguments, &["mppi-seed1-from0.npz", "edited", remedy]);
        fs::write(&path, &whole).unwrap();
    }
    // The remedy works.
    fs::remove_file(&one).unwrap();
    run();
    assert!(results() == before);
}

#[test]
fn points_of_a_sweep_that_were_edited_are_noticed() {
    let folder = Folder::new();
    let out = folder.path("sweep");
    let words =
        "sweep configs/smoke.toml --backend cpu -q --starts 2 --set race.steps=8 --samples 8,16";
    let mut arguments: Vec<String> = words.split_whitespace().map(str::to_owned).collect();
    arguments.extend(["--out".to_owned(), out.clone()]);
    command::done(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let points: Vec<_> =
        fs::read_dir(format!("{out}/points")).unwrap().map(|e| e.unwrap()).collect();
    let path = points[0].path();
    let text = fs::read_to_string(&path).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    let mut found = Vec::new();
    places(&document, &Vec::new(), &mut found);
    let name = points[0].file_name().into_string().unwrap();
    let mut count = 0;
    for place in found {
        for (how, edited) in edits(&document, &place) {
            // An entry that is missing says the same as one that is null; unknown ones are not read.
            let says_more =
                how == "added to" || document.pointer(&pointer(&place)).unwrap().is_null();
            if says_more && how != "filled" {
                continue;
            }
            fs::write(&path, edited.to_string()).unwrap();
            refuses(&arguments, &[&name, "remove the file, and the point is computed again"]);
            count += 1;
        }
    }
    assert!(count > 60, "{count} edits");
    fs::write(&path, text).unwrap();
    command::done(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
}

/// Folders within the folder of the results that lead elsewhere.
#[test]
#[cfg(unix)]
fn links_out_of_the_folder_are_refused() {
    let folder = Folder::new();
    let elsewhere = folder.path("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let (arguments, out) = raced(&folder);
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let races = format!("{out}/races");
    fs::create_dir(&out).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &races).unwrap();
    refuses(&arguments, &["race/races", "something else is here"]);
    fs::remove_file(&races).unwrap();
    // In a folder that says it holds this work already.
    command::done(&words);
    fs::rename(&races, folder.path("moved")).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &races).unwrap();
    refuses(&arguments, &["race/races", "a link", "remove it"]);
    fs::remove_file(&races).unwrap();
    // A link in the place of a file is replaced, not followed.
    let mine = folder.path("elsewhere/mine.json");
    fs::write(&mine, "mine").unwrap();
    fs::remove_file(format!("{out}/results.json")).unwrap();
    std::os::unix::fs::symlink(&mine, format!("{out}/results.json")).unwrap();
    command::done(&words);
    assert_eq!(fs::read(&mine).unwrap(), b"mine");
    assert!(!fs::symlink_metadata(format!("{out}/results.json")).unwrap().is_symlink());
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), 1);
}
