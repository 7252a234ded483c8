//! The rounds of local growth: radius tried and failures.

use crate::report::figure::{Figure, Swatch, cross, dot};
use crate::report::growth::caption;
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::span::Span;
use crate::report::text::{count, lower, ordinary};
use crate::report::words;
use crate::scenario::record::Record;

const NEAREST: &str = "<path class=\"nearest\" d=\"M-9 0H9\"/>";

/// The figure.
pub(super) fn figure(record: &Record) -> Figure {
    let growth = &record.growth;
    let drawing = if growth.rounds.is_empty() {
        Err("No round of growth was run.".to_owned())
    } else {
        Ok(drawing(record))
    };
    let [accepted, refused, nearest] = match &growth.upward {
        None => {
            ["round without failure", "round with failures", "nearest failure: the next radius"]
        }
        Some(_) => ["round accepted", "round refused", "nearest failure"],
    };
    let (rounds, allowed) = (&growth.rounds, allowed(record));
    let drawn = [
        (dot(5.0), accepted, rounds.iter().any(|round| round.failures <= allowed)),
        (cross(4.0), refused, rounds.iter().any(|round| round.failures > allowed)),
        (NEAREST.to_owned(), nearest, rounds.iter().any(|round| round.nearest_failure.is_some())),
    ];
    let drawn = drawn.into_iter().filter(|(_, _, drawn)| *drawn);
    let legend = drawn.map(|(mark, name, _)| (Swatch::Mark(mark), name.to_owned())).collect();
    Figure {
        id: "figure-growth",
        title: "Rounds of local growth".to_owned(),
        drawing,
        legend,
        caption: caption(record),
    }
}

/// Failures with which a round is accepted.
fn allowed(record: &Record) -> u64 {
    record.growth.upward.as_ref().map_or(0, |upward| upward.allowed)
}

fn drawing(record: &Record) -> String {
    let rounds = &record.growth.rounds;
    let radii = rounds.iter().flat_map(|round| [Some(round.radius), round.nearest_failure]);
    let highest = Span::of(radii.flatten().chain([0.0])).map_or(0.0, |span| span.high);
    let x = Span { low: 0.5, high: rounds.len() as f64 + 0.5 };
    let y = Span { low: 0.0, high: if highest > 0.0 { 1.18 * highest } else { 1.0 } };
    let allowed = allowed(record);
    let mut plot = Plot::new("growth", x, y, Proportions::Free(190.0));
    for (index, round) in rounds.iter().enumerate() {
        let at = index as f64 + 1.0;
        let stem = plot.line([[at, 0.0], [at, round.radius]]);
        plot.path("stem", &stem);
        if let Some(nearest) = round.nearest_failure.filter(|&nearest| ordinary(nearest)) {
            plot.mark([at, nearest], NEAREST);
        }
        let mark = if round.failures <= allowed { dot(6.0) } else { cross(5.0) };
        // Beyond eight rounds only the failures fit above a mark.
        let label = if rounds.len() > 8 {
            count(round.failures)
        } else {
            format!("{}/{}", count(round.failures), count(round.scenarios))
        };
        plot.mark(
            [at, round.radius],
            &format!(
                "<title>round {}: radius {}, {} failures among {}</title>{mark}\
                 <text class=\"tick\" y=\"-11\" text-anchor=\"middle\">{label}</text>",
                index + 1,
                lower(round.radius),
                count(round.failures),
                count(round.scenarios)
            ),
        );
    }
    let unit = words::radius_unit(record);
    let labels = Labels { x: "round", y: &format!("radius tried ({unit})"), whole: true };
    plot.finish(&labels, &description(record))
}

fn description(record: &Record) -> String {
    let rounds = record.growth.rounds.iter().map(|round| {
        let radius = lower(round.radius);
        format!("radius {radius} with {} failures", round.failures)
    });
    format!("Rounds of growth: {}.", rounds.collect::<Vec<_>>().join(", then "))
}
