//! Numbers that JSON has no word for: certificates of open bounds, of margins that are NaN at the
//! state and in the slice, from `certify` through `query` and `check`; the numbers of every record.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

mod command;
mod races;
mod records;
mod sweeps;

use std::fs;

use command::{Folder, document, done, reachcast};
use reachcast::bench::record::WorkloadRecord;
use reachcast::digest::sha256;
use reachcast::report::html;
use reachcast::scenario::record::Record;
use reachcast::train::record::CurvePoint;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

/// A model with what the tests change: bounds of its control, target and state.
fn model(bounds: &str, target: &str, state: &str) -> String {
    format!(
        "[model]\nname = \"line\"\n\
         [model.states]\nx = {{ box = [-1, 1] }}\ny = {{ box = [-1, 1] }}\n\
         [model.controls]\nu = {{ bounds = {bounds} }}\n\
         [model.next]\nx = \"x + 0.1 * u\"\ny = \"y\"\n\
         [model.task]\nkind = \"reach-avoid\"\ntarget = \"{target}\"\nconstraint = \"1\"\n\
         [policy]\nformula = {{ u = \"-x\" }}\n\
         [constants]\ntarget = 2.0\n\
         [state]\n{state}\n\
         [rollout]\nhorizon = 10\n\
         [global]\ndraws = 1000\n\
         [deviation]\npilot = 100\n"
    )
}

/// Certifies `model` on the CPU into `out`; the certificate.
fn certified(folder: &Folder, model: &str) -> (Value, String) {
    let (file, out) = (folder.path("model.toml"), folder.path("out"));
    fs::write(&file, model).unwrap();
    let arguments = ["certify", &file, "--backend", "cpu", "--out", &out, "-q"];
    let (code, _, message) = reachcast(&arguments);
    assert!(matches!(code, Some(0 | 3)), "{message}");
    (stored(&out), out)
}

fn stored(out: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(format!("{out}/certificate.json")).unwrap()).unwrap()
}

/// What `query` says of the state (`x`, 0.25) under the certificate in `out`, which `check` confirms.
fn asked(folder: &Folder, out: &str, x: f64) -> Value {
    let checked = done(&["check", out, "--backend", "cpu"]);
    assert!(checked.contains("the certificate holds"), "{checked}");
    let states = folder.path("states.csv");
    fs::write(&states, format!("x,y\n{x},0.25\n")).unwrap();
    let found = document(&["query", out, "--states", &states, "--backend", "cpu"]);
    found["rows"][0].clone()
}

#[test]
fn certificates_of_open_bounds_are_read_back() {
    let (folder, target) = (Folder::new(), "0.5 - abs(x)");
    for (bounds, ends) in [
        ("[-1, inf]", [json!(-1.0), json!("inf")]),
        ("[-inf, 1]", [json!("-inf"), json!(1.0)]),
        ("[-inf, inf]", [json!("-inf"), json!("inf")]),
    ] {
        let (record, out) = certified(&folder, &model(bounds, target, "x = 0.6\ny = 0.0"));
        let control = &record["system"]["controls"][0];
        assert_eq!([&control["low"], &control["high"]], ends.each_ref(), "{bounds}");
        let config = &record["provenance"]["config"]["model"]["controls"]["u"]["bounds"];
        let as_words =
            |end: &Value| if end.is_string() { end.clone() } else { json!(end.as_f64()) };
        assert_eq!(config.as_array().unwrap().iter().map(as_words).collect::<Vec<_>>(), ends);
        assert_eq!(asked(&folder, &out, 0.25)["target_margin"], 0.25, "{bounds}");
        fs::remove_dir_all(&out).unwrap();
    }
}

