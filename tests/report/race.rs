//! The race report as text: every number, escaping, self-containment, and records at the edge.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::page::{
    assert_sound, attributes, cells, change_strings, drawing, escaped, figure, tags,
};
use crate::races;
use crate::races::FRAMES;
use reachcast::race::judge::Judge;
use reachcast::race::race_html;
use reachcast::race::record::{FrameRecord, RaceRecord};

const FIGURES: [&str; 4] = ["figure-success", "figure-failures", "figure-tiers", "figure-race"];

/// A sound page with all four figures.
fn sound(record: &RaceRecord, case: &str) -> String {
    let page = race_html(record);
    assert_sound(&page, case);
    for id in FIGURES {
        assert_eq!(page.matches(&format!("<figure class=\"card\" id=\"{id}\"")).count(), 1);
    }
    for word in ["NaN", "inf<", "inf ", "inf%"] {
        assert!(!page.contains(word), "{case}: {word}");
    }
    page
}

/// The words of enumerations.
const MODES: [&str; 10] = [
    "study",
    "paper",
    "rigorous",
    "unsafe-start",
    "not-finite",
    "collision",
    "fence",
    "missed-gate",
    "overtaken",
    "timeout",
];

#[test]
fn markup_in_a_record_is_text() {
    let hostile = "</title></svg><script>alert(\"x\")</script><img src='http://x'>&amp;";
    let mut count = 0;
    let record = change_strings(&races::full(), &MODES, &mut |_| {
        count += 1;
        hostile.to_owned()
    });
    assert!(count > 25, "{count} strings in the record");
    let page = sound(&record, "hostile");
    assert_eq!(page.matches("<script").count(), 1);
    assert!(!page.contains("<img"));
    assert!(page.matches(&escaped(hostile)).count() > 60);
}

#[test]
fn every_text_of_the_record_is_there() {
    let mut texts = Vec::new();
    change_strings(&races::full(), &MODES, &mut |text| {
        texts.push(text.to_owned());
        text.to_owned()
    });
    let page = race_html(&races::full());
    for text in texts {
        assert!(page.contains(&escaped(&text)), "missing: {text}");
    }
}

#[test]
fn every_number_stands_in_its_row() {
    let page = race_html(&races::full());
    let row = |name: &str, expected: &[&str]| {
        let rows = cells(&page, name);
        let expected: Vec<_> = expected.iter().map(|cell| cell.replace(" %", "\u{a0}%")).collect();
        assert!(rows.contains(&expected), "{name}: {expected:?} not in {rows:?}");
    };
    let won = "453 · 450 · 455 · 452 · 457";
    let [rate, interval] = ["90.68 %", "88.04 to 93.16 %"];
    row("hybrid", &[won, rate, interval, "0.549", "90.2 %", "87.3 to 92.7 %"]);
    let won = "260 · 257 · 262 · 259 · 264";
    row("mppi-warm", &[won, "52.08 %", "47.62 to 56.38 %", "0.549", "–", "–"]);
    row("mppi", &["−26.4", "−30.4 to −22.4", "21", "153", "1.235e−17"]);
    row("hybrid", &["100", "3", "66", "26", "14", "11", "13", "233"]);
    row("policy", &["485", "3", "424", "169", "94", "70", "88", "1,333"]);
    let means = ["3.457", "1.988", "2.346", "0.3457", "0.4568", "0.2003"];
    row("policy", &[&["1,295"], &means[..]].concat());
    row("mppi-cbf", &["151,234", "20,418", "3,207", "16", "9"]);
    row("control steps in tier 0", &["31.23 %"; 2]);
    row("control steps in tier 1", &["28.45 %"; 2]);
    row("control steps in tier 2", &["10.12 %"; 2]);
    row("control steps in tier 3", &["30.2 %"; 2]);
    row("calls of local growth", &["45,678"; 2]);
    row("calls that ended with a verified ball", &["34,567"; 2]);
    row("rounds of growth", &["101,112"; 2]);
    row("f64 re-runs of growth", &["1,314"; 2]);
    row("beta of the deviation bound", &["0.001"; 2]);
    row("beta of one call of growth", &["0.0002"; 2]);
    row("largest beta of a race", &["0.0131"; 2]);
    row("beta of all races", &["9.137"; 2]);
    row("starts", &["500"]);
    row("noise seeds", &["11, 12, 13, 14, 15"]);
    row("longest race", &["80 steps, 8 s"]);
    row("control step", &["0.1 s"]);
    row("safe at t = 0, study judge", &["480, 96 %"]);
    row("safe at t = 0, paper judge", &["403, 80.6 %"]);
    row("safe at t = 0, rigorous judge", &["479, 95.8 %"]);
    row("ppo-cbf", &["needs --ppo-policy FILE: no PPO policy was given"]);
    row("seed", &["20260131"]);
}

