//! How races were lost: a stacked bar per row, each class in its colour, pattern and letter.

use super::verdicts::{self, CLASSES, Mark};
use crate::race::record::JudgedRecord;
use crate::report::figure::Swatch;
use crate::report::sheet::{Anchor, Sheet, WIDTH};
use crate::report::text::{percent, shorten};

/// Left end of the scale.
const LEFT: f64 = 8.0;
/// Width of the scale.
const SCALE: f64 = WIDTH - 2.0 * LEFT;
/// Height of a row.
const ROW: f64 = 41.0;
/// Narrowest part that holds its letter.
const LETTER: f64 = 12.0;
/// Characters of a row's name beside its share of failures.
const NAME: usize = 26;

/// A bar: its name, what its judge counted, and of how many races.
pub(in crate::race) struct Row<'a> {
    /// Whose races.
    pub(in crate::race) name: String,
    /// The verdicts on them.
    pub(in crate::race) judged: &'a JudgedRecord,
    /// Races over all noise seeds.
    pub(in crate::race) races: u64,
}

/// The classes, as a legend shows them.
pub(in crate::race) fn legend() -> Vec<(Swatch, String)> {
    let classes = CLASSES.iter().map(|&class| {
        let Mark { letter, style } = verdicts::mark(class);
        let swatch = format!(
            "<path class=\"part {style}\" d=\"M-14-7H14V7H-14Z\"/>\
             <path class=\"weave {style}\" d=\"M-14-7H14V7H-14Z\"/>\
             <text class=\"letter\" text-anchor=\"middle\" y=\"4.5\">{letter}</text>"
        );
        (Swatch::Mark(swatch), verdicts::class(class).to_owned())
    });
    classes.collect()
}

/// A bar per row over a scale in percent; `description` is read out in its place.
pub(in crate::race) fn panel<'a>(rows: impl Iterator<Item = Row<'a>>, description: &str) -> String {
    let mut sheet = Sheet::default();
    let mut top = 2.0;
    for row in rows {
        let races = row.races.max(1) as f64;
        let lost: u64 = CLASSES.iter().map(|&class| verdicts::failures(row.judged, class)).sum();
        let text = format!("lost {}", percent(lost as f64 / races));
        sheet.text("name", [LEFT, top + 12.0], Anchor::Start, &shorten(&row.name, NAME));
        sheet.text("tick", [LEFT + SCALE, top + 12.0], Anchor::End, &text);
        stack(&mut sheet, top + 17.0, row.judged, races);
        top += ROW;
    }
    scale(&mut sheet, top + 10.0);
    sheet.finish(top + 18.0, description)
}

/// Ticks below the rows.
fn scale(sheet: &mut Sheet, base: f64) {
    for tick in [0, 20, 40, 60, 80, 100] {
        let at = LEFT + SCALE * f64::from(tick) / 100.0;
        let label = if tick == 100 { "100 %".to_owned() } else { tick.to_string() };
        let (at, anchor) = match tick {
            100 => (at + LEFT, Anchor::End),
            _ => (at, Anchor::Middle),
        };
        sheet.text("tick", [at, base], anchor, &label);
    }
}

/// The classes side by side, each in its colour and pattern, with its letter where it fits.
fn stack(sheet: &mut Sheet, top: f64, judged: &JudgedRecord, races: f64) {
    let bottom = top + 17.0;
    sheet.area("track", [LEFT, top, LEFT + SCALE, bottom]);
    let mut lost = 0;
    for class in CLASSES {
        let before = LEFT + SCALE * (lost as f64 / races).min(1.0);
        lost += verdicts::failures(judged, class);
        let after = LEFT + SCALE * (lost as f64 / races).min(1.0);
        if after > before {
            let Mark { letter, style } = verdicts::mark(class);
            sheet.area(&format!("part {style}"), [before, top, after, bottom]);
            sheet.area(&format!("weave {style}"), [before, top, after, bottom]);
            if after - before >= LETTER {
                let middle = (before + after) / 2.0;
                sheet.text("letter", [middle, top + 13.0], Anchor::Middle, letter);
            }
        }
    }
}
