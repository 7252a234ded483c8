//! The page of plans: sound HTML, text of models escaped, legible at every width in both schemes.

use crate::chromium::{browser, check_everywhere};
use crate::page::{assert_sound, figure};
use crate::plants::{LINE, PENDULUM, planned};

/// Phone and wide screen, in CSS pixels.
const WIDTHS: [u32; 2] = [420, 1600];

#[test]
fn the_page_is_sound_and_says_what_the_record_says() {
    let planned = planned(PENDULUM, &["--set", "plan.runs=30", "--backend", "cpu"]);
    assert_sound(&planned.page, "plan");
    for id in ["paths", "states", "controls", "margins", "terms", "effective"] {
        figure(&planned.page, id);
    }
    assert!(figure(&planned.page, "states").contains("The first 20 of 30 runs"));
    assert_eq!(figure(&planned.page, "terms").matches("<svg class=\"plot\"").count(), 4);
    let hash = planned.record["provenance"]["physics_sha256"].as_str().unwrap();
    assert!(planned.page.contains(hash));
}

/// A single state has no plane, and a run that stops at once is shown all the same.
#[test]
fn pages_at_the_edge_are_sound() {
    let line = planned(LINE, &["--backend", "cpu"]);
    assert_sound(&line.page, "line");
    assert!(!line.page.contains("id=\"paths\""));
    let huge = LINE.replace("x = \"x + u\"", "x = \"if(step < 1, x + u, exp(80 + x))\"");
    let set = ["--set", "model.task.target=0.5", "--backend", "cpu"];
    assert_sound(&planned(&huge, &set).page, "huge");
}

#[test]
fn figures_have_size_and_labels_at_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    let page = planned(PENDULUM, &["--set", "plan.runs=3", "--backend", "cpu"]).page;
    // Paths, two states, a control, two margins, four terms, effective samples.
    check_everywhere(&[page], &WIDTHS, 11);
}