#[test]
fn claims_follow_the_record() {
    let mut record = races::full();
    let page = race_html(&record).replace('\u{a0}', " ");
    assert!(page.contains("<p class=\"headline\">90.68 %</p>"));
    assert!(page.contains("Published: 90.2 % (87.3 to 92.7 %)."));
    assert!(page.contains("Ceiling: 96 %; 480 of 500 starts are safe before anyone moves."));
    assert!(page.contains("mppi-soft, mppi-cbf and policy; below that of mppi-warm."));
    assert!(page.contains("the betas of all its races sum to 9.137."));
    assert!(page.contains("opposite sign"));
    record.controllers[0].judged[0].published.as_mut().unwrap().rate = 0.95;
    record.controllers[0].tiers.as_mut().unwrap().beta_total = 0.031_21;
    record.controllers.iter_mut().for_each(|own| own.judged.retain(|j| j.judge != Judge::Paper));
    record.noise_seeds.truncate(1);
    let page = race_html(&record).replace('\u{a0}', " ");
    assert!(page.contains("above that of hybrid;"));
    assert!(page.contains("with confidence at least 1 − 0.03121,"));
    assert!(page.contains("One noise seed was run"));
    assert!(!page.contains("under the paper judge is"));
}

#[test]
fn a_drawing_holds_every_rate_and_class() {
    let page = race_html(&races::full());
    let success = figure(&page, "figure-success");
    assert_eq!(success.matches("class=\"whisker\"").count(), 3 * 7 + 1);
    assert_eq!(success.matches("class=\"published\"").count(), 7 + 1);
    assert_eq!(success.matches("class=\"ceiling\"").count(), 3 * 7 + 1);
    for text in ["90.68", "76.28", "90.48", "52.48", "62.8", "87.81 to 92.99", "ceiling 80.6"] {
        assert!(success.contains(&format!(">{text}\u{a0}%</text>")), "{text}");
    }
    let failures = figure(&page, "figure-failures");
    for class in ["unsafe", "infinite", "collision", "fence", "missed", "overtaken", "timeout"] {
        let parts = failures.matches(&format!("class=\"part {class}\"")).count();
        assert_eq!(parts, 3 * 7 + 1, "{class}");
    }
    // The whole width is 324: of 2500 races 485 began unsafe.
    let width = 324.0 * 485.0 / 2500.0;
    let expected = format!("H{:.2}V", 8.0 + width);
    assert!(failures.contains(&expected), "{expected}");
}

#[test]
fn the_bands_of_a_step_add_up() {
    let mut record = races::full();
    record.controllers.truncate(1);
    let tiers = record.controllers[0].tiers.as_mut().unwrap();
    tiers.occupancy = vec![[10, 20, 30, 40, 0], [0, 0, 50, 0, 50]];
    let page = race_html(&record);
    let drawn = drawing(&page, "figure-tiers");
    // Axes 190 high from 14 down: a tenth of the races is 19 high.
    let tops = |band: &str| -> Vec<f64> {
        let (_, rest) = drawn.split_once(&format!("class=\"band {band}\" d=\"M")).unwrap();
        let (data, _) = rest.split_once('Z').unwrap();
        data.split('L').map(|point| point.split(' ').nth(1).unwrap().parse().unwrap()).collect()
    };
    let top = |percent: f64| 14.0 + 190.0 * (1.0 - percent / 100.0);
    assert_eq!(tops("tier-0")[..4], [top(10.0), top(10.0), top(0.0), top(0.0)]);
    assert_eq!(tops("tier-3")[..4], [top(100.0), top(100.0), top(50.0), top(50.0)]);
    assert_eq!(tops("over")[..4], [top(100.0), top(100.0), top(100.0), top(100.0)]);
    assert_eq!(tops("tier-2")[4..], [top(0.0), top(0.0), top(30.0), top(30.0)]);
}

/// The drawing of one moment.
fn moment(page: &str, index: usize) -> &str {
    let drawn = drawing(page, "figure-race");
    let (_, rest) = drawn.split_once(&format!("data-moment=\"{index}\">")).unwrap();
    rest.split("<g class=\"moment\"").next().unwrap()
}

#[test]
fn each_moment_is_drawn_once_and_only_the_first_is_shown() {
    let page = race_html(&races::full());
    let film = figure(&page, "figure-race");
    for index in 0..FRAMES {
        assert_eq!(film.matches(&format!("data-moment=\"{index}\"")).count(), 2);
    }
    assert_eq!(film.matches("class=\"moment shown\" data-moment=\"0\"").count(), 2);
    assert_eq!(film.matches("moment shown").count(), 2);
    assert!(film.contains("Without JavaScript only the first moment is shown."));
    assert!(film.contains("won under the study judge, lost (collision) under the paper judge"));
    assert!(film.contains(&format!("max=\"{}\"", FRAMES - 1)));
    // Tier 3 tries a ball that fails, tier 2 one that passes, tier 1 none.
    assert!(moment(&page, 5).contains("class=\"ball unverified\""));
    assert!(moment(&page, 25).contains("class=\"ball\""));
    assert!(!moment(&page, 45).contains("class=\"ball"));
    assert!(moment(&page, 5).contains("bad-line") && !moment(&page, 25).contains("bad-line"));
}

