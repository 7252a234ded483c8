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

/// The bodies of a model are drawn as they are in a certificate, with the shapes around them; a legend has what
/// is drawn, and a target that the plane has not is said to be missing.
#[test]
fn bodies_are_drawn_and_a_missing_target_is_named() {
    let bodies = "[model.bodies]\nbob = { at = [\"sin(angle)\", \"0\"], size = 0.2 }\n\
                  [model.shapes]\nwall = { box = [-2.0, -1.0, -1.9, 1.0], kind = \"unsafe\" }\n";
    let drawn = planned(&format!("{PENDULUM}{bodies}"), &["--backend", "cpu"]).page;
    assert_sound(&drawn, "bodies");
    let paths = figure(&drawn, "paths");
    assert_eq!(paths.matches("class=\"body extent\"").count(), 2, "{paths}");
    for words in ["right: sin(angle)</text>", "bob, from its start", "wall"] {
        assert!(paths.contains(words), "no {words} in {paths}");
    }
    assert!(!paths.contains("class=\"target-area"), "the plane is not that of two states");
    let set = ["--set", "model.task.target=-1 - 0 * angle", "--backend", "cpu"];
    let none = planned(PENDULUM, &set).page;
    let paths = figure(&none, "paths");
    assert!(paths.contains("There is no target in this plane") && !paths.contains("target-area"));
    assert!(paths.contains("A run succeeds if it "));
}

/// A single state has no plane, and a run that stops at once is shown all the same.
#[test]
fn pages_at_the_edge_are_sound() {
    let line = planned(LINE, &["--backend", "cpu"]);
    assert_sound(&line.page, "line");
    assert!(!line.page.contains("id=\"paths\""));
    let huge = LINE.replace("x = \"x + u\"", "x = \"if(step < 1, x + u, exp(80 + x))\"");
    let set = ["--set", "model.task.target=x * 0 + 0.5", "--backend", "cpu"];
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
