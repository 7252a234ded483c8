//! The report in headless Chromium: it opens without console messages, its figures have size, no
//! label is cut off or covered, and a phone's width is enough.
//!
//! To look at a report: `chromium --headless --no-sandbox --hide-scrollbars
//! --window-size=1400,1500 --screenshot=docs/report.png report.html`.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::records;
use std::fs;

use crate::chromium::{Scheme, browser, check_everywhere, visit};
use reachcast::report::html;
use reachcast::scenario::record::Record;

/// Phone and wide screen, in CSS pixels.
const WIDTHS: [u32; 2] = [400, 1600];

/// The race, the double integrator, and the race under names longer than any line.
fn shown() -> Vec<Record> {
    let mut long = records::race();
    long.system.name = "a-name-without-any-place-to-break-it".repeat(6);
    long.provenance.policy = "PolicyOf".repeat(40);
    for axis in &mut long.system.states {
        axis.name = format!("{}_{}", axis.name, "very_long".repeat(12));
    }
    for body in &mut long.system.bodies {
        body.name = body.name.repeat(30);
    }
    vec![records::race(), records::double_integrator(), long]
}

#[test]
fn figures_have_size_and_labels_at_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    let pages: Vec<String> = shown().iter().map(html).collect();
    check_everywhere(&pages, &WIDTHS, 5);
}

/// The page refuses scripts: one put into it by force does not run, and the console says so.
#[test]
fn the_page_runs_no_script_and_console_messages_are_seen() {
    if !browser() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = "<script>document.body.textContent = 'ran'</script></body>";
    let page = html(&records::race()).replace("</body>", script);
    fs::write(folder.path().join("index.html"), page).unwrap();
    let visit = visit(folder.path(), "index.html", Scheme::Light);
    assert_eq!(visit.console.len(), 1, "{:?}", visit.console);
    assert!(visit.console[0].contains("Content Security Policy"), "{:?}", visit.console);
    assert!(visit.document.contains("Reachcast certificate"));
}