#[test]
fn cells_are_drawn_where_they_are_certified() {
    let mut record = races::full();
    let picture = record.picture.as_mut().unwrap();
    picture.frames.truncate(1);
    let mut cells = vec![false; 468];
    // Row 0: columns 2 to 4; row 1: the last column; and it ends there.
    cells[2..5].fill(true);
    cells[17 + 18] = true;
    picture.frames[0].certified = Some(cells);
    let page = race_html(&record);
    let (_, rest) = moment(&page, 0).split_once("class=\"certified\" d=\"").unwrap();
    let (data, _) = rest.split_once('"').unwrap();
    let numbers: Vec<f64> = data
        .split(|c: char| c.is_ascii_alphabetic() || c == ' ')
        .filter_map(|number| number.parse().ok())
        .collect();
    let [first, second] = [&numbers[..5], &numbers[5..]];
    assert_eq!(second.len(), 5);
    let cell = (first[2] - first[0]) / 3.0;
    // Square cells, the second row above the first, to the rounding of a tenth.
    assert!((first[1] - first[3] - cell).abs() <= 1.0, "{numbers:?}");
    assert!((second[2] - second[0] - cell).abs() <= 1.0, "{numbers:?}");
    assert!((second[0] - first[0] - 15.0 * cell).abs() <= 2.0, "{numbers:?}");
    assert_eq!(second[1], first[3]);
}

#[test]
fn the_cone_grows_with_the_height_of_the_opponent_above_the_ego() {
    let radius = |rise: f32| -> f64 {
        let mut record = races::full();
        let x = &mut record.picture.as_mut().unwrap().frames[0].x;
        x[10] = x[4] + rise;
        let page = race_html(&record);
        let (_, rest) = moment(&page, 0).split_once("class=\"cone\"").unwrap();
        let tag = rest.split_once('>').unwrap().0;
        attributes(tag).iter().find(|(name, _)| *name == "r").unwrap().1.parse().unwrap()
    };
    let level = radius(0.0);
    assert!((radius(0.5) / level - 1.5).abs() < 1e-3);
    assert_eq!(radius(-0.5), level);
}

#[test]
fn the_page_is_small() {
    let mut record = races::full();
    let frames = &mut record.picture.as_mut().unwrap().frames;
    let fan = frames[0].fan.clone();
    assert_eq!([fan.len(), fan[0].len()], [30, 20]);
    for frame in frames {
        // The worst for runs: every other cell.
        frame.certified = Some((0..468).map(|cell| cell % 2 == 0).collect());
        frame.fan.clone_from(&fan);
    }
    let bytes = race_html(&record).len();
    assert!(bytes < 2_000_000, "{bytes} bytes");
}

#[test]
fn nothing_is_loaded_and_only_the_own_script_runs() {
    let page = race_html(&races::full());
    for tag in tags(&page) {
        for (name, value) in attributes(tag) {
            assert!(!["src", "srcset", "action", "style"].contains(&name), "<{tag}>");
            assert!(!name.starts_with("on"), "<{tag}>");
            assert!(name != "href" || value == "data:,", "<{tag}>");
        }
    }
    assert!(!page.contains("://") && !page.contains("@import"));
    assert_eq!(page.matches("url(").count(), page.matches("url(#").count());
    for identity in page.split("url(#").skip(1) {
        let (identity, _) = identity.split_once(')').unwrap();
        assert_eq!(page.matches(&format!("id=\"{identity}\"")).count(), 1, "{identity}");
    }
    let policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; \
                  img-src data:";
    assert!(page.contains(&format!("content=\"{policy}\"")));
    let mut without = races::full();
    without.picture = None;
    assert!(!race_html(&without).contains("<script"));
}

#[test]
fn a_page_depends_on_the_record_alone() {
    let record = races::full();
    let page = race_html(&record);
    assert_eq!(page, race_html(&record));
    let stored = serde_json::to_string(&record).unwrap();
    assert_eq!(page, race_html(&serde_json::from_str(&stored).unwrap()));
}

/// A change that takes a record to an edge, and a word that the page must hold then.
type Edge = (&'static str, fn(&mut RaceRecord), &'static str);

