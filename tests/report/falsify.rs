//! The page of a search as text: whose failures, which of them, and marks that do not hide each other.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use super::axes::assert_legible;
use crate::page::{assert_sound, figure};
use reachcast::report::{Search, falsify_html};
use reachcast::rollout::Region;
use reachcast::scenario::counterexamples::FailingStart;
use reachcast::scenario::falsify::{BestStart, FalsifyRecord, Improvement};
use reachcast::scenario::record::Provenance;
use reachcast::system::Axis;

/// The page of a search with these failing starts, of 30 that failed.
fn page(starts: &[[f32; 2]]) -> String {
    let first = |x: &[f32; 2]| BestStart { index: 7, x: x.to_vec(), measure: -0.5 };
    let record = FalsifyRecord {
        found: !starts.is_empty(),
        budget: 20_000,
        rollouts: 20_000,
        seed: 1,
        horizon: 9,
        gamma: 1.0,
        uniform: 20_000,
        uniform_failures: 0,
        restarts: 0,
        rounds: 1,
        best: starts.first().map(first),
        improvements: vec![Improvement { index: 0, measure: 0.5 }],
        failures: if starts.is_empty() { 0 } else { 30 },
        unconfirmed: 0,
        starts: starts
            .iter()
            .map(|x| FailingStart { index: 7, x: x.to_vec(), measure: -0.5 })
            .collect(),
        pairs: Vec::new(),
    };
    let provenance = Provenance {
        config: serde_json::json!({ "model": { "name": "cart & pole" } }),
        ..crate::records::double_integrator().provenance
    };
    let search = Search {
        record: &record,
        file: None,
        within: "the box",
        against: None,
        fixed: Vec::new(),
        provenance,
        events: Vec::new(),
    };
    let axis =
        |name: &str| Axis { name: name.to_owned(), unit: "m".to_owned(), low: -1.0, high: 1.0 };
    let region = Region::new_box([-1.0, -1.0], [1.0, 1.0]).unwrap();
    falsify_html(&search, &[axis("x"), axis("y")], &region)
}

#[test]
fn a_search_names_its_plant_and_what_is_drawn() {
    let page = page(&[[0.5, 0.25], [0.75, 0.5]]);
    assert_sound(&page, "search");
    assert_legible(&page, "search");
    assert!(page.contains("<h1>Search for failures of cart &amp; pole</h1>"));
    let plane = figure(&page, "plane");
    assert!(plane.contains("Of 30 starts that fail the worst 2 are drawn"), "{plane}");
    assert!(plane.contains("those that pass are not kept"));
    // The ring stands around its cross, drawn after it.
    let drawing = plane.split_once("</svg>").unwrap().0;
    let last = drawing.rfind("class=\"bad-line\"").unwrap();
    assert!(drawing.find("class=\"ring\"").unwrap() > last, "{drawing}");
}

#[test]
fn a_search_without_failures_has_no_swatch_for_them() {
    let page = page(&[]);
    assert_sound(&page, "no failure");
    let plane = figure(&page, "plane");
    assert!(plane.contains("No start fails") && !plane.contains("bad-line"), "{plane}");
    assert!(!plane.contains("smallest measure"));
}