/// A document as it was before the words: `null` for every open end, and digests of that.
#[test]
fn certificates_with_null_for_open_bounds_are_read() {
    let folder = Folder::new();
    let (mut record, out) =
        certified(&folder, &model("[-inf, inf]", "0.5 - abs(x)", "x = 0.6\ny = 0.0"));
    let nulls = json!([null, null]);
    record["provenance"]["config"]["model"]["controls"]["u"]["bounds"] = nulls;
    let bounds = "provenance.config.model.controls.u.bounds";
    record["digests"][bounds] = json!(sha256([&b"[null,null]"[..]]));
    record["system"]["controls"][0]["low"] = Value::Null;
    record["system"]["controls"][0]["high"] = Value::Null;
    let controls = record["system"]["controls"].to_string();
    record["digests"]["system.controls"] = json!(sha256([controls.as_bytes()]));
    fs::write(format!("{out}/certificate.json"), record.to_string()).unwrap();
    let read = Record::read(&record.to_string()).unwrap();
    assert_eq!(read.system.controls[0].low, f32::NEG_INFINITY);
    assert_eq!(read.system.controls[0].high, f32::INFINITY);
    fs::write(format!("{out}/report.html"), html(&read)).unwrap();
    asked(&folder, &out, 0.25);
}

#[test]
fn margins_that_are_no_numbers_are_read_back() {
    let folder = Folder::new();
    // The root is NaN at the state and in half of the slice, then in the slice only.
    for (state, is_nan) in [("x = -0.5\ny = 0.0", true), ("x = 0.1\ny = 0.0", false)] {
        let (record, out) = certified(&folder, &model("[-1, 1]", "0.5 - sqrt(x)", state));
        assert_eq!(record["state"]["target_margin"] == "nan", is_nan, "{}", record["state"]);
        let cells = record["slice"]["target_margin"].as_array().unwrap();
        assert!(cells.iter().any(|cell| cell == "nan") && cells.iter().any(Value::is_number));
        let page = fs::read_to_string(format!("{out}/report.html")).unwrap();
        let row = "<th scope=\"row\">target margin</th><td>not finite</td>";
        assert_eq!(page.contains(row), is_nan, "{state}");
        assert_eq!(asked(&folder, &out, -0.5)["target_margin"], "nan");
        fs::remove_dir_all(&out).unwrap();
    }
}

/// The places of all numbers in `value` that may be fractions, one for each list.
fn places(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(number) if number.is_f64() => found.push(at.to_owned()),
        Value::Array(list) => {
            list.iter().take(1).for_each(|one| places(one, &format!("{at}/0"), found));
        }
        Value::Object(fields) => {
            fields.iter().for_each(|(key, one)| places(one, &format!("{at}/{key}"), found));
        }
        _ => {}
    }
}

/// Every number of `record` comes back as what it was when it is not finite.
fn assert_kept<T: Serialize + DeserializeOwned>(record: &T, at_least: usize) {
    let document = serde_json::to_value(record).unwrap();
    let mut found = Vec::new();
    places(&document, "", &mut found);
    found.retain(|place| !place.starts_with("/provenance/config"));
    assert!(found.len() >= at_least, "{} of {at_least}: {found:?}", found.len());
    for place in found {
        for word in ["inf", "-inf", "nan"] {
            let mut changed = document.clone();
            *changed.pointer_mut(&place).unwrap() = json!(word);
            let read: T = serde_json::from_value(changed.clone())
                .unwrap_or_else(|error| panic!("{place} of {word}: {error}"));
            let text = serde_json::to_string(&read).unwrap();
            let again: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(again.pointer(&place), Some(&json!(word)), "{place}");
        }
    }
}

#[test]
fn every_number_of_every_record_may_be_not_finite() {
    assert_kept(&records::race(), 45);
    assert_kept(&records::double_integrator(), 45);
    assert_kept(&races::full(), 25);
    assert_kept(&sweeps::races(), 8);
    assert_kept(&sweeps::certificates(), 8);
    let point: CurvePoint =
        serde_json::from_value(json!({ "iteration": 1, "loss": 0.5, "scores": [0.5] })).unwrap();
    assert_kept(&point, 2);
    let workload: WorkloadRecord = serde_json::from_value(json!({
        "name": "rollout", "backend": "cpu", "unit": "rollouts", "units": 1, "steps_per_unit": 0.5,
        "flops_per_unit": 0.5, "units_per_second": 0.5, "steps_per_second": 0.5,
        "flops_per_second": 0.5, "share": 0.5,
        "timing": {
            "calls": 1, "median_seconds": 0.5, "best_seconds": 0.5, "p10_seconds": 0.5,
            "p90_seconds": 0.5
        },
        "kernels": [{ "kernel": "rollout", "dispatches": 1, "seconds": 0.5 }],
    }))
    .unwrap();
    assert_kept(&workload, 11);
}
