//! The race report in headless Chromium: legible at every width, and its race can be stepped
//! through by slider, keys and buttons.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::races;
use std::fs;
use std::time::Duration;

use crate::chromium::{Scheme, browser, check_everywhere, measured, visit_for};
use crate::races::FRAMES;
use reachcast::race::race_html;
use reachcast::race::record::RaceRecord;
use serde_json::{Value, json};

/// Phone, tablet and wide screen, in CSS pixels.
const WIDTHS: [u32; 3] = [375, 768, 1280];
/// Drawings of the full record: three judges twice, two controllers with tiers, one race.
const DRAWINGS: usize = 9;

/// Works the controls of a page and writes down what each act led to.
const DRIVE: &str = r#"
const wait = pause => new Promise(done => setTimeout(done, pause));
async function drive(frame) {
  const page = frame.contentDocument, view = frame.contentWindow;
  const find = id => page.getElementById(id);
  const style = element => view.getComputedStyle(element);
  const number = element => Number(element.dataset.moment);
  const state = () => ({
    drawn: [...page.querySelectorAll('svg .moment')]
      .filter(group => style(group).display !== 'none').map(number),
    said: [...page.querySelectorAll('.moments .moment')]
      .filter(words => style(words).visibility === 'visible').map(number),
    value: Number(find('moment').value),
    aloud: find('moment').getAttribute('aria-valuetext'), now: find('now').textContent,
    play: find('play').textContent });
  const acts = [];
  const note = act => acts.push({ act, ...state() });
  const set = value => {
    find('moment').value = value;
    find('moment').dispatchEvent(new view.Event('input', { bubbles: true }));
    note('set ' + value);
  };
  const press = key => {
    const event = new view.KeyboardEvent('keydown', { key, bubbles: true, cancelable: true });
    find('moment').dispatchEvent(event);
    note(key);
    acts[acts.length - 1].taken = event.defaultPrevented;
  };
  const click = id => { find(id).click(); note(id); };
  note('start');
  set(37); set(0); set(12);
  for (const key of ['ArrowRight', 'ArrowUp', 'ArrowLeft', 'ArrowDown', 'PageUp', 'PageDown',
    'Home', 'ArrowLeft', 'End', 'ArrowRight', 'Tab']) press(key);
  set(20);
  for (const id of ['next', 'next', 'previous']) click(id);
  set(75);
  const passed = [];
  new MutationObserver(() => passed.push(state().drawn)).observe(find('now'), { childList: true });
  click('play');
  await wait(2000);
  note('played out');
  acts[acts.length - 1].passed = [...passed];
  click('play'); await wait(350); click('play');
  const paused = state().value;
  await wait(2000);
  note('paused');
  acts[acts.length - 1].paused = paused;
  return acts;
}
window.onload = async () => {
  const acts = await drive(document.querySelector('iframe'));
  document.getElementById('measured').textContent = JSON.stringify(acts).replace(/[<>&]/g, '?');
};
"#;

/// The full record, and one under names longer than any line.
fn shown() -> Vec<RaceRecord> {
    let mut long = races::full();
    long.starts.source = "a-file-without-any-place-to-break-it".repeat(6);
    for controller in &mut long.controllers {
        controller.name = format!("{}{}", controller.name, "_very_long".repeat(12));
        controller.description = "Description".repeat(30);
    }
    long.absent[0].name = "absent".repeat(20);
    long.absent[0].reason = "because".repeat(40);
    vec![races::full(), long]
}

#[test]
fn the_page_fits_every_width_in_both_schemes() {
    if !browser() {
        return;
    }
    let pages: Vec<String> = shown().iter().map(race_html).collect();
    check_everywhere(&pages, &WIDTHS, DRAWINGS);
}

/// What each act on the controls of the full record led to.
fn driven() -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("race.html"), race_html(&races::full())).unwrap();
    let index = format!(
        "<!doctype html><meta charset=\"utf-8\"><pre id=\"measured\"></pre>\
         <iframe src=\"race.html\" style=\"width:375px;height:900px\"></iframe>\
         <script>{DRIVE}</script>"
    );
    fs::write(folder.path().join("index.html"), index).unwrap();
    let wait = Duration::from_secs(20);
    let visit = visit_for(folder.path(), "index.html", Scheme::Light, wait);
    assert!(visit.console.is_empty(), "{:?}", visit.console);
    measured(&visit)
}

/// The slider, the words and the one group that is visible agree on `moment`.
fn assert_shows(act: &Value, moment: usize) {
    assert_eq!(act["drawn"], json!([moment]), "{act}");
    assert_eq!(act["said"], json!([moment]), "{act}");
    assert_eq!(act["value"], moment, "{act}");
    assert_eq!(act["aloud"], act["now"], "{act}");
    let title = act["now"].as_str().unwrap();
    assert!(title.starts_with(&format!("Step {moment} of {},", FRAMES - 1)), "{act}");
}

#[test]
fn slider_keys_and_buttons_show_exactly_the_moment_asked_for() {
    if !browser() {
        return;
    }
    let last = FRAMES - 1;
    let acts = driven();
    let expected = [
        ("start", 0),
        ("set 37", 37),
        ("set 0", 0),
        ("set 12", 12),
        ("ArrowRight", 13),
        ("ArrowUp", 14),
        ("ArrowLeft", 13),
        ("ArrowDown", 12),
        ("PageUp", 22),
        ("PageDown", 12),
        ("Home", 0),
        ("ArrowLeft", 0),
        ("End", last),
        ("ArrowRight", last),
        ("Tab", last),
        ("set 20", 20),
        ("next", 21),
        ("next", 22),
        ("previous", 21),
        ("set 75", 75),
        ("play", 75),
        ("played out", last),
    ];
    for (act, (name, moment)) in acts.iter().zip(expected) {
        assert_eq!(act["act"], name);
        assert_shows(act, moment);
        // A key that the script takes must not move the slider a second time.
        if let Some(taken) = act["taken"].as_bool() {
            assert_eq!(taken, name != "Tab", "{act}");
        }
    }
    let [.., play, played_out, again, pause, paused] = &acts[..] else {
        panic!("{} acts", acts.len());
    };
    assert_eq!(acts.len(), expected.len() + 3);
    assert_eq!([&play["play"], &played_out["play"]], ["Pause", "Play"]);
    // Every moment in turn, once, and a stop at the end.
    assert_eq!(played_out["passed"], json!([[76], [77], [78], [79]]));
    // Play at the end begins anew; pause holds the moment.
    assert_shows(again, 0);
    assert_eq!([&again["play"], &pause["play"], &paused["play"]], ["Pause", "Play", "Play"]);
    let held = paused["paused"].as_u64().unwrap();
    assert!((1..10).contains(&held), "{paused}");
    assert_shows(paused, usize::try_from(held).unwrap());
}
