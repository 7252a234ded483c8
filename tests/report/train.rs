//! The page of a run of training as text: every number, escaping, and records at the edge.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use super::axes::assert_legible;
use crate::page::{assert_sound, drawing};
use reachcast::report::train_html;
use reachcast::scenario::record::Provenance;
use reachcast::train::record::{CurvePoint, NetworkRecord, Origin, TRAIN_SCHEMA, TrainRecord};
use reachcast::train::settings::Method;

/// A run of three scores.
fn record() -> TrainRecord {
    let words = |text: &str| text.to_owned();
    let provenance = Provenance {
        version: words("9.8.7"),
        seed: 12_345,
        generator: words("generator-x"),
        config: serde_json::json!({ "key": "<value>" }),
        policy: words("mlp 2-32-1"),
        policy_sha256: words("aaa111"),
        physics_sha256: words("bbb222"),
        backend: words("cpu"),
        device: words("device-x"),
        networks: None,
    };
    let point = |iteration, loss, score| CurvePoint { iteration, loss, scores: vec![score, 0.5] };
    TrainRecord {
        schema: TRAIN_SCHEMA,
        origin: Origin { method: Method::Value, provenance },
        total: 30_000,
        stopped_early: true,
        best: 1000,
        scores: vec![words("share <right>"), words("R2")],
        curve: vec![
            point(0, None, 0.125),
            point(1000, Some(0.0625), 0.875),
            point(2000, Some(0.03125), 0.75),
        ],
        networks: vec![NetworkRecord {
            file: words("value.safetensors"),
            sha256: words("ccc333"),
            widths: vec![2, 32, 1],
        }],
        policy: None,
        notes: vec![words("nothing <learned>")],
        events: vec![],
    }
}

#[test]
fn every_number_is_there_and_text_is_escaped() {
    let page = train_html(&record());
    assert_sound(&page, "training");
    for text in [
        "0.125",
        "0.875",
        "0.75",
        "0.0625",
        "0.03125",
        "1,000",
        "30,000",
        "12345",
        "value.safetensors",
        "ccc333",
        "2-32-1",
        "aaa111",
        "bbb222",
        "device-x",
        "generator-x",
        "9.8.7",
        "share &lt;right&gt;",
        "It ended early, after 2,000",
        "&lt;value&gt;",
        "nothing &lt;learned&gt;",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("<value>") && !page.contains("<right>"));
    assert_eq!(page.matches("<figure").count(), 3);
    // The line breaks nowhere: each score is drawn, and the mark of the kept network once per figure.
    assert_eq!(page.matches("class=\"seen\"").count(), 2 * 3);
    assert_eq!(train_html(&record()), page);
}

/// A share that never moves has the axis of a share, another score one of its size, and neither a breath's.
#[test]
fn scores_that_do_not_move_can_be_read() {
    let mut constant = record();
    constant.origin.provenance.config = serde_json::json!({ "model": { "name": "cart" } });
    constant.curve.iter_mut().for_each(|point| {
        (point.loss, point.scores) = (Some(0.0), vec![0.0, -1.0]);
    });
    let page = train_html(&constant);
    assert_legible(&page, "constant");
    assert!(page.contains("<h1>value.safetensors of cart</h1>"), "the plant is named");
    let ticks = |id: &str| -> Vec<String> {
        let labels = drawing(&page, id).split("text-anchor=\"end\">").skip(1);
        labels.map(|text| text.split_once('<').unwrap().0.to_owned()).collect()
    };
    assert_eq!(ticks("score"), ["0.0", "0.5", "1.0"]);
    assert_eq!(ticks("second-score"), ["−2.0", "−1.5", "−1.0", "−0.5", "0.0"]);
    assert_eq!(ticks("loss"), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
    // The curve in numbers has the width of the page, where no number is broken.
    assert!(page.contains("<section class=\"numbers wide\"><h3>Curve</h3>"));
}

#[test]
fn runs_without_scores_and_numbers_that_are_none() {
    let mut empty = record();
    empty.curve.clear();
    empty.networks.clear();
    let page = train_html(&empty);
    assert_sound(&page, "empty");
    assert!(page.contains("Nothing of this was measured."));
    assert!(!page.contains("class=\"legend\""), "nothing is drawn");
    let mut broken = record();
    broken.curve[1].scores[0] = f64::NAN;
    broken.curve[2].loss = Some(f64::INFINITY);
    assert_sound(&train_html(&broken), "not finite");
}

#[test]
fn a_record_is_read_back() {
    let text = serde_json::to_string(&record()).unwrap();
    assert_eq!(serde_json::from_str::<TrainRecord>(&text).unwrap(), record());
    let table = String::from_utf8(record().table().csv().unwrap()).unwrap();
    assert!(table.starts_with("iteration,loss,share <right>,R2\n0,,0.125,0.5\n"), "{table}");
}
