//! Success rates: a bar per controller, the published rate beside it, the ceiling as a line.

use super::verdicts;
use super::words;
use crate::race::judge::Judge;
use crate::race::record::{ControllerRecord, JudgedRecord, PublishedRecord, RaceRecord};
use crate::report::figure::{Figure, Swatch};
use crate::report::sheet::{Anchor, Sheet, WIDTH, panels};
use crate::report::text::{most_percent, ordinary, percent, percents, shorten};

/// Left end of the scale.
const LEFT: f64 = 8.0;
/// Width of the scale; the rates stand right of it.
const SCALE: f64 = 250.0;
/// Characters of a controller's name beside its interval.
const NAME: usize = 22;
/// Height of a row where no published rate is known, and where one is.
const ROWS: [f64; 2] = [37.0, 53.0];
const PUBLISHED: &str = "<path class=\"published\" d=\"M0-4.2L4.2 0L0 4.2L-4.2 0Z\"/>";
const BAR: &str = "<path class=\"bar\" d=\"M-14-5.5H6V5.5H-14Z\"/>";
const RATE: &str = "<circle class=\"mean\" r=\"2.9\"/>";
const WHISKER: &str = "<path class=\"whisker\" d=\"M6 5V11M6 8H26M26 5V11\"/>";

/// One panel per judge.
pub(super) fn figure(record: &RaceRecord) -> Figure {
    let judges = words::judges(record);
    let drawn: Vec<_> = judges
        .iter()
        .filter(|&&judge| words::verdicts(record, judge).next().is_some())
        .map(|&judge| (format!("{} judge", judge.name()), panel(record, judge)))
        .collect();
    Figure {
        id: "figure-success",
        title: "Races won".to_owned(),
        drawing: if drawn.is_empty() {
            Err("No controller was judged.".to_owned())
        } else {
            Ok(panels(&drawn))
        },
        legend: legend(record),
        caption: caption(record, &judges),
    }
}

fn legend(record: &RaceRecord) -> Vec<(Swatch, String)> {
    let seeds = record.noise_seeds.len();
    let rate = match seeds {
        1 => "success rate with the one noise seed".to_owned(),
        _ => format!("mean success rate over {seeds} noise seeds"),
    };
    let mut legend = vec![
        (Swatch::Mark(format!("{BAR}<g transform=\"translate(6 0)\">{RATE}</g>")), rate),
        (Swatch::Mark(shifted(WHISKER)), "95 % interval of the first seed's run".to_owned()),
    ];
    if any_published(record) {
        let name = "published rate with its 95 % interval".to_owned();
        legend.push((Swatch::Marked("published-line", PUBLISHED.to_owned()), name));
    }
    if !record.starts.ceilings.is_empty() {
        let name = "ceiling: starts that are safe before anyone moves".to_owned();
        legend.push((Swatch::Mark("<path class=\"ceiling\" d=\"M0-8V8\"/>".to_owned()), name));
    }
    legend
}

fn any_published(record: &RaceRecord) -> bool {
    let mut judged = record.controllers.iter().flat_map(|controller| &controller.judged);
    judged.any(|judged| judged.published.is_some())
}

/// A drawing made for the corner of a swatch, around its middle.
fn shifted(drawing: &str) -> String {
    format!("<g transform=\"translate(-16 -8)\">{drawing}</g>")
}

fn caption(record: &RaceRecord, judges: &[Judge]) -> String {
    let rules = judges.iter().map(|&judge| {
        let ceiling = words::ceiling(record, judge).map_or_else(String::new, |ceiling| {
            format!(", under which at most {} of the races can be won", most_percent(ceiling.share))
        });
        format!("The {} judge applies {}{ceiling}.", judge.name(), verdicts::rules(judge))
    });
    rules.collect::<Vec<_>>().join(" ")
}

fn panel(record: &RaceRecord, judge: Judge) -> String {
    let mut sheet = Sheet::default();
    let ceiling = words::ceiling(record, judge).map(|ceiling| ceiling.share);
    // One height for all judges, so that a controller's bars stand side by side.
    let height = ROWS[usize::from(any_published(record))];
    let mut top = 4.0;
    if let Some(share) = ceiling {
        let text = format!("ceiling {}", most_percent(share));
        sheet.text("tick", [across(share), 12.0], Anchor::End, &text);
        top = 18.0;
    }
    for (controller, judged) in words::verdicts(record, judge) {
        row(&mut sheet, top, controller, judged);
        if let Some(share) = ceiling {
            sheet.upright("ceiling", across(share), [top + 16.0, top + bottom(judged) + 2.0]);
        }
        top += height;
    }
    scale(&mut sheet, top);
    let description = format!("Success rates under the {} judge", judge.name());
    sheet.finish(top + 22.0, &description)
}

/// Where a share lies on the scale.
fn across(share: f64) -> f64 {
    LEFT + SCALE * if ordinary(share) { share.clamp(0.0, 1.0) } else { 0.0 }
}

/// Lower end of a row's bars.
fn bottom(judged: &JudgedRecord) -> f64 {
    if judged.published.is_some() { 43.0 } else { 29.0 }
}

/// Name and interval, then the bar with its rate, then the published rate.
fn row(sheet: &mut Sheet, top: f64, controller: &ControllerRecord, judged: &JudgedRecord) {
    let (bar, line) = ([top + 18.0, top + 29.0], top + 23.5);
    sheet.text("name", [LEFT, top + 12.0], Anchor::Start, &shorten(&controller.name, NAME));
    sheet.text("tick", [WIDTH - 4.0, top + 12.0], Anchor::End, &percents(judged.interval));
    sheet.area("track", [across(0.0), bar[0], across(1.0), top + bottom(judged)]);
    sheet.area("bar", [across(0.0), bar[0], across(judged.rate), bar[1]]);
    sheet.whisker("whisker", judged.interval.map(across), line);
    sheet.mark([across(judged.rate), line], RATE);
    sheet.text("rate", [WIDTH - 4.0, line + 4.5], Anchor::End, &percent(judged.rate));
    if let Some(published) = &judged.published {
        published_rate(sheet, line + 14.5, published);
    }
}

fn published_rate(sheet: &mut Sheet, line: f64, published: &PublishedRecord) {
    sheet.whisker("published-line", published.interval.map(across), line);
    sheet.mark([across(published.rate), line], PUBLISHED);
    sheet.text("tick", [WIDTH - 4.0, line + 4.5], Anchor::End, &percent(published.rate));
}

/// Ticks below the rows.
fn scale(sheet: &mut Sheet, top: f64) {
    for tick in [0, 20, 40, 60, 80, 100] {
        let at = across(f64::from(tick) / 100.0);
        sheet.upright("tick-mark", at, [top - 4.0, top]);
        sheet.text("tick", [at, top + 13.0], Anchor::Middle, &tick.to_string());
    }
    sheet.text("tick", [WIDTH - 4.0, top + 13.0], Anchor::End, "% of races");
}
