//! How the other races were lost: a stacked bar per controller.

use super::sheet::{Anchor, Sheet, WIDTH, panels};
use super::words::{self, CLASSES, percent};
use crate::experiment::judge::Judge;
use crate::experiment::record::{JudgedRecord, RaceRecord};
use crate::report::figure::{Figure, Swatch};
use crate::report::text::shorten;

/// Left end of the scale.
const LEFT: f64 = 8.0;
/// Width of the scale.
const SCALE: f64 = WIDTH - 2.0 * LEFT;
/// Height of a row.
const ROW: f64 = 41.0;
/// Narrowest part that holds its letter.
const LETTER: f64 = 12.0;
/// Characters of a controller's name beside its share of failures.
const NAME: usize = 26;

/// One panel per judge.
pub(super) fn figure(record: &RaceRecord) -> Figure {
    let races = words::races(record);
    let judges = words::judges(record).into_iter();
    let drawn: Vec<_> = judges
        .filter(|&judge| words::verdicts(record, judge).next().is_some())
        .map(|judge| (format!("{} judge", words::judge(judge)), panel(record, judge)))
        .collect();
    let classes = CLASSES.iter().map(|&class| {
        let (letter, style) = words::mark(class);
        let swatch = format!(
            "<path class=\"part {style}\" d=\"M-14-7H14V7H-14Z\"/>\
             <path class=\"weave {style}\" d=\"M-14-7H14V7H-14Z\"/>\
             <text class=\"letter\" text-anchor=\"middle\" y=\"4.5\">{letter}</text>"
        );
        (Swatch::Mark(swatch), words::class(class).to_owned())
    });
    Figure {
        id: "figure-failures",
        title: "How the others were lost".to_owned(),
        drawing: match drawn.is_empty() || races == 0 {
            true => Err("No race was run.".to_owned()),
            false => Ok(panels(&drawn)),
        },
        legend: classes.collect(),
        caption: "Shares of all races, over all noise seeds; the empty rest was won. A lost race \
                  counts in one class."
            .to_owned(),
    }
}

fn panel(record: &RaceRecord, judge: Judge) -> String {
    let races = words::races(record).max(1) as f64;
    let mut sheet = Sheet::default();
    let mut top = 2.0;
    for (controller, judged) in words::verdicts(record, judge) {
        let lost: u64 = CLASSES.iter().map(|&class| words::failures(judged, class)).sum();
        let text = format!("lost {}", percent(lost as f64 / races));
        sheet.text("name", [LEFT, top + 12.0], Anchor::Start, &shorten(&controller.name, NAME));
        sheet.text("tick", [LEFT + SCALE, top + 12.0], Anchor::End, &text);
        stack(&mut sheet, top + 17.0, judged, races);
        top += ROW;
    }
    for tick in [0, 20, 40, 60, 80, 100] {
        let at = LEFT + SCALE * f64::from(tick) / 100.0;
        let label = if tick == 100 { "100 %".to_owned() } else { tick.to_string() };
        let (at, anchor) = match tick {
            100 => (at + LEFT, Anchor::End),
            _ => (at, Anchor::Middle),
        };
        sheet.text("tick", [at, top + 10.0], anchor, &label);
    }
    let description = format!("Failure classes under the {} judge", words::judge(judge));
    sheet.finish(top + 18.0, &description)
}

/// The classes side by side, each in its colour and pattern, with its letter where it fits.
fn stack(sheet: &mut Sheet, top: f64, judged: &JudgedRecord, races: f64) {
    let bottom = top + 17.0;
    sheet.area("track", [LEFT, top, LEFT + SCALE, bottom]);
    let mut lost = 0;
    for class in CLASSES {
        let before = LEFT + SCALE * (lost as f64 / races).min(1.0);
        lost += words::failures(judged, class);
        let after = LEFT + SCALE * (lost as f64 / races).min(1.0);
        if after > before {
            let (letter, style) = words::mark(class);
            sheet.area(&format!("part {style}"), [before, top, after, bottom]);
            sheet.area(&format!("weave {style}"), [before, top, after, bottom]);
            if after - before >= LETTER {
                let middle = (before + after) / 2.0;
                sheet.text("letter", [middle, top + 13.0], Anchor::Middle, letter);
            }
        }
    }
}
