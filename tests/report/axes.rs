//! Axes as text: every one has ticks to be read by, and every label lies inside its figure.
#![allow(clippy::unwrap_used, reason = "a test that fails to set up has failed")]

use crate::page::attributes;
use crate::records;
use reachcast::report::html;
use reachcast::scenario::record::Record;

/// Width of a character of a label, at most, in the units of a drawing.
const CHARACTER: f64 = 7.6;

/// The drawings of a page that have axes.
fn plots(page: &str) -> Vec<&str> {
    let drawings = page.split("<svg class=\"plot\"").skip(1);
    let drawings = drawings.map(|rest| rest.split_once("</svg>").unwrap().0);
    drawings.filter(|drawing| drawing.contains("class=\"frame\"")).collect()
}

fn number(tag: &str, name: &str) -> f64 {
    let found = attributes(tag).into_iter().find(|(other, _)| *other == name);
    found.map_or(0.0, |(_, value)| value.parse().unwrap())
}

/// How far a group is moved to the right.
fn moved(tag: &str) -> f64 {
    let moved = tag.split_once("translate(").map(|(_, rest)| rest.split_once(' ').unwrap().0);
    moved.map_or(0.0, |across| across.parse().unwrap())
}

/// The two ends of each label of a drawing, with its text.
fn labels(drawing: &str) -> Vec<([f64; 2], &str)> {
    let (mut groups, mut found) = (Vec::new(), Vec::new());
    for part in drawing.split('<').skip(1) {
        let (tag, text) = part.split_once('>').unwrap();
        match tag.split(' ').next().unwrap() {
            "g" => groups.push(moved(tag)),
            "/g" => drop(groups.pop()),
            "text" if tag.contains("class=\"tick\"") => {
                let at = number(tag, "x") + groups.iter().sum::<f64>();
                let width = CHARACTER * text.chars().count() as f64;
                let left = if tag.contains("\"end\"") { at - width } else { at - width / 2.0 };
                found.push(([left, left + width], text));
            }
            _ => {}
        }
    }
    found
}

/// Ticks across and upwards.
fn ticks(drawing: &str) -> [usize; 2] {
    let lines = drawing.split("<path class=\"grid\" d=\"").skip(1);
    let lines: Vec<&str> = lines.map(|line| line.split_once('"').unwrap().0).collect();
    let of = |kind: char| lines.iter().filter(|line| line.contains(kind)).count();
    [of('V'), of('H')]
}

/// Every plot of `page` has two ticks along both axes, and labels inside its frame.
pub(crate) fn assert_legible(page: &str, case: &str) {
    let plots = plots(page);
    assert!(!plots.is_empty(), "{case}");
    for plot in plots {
        let [across, up] = ticks(plot);
        assert!(across >= 2 && up >= 2, "{case}: {across} and {up} ticks in {plot}");
        let outer = plot.split_once("viewBox=\"0 0 ").unwrap().1.split_once(' ').unwrap().0;
        let outer: f64 = outer.parse().unwrap();
        let labels = labels(plot);
        assert!(labels.len() >= 4, "{case}: {labels:?}");
        for ([left, right], text) in labels {
            assert!(left >= -0.1 && right <= outer + 0.1, "{case}: {text} from {left} to {right}");
        }
    }
}

/// A record whose slice lies between these values, with small margins.
fn between(low: f32, high: f32) -> Record {
    let mut record = records::double_integrator();
    for axis in [&mut record.slice.x, &mut record.slice.y] {
        let last = (axis.values.len() - 1) as f32;
        for (place, value) in axis.values.iter_mut().enumerate() {
            *value = low + (high - low) * place as f32 / last;
        }
    }
    record.state.x.fill(low);
    record.growth.samples.clear();
    record.growth.center = None;
    record.slice.check_margin.iter_mut().for_each(|margin| *margin *= 7.1e-4);
    record
}

#[test]
fn axes_have_two_ticks_and_labels_inside_the_figure() {
    for record in [records::race(), records::double_integrator()] {
        assert_legible(&html(&record), &record.system.name);
    }
    let ends = [[0.01215, 0.01785], [-1.1e-5, 1.8e-5], [99_000.0, 1e5], [-3e8, 2e8], [0.9, 1.0]];
    for [low, high] in ends {
        assert_legible(&html(&between(low, high)), &format!("{low} to {high}"));
    }
}

/// What does not change lies in the middle of an axis of its size, or of one from −1 to 1.
#[test]
fn a_constant_has_an_axis_that_can_be_read() {
    let mut record = records::double_integrator();
    record.deviation.bound.fill(0.0);
    record.deviation.largest.fill(0.0);
    record.deviation.exact = None;
    let page = html(&record);
    assert_legible(&page, "no deviation");
    for number in ["e-7", "e-9", "0.000000"] {
        assert!(!page.contains(number) || !plots(&page).iter().any(|plot| plot.contains(number)));
    }
}
