//! A heat map over two parameters: one cell per point, its value written in it.

use super::grid::{Axis, Grid, Slice};
use super::readings::Measure;
use crate::report::figure::{Figure, Swatch};
use crate::report::palette::{self, LEVELS};
use crate::report::plot::{self, Labels, Plot, coordinate};
use crate::report::span::Span;
use crate::report::text::shorten;
use crate::report::ticks;

/// Width of the drawing.
const WIDTH: f64 = 440.0;
/// Height of a row, at most, and of all rows, at least and at most.
const HEIGHTS: [f64; 3] = [44.0, 130.0, 330.0];
/// Room for the colour bar.
const FOOT: f64 = 62.0;
/// Height of the colour bar.
const BAR: f64 = 12.0;
/// Values closer than this are one colour, percent.
const EQUAL: f64 = 1e-3;
/// Characters of a value beside a row.
const NAME: usize = 8;
/// Characters of a name in the title.
const TITLE: usize = 40;
/// Width of a character, at most, and least height of a cell with a number in it.
const TEXT: [f64; 2] = [7.4, 16.2];

/// The figure, for a grid with two numeric parameters of at least two values each.
pub(super) fn figure(grid: &Grid<'_>, measure: &Measure) -> Option<Figure> {
    let [x, y, ..] = grid.numeric()[..] else {
        return None;
    };
    let map = Map { slice: grid.slice(&[x, y]), x: &grid.axes[x], y: &grid.axes[y], measure };
    let absent = map.cells().iter().any(|(_, value)| value.is_none());
    let legend =
        if absent { vec![(Swatch::Area("cell nf"), "not run".to_owned())] } else { vec![] };
    let drawn = map.limits().map(|limits| map.drawing(limits));
    Some(Figure {
        id: "figure-heat",
        title: format!("{} over {} and {}", measure.title, named(map.x), named(map.y)),
        drawing: drawn.ok_or_else(|| "No point of this slice was measured.".to_owned()),
        legend,
        caption: format!(
            "{} Cells are of one size: neither axis is to scale.{}",
            measure.caption,
            map.slice.held()
        ),
    })
}

/// The name of an axis, short enough for a title.
fn named(axis: &Axis<'_>) -> String {
    shorten(axis.name, TITLE)
}

/// Two axes and what is shown of their points.
struct Map<'m, 'a> {
    slice: Slice<'m, 'a>,
    x: &'m Axis<'a>,
    y: &'m Axis<'a>,
    measure: &'m Measure,
}

impl Map<'_, '_> {
    /// The value at every column and row; none where nothing was measured.
    fn cells(&self) -> Vec<([usize; 2], Option<f64>)> {
        let rows = 0..self.y.values.len();
        let places = rows.flat_map(|row| (0..self.x.values.len()).map(move |column| [column, row]));
        let value = |places: [usize; 2]| {
            let point = self.slice.at(&places)?;
            (self.measure.read)(self.slice.grid.record, point).map(|reading| reading.value)
        };
        places.map(|places| (places, value(places))).collect()
    }

    /// What the colours end at: round values around those shown.
    fn limits(&self) -> Option<Span> {
        Span::of(self.cells().into_iter().filter_map(|(_, value)| value)).map(outward)
    }

    fn drawing(&self, limits: Span) -> String {
        let rows = self.y.values.len();
        let [row, least, most] = HEIGHTS;
        let height = (row * rows as f64).clamp(least, most);
        let axes = [self.x, self.y].map(places);
        let mut plot = Plot::ticked("heat", axes, height, [WIDTH, 0.0]);
        let [width, tall] = plot.lengths(1.0);
        for ([column, row], value) in self.cells() {
            let (x, y) = (column as f64, row as f64);
            let class = value.map_or_else(|| "nf".to_owned(), |value| palette::even(value, limits));
            let data = plot.rectangle([x - 0.5, y - 0.5, x + 0.5, y + 0.5]);
            plot.path(&format!("cell {class}"), &data);
            let text = value.and_then(|value| written(value, [width, tall]));
            if let Some(text) = text {
                plot.mark(
                    [x, y],
                    &format!(
                        "<text class=\"on {class}\" y=\"4.3\" text-anchor=\"middle\">{text}</text>"
                    ),
                );
            }
        }
        plot.strip(FOOT, |width| bar(width, limits, self.measure.label));
        let [x, y] = [self.x, self.y].map(Axis::label);
        let description = format!("{} over {x} and {y}", self.measure.title);
        plot.finish(&Labels { x: &x, y: &y, whole: false }, &description)
    }
}

/// The span up to the next round values; a whole one, up to its value, where all are equal.
fn outward(span: Span) -> Span {
    if span.width() < EQUAL {
        return Span { low: (span.low - 1.0).max(0.0), high: span.low.max(1.0) };
    }
    let ticks = span.ticks(5.0).values;
    let step = ticks.windows(2).next().map_or(span.width(), |pair| pair[1] - pair[0]);
    Span { low: (span.low / step).floor() * step, high: (span.high / step).ceil() * step }
}

/// An axis with one place per value.
fn places(axis: &Axis<'_>) -> plot::Axis {
    let ticks = axis.texts(NAME).into_iter().enumerate();
    let ticks = ticks.map(|(place, text)| (place as f64, text));
    let high = axis.values.len() as f64 - 0.5;
    plot::Axis { span: Span { low: -0.5, high }, ticks: ticks.collect() }
}

/// The value as it fits into a cell, with a decimal if there is room for it.
fn written(value: f64, [width, height]: [f64; 2]) -> Option<String> {
    let fits = |text: &String| TEXT[0] * text.chars().count() as f64 <= width && height >= TEXT[1];
    [format!("{value:.1}"), format!("{value:.0}")].into_iter().find(fits)
}

/// The colour bar, from its lower to its upper end.
fn bar(width: f64, limits: Span, label: &str) -> String {
    let step = width / LEVELS as f64;
    let mut bar = String::new();
    for level in 1..=LEVELS {
        let (from, wide) = (coordinate((level - 1) as f64 * step), coordinate(step + 0.3));
        bar += &format!("<path class=\"cell p{level}\" d=\"M{from} 4h{wide}v{BAR}h-{wide}Z\"/>");
    }
    for (value, text) in ticks::round(limits, 5.0) {
        let at = coordinate(width * (value - limits.low) / limits.width());
        let low = 4.0 + BAR;
        bar += &format!(
            "<path class=\"tick-mark\" d=\"M{at} {low}v4\"/>\
             <text class=\"tick\" x=\"{at}\" y=\"{}\" text-anchor=\"middle\">{text}</text>",
            low + 17.0
        );
    }
    let (middle, base) = (coordinate(width / 2.0), 4.0 + BAR + 36.0);
    bar + &format!(
        "<text class=\"name\" x=\"{middle}\" y=\"{base}\" text-anchor=\"middle\">{label}</text>"
    )
}