const EDGES: [Edge; 20] = [
    ("one controller", |record| record.controllers.truncate(1), "1 controller on"),
    ("no hybrid", |record| drop(record.controllers.remove(0)), "hybrid-no-policy under the"),
    ("no controller", |record| record.controllers.clear(), "No controller was judged."),
    ("one seed", |record| one_seed(record), "with noise seed 11."),
    ("no seed", |record| record.noise_seeds.clear(), "No race was run."),
    ("no starts", |record| record.starts.count = 0, "No race was run."),
    ("no picture", |record| record.picture = None, "No race was recorded step by step."),
    ("no frames", |record| frames(record).clear(), "No race was recorded step by step."),
    ("one frame", |record| frames(record).truncate(1), "max=\"0\""),
    (
        "no tiers",
        |record| record.controllers.iter_mut().for_each(|controller| controller.tiers = None),
        "No controller has tiers.",
    ),
    (
        "no steps in tiers",
        |record| {
            let tiers = record.controllers.iter_mut().filter_map(|own| own.tiers.as_mut());
            tiers.for_each(|tiers| tiers.occupancy.clear());
        },
        "No controller has tiers.",
    ),
    (
        "nobody in any tier",
        |record| {
            let tiers = record.controllers.iter_mut().filter_map(|own| own.tiers.as_mut());
            tiers.for_each(|tiers| tiers.occupancy.fill([0; 5]));
        },
        "figure-tiers",
    ),
    ("zero successes", zero_successes, "<p class=\"headline\">0\u{a0}%</p>"),
    ("no ceilings", |record| record.starts.ceilings.clear(), "figure-success"),
    (
        "cells that do not fit",
        |record| {
            frames(record)[3].certified = Some(vec![true; 7]);
            frames(record)[4].certified = None;
        },
        "7 of 7",
    ),
    ("no slice", |record| record.picture.as_mut().unwrap().slice_x.clear(), "figure-race"),
    (
        "states that are not numbers",
        |record| {
            frames(record)[0].x.fill(f32::NAN);
            frames(record)[1].x.clear();
            frames(record)[2].x.fill(1e30);
            frames(record)[3].x.fill(1e9);
            frames(record)[4].check_margin = Some(f32::INFINITY);
            frames(record)[5].u = Some(vec![f32::NEG_INFINITY; 3]);
        },
        "not finite",
    ),
    (
        "plans that are not numbers",
        |record| {
            let fan = &mut frames(record)[0].fan;
            fan[0].clear();
            fan[1].fill([f32::NAN; 2]);
            fan[2][7] = [1e30, 0.0];
            fan[3] = vec![[-1e9, 1e9], [1e9, -1e9]];
            fan.last_mut().unwrap().truncate(1);
        },
        "figure-race",
    ),
    (
        "balls that are not numbers",
        |record| {
            frames(record)[0].ball.as_mut().unwrap().radius = f32::NAN;
            frames(record)[1].ball.as_mut().unwrap().center = [1e12, f32::INFINITY];
            frames(record)[2].ball.as_mut().unwrap().radius = -1.0;
            frames(record)[3].recovery = Some([f32::NAN, 0.0]);
            frames(record)[4].tier = Some(9);
            record.step_seconds = f64::NAN;
        },
        "figure-race",
    ),
    ("rates that are not numbers", bad_rates, "not finite"),
];

fn frames(record: &mut RaceRecord) -> &mut Vec<FrameRecord> {
    &mut record.picture.as_mut().unwrap().frames
}

fn one_seed(record: &mut RaceRecord) {
    record.noise_seeds.truncate(1);
    for judged in record.controllers.iter_mut().flat_map(|own| &mut own.judged) {
        judged.successes.truncate(1);
        judged.spread = None;
    }
}

fn zero_successes(record: &mut RaceRecord) {
    for controller in &mut record.controllers {
        controller.metrics = None;
        for judged in &mut controller.judged {
            judged.successes.fill(0);
            (judged.rate, judged.interval) = (0.0, [0.0, 0.0073]);
            judged.failures.iter_mut().for_each(|failure| failure.count = 0);
            judged.failures[5].count = 2500;
        }
    }
}

fn bad_rates(record: &mut RaceRecord) {
    for judged in record.controllers.iter_mut().flat_map(|own| &mut own.judged) {
        (judged.rate, judged.interval) = (f64::NAN, [f64::NEG_INFINITY, 1e30]);
        judged.failures.clear();
        if let Some(paired) = &mut judged.against_hybrid {
            (paired.difference, paired.p_value) = (f64::NAN, f64::NAN);
        }
    }
}

#[test]
fn records_at_the_edge_still_make_a_page() {
    sound(&races::full(), "as it is");
    for (case, change, word) in EDGES {
        let mut record = races::full();
        change(&mut record);
        let page = sound(&record, case);
        assert!(page.contains(word), "{case}: no {word:?}");
    }
}
