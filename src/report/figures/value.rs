//! The value slice: `V_check` as a heat map with its zero level.

use super::plane::{lines, no_slice, slice_states};
use crate::report::figure::{Figure, Swatch, diamond};
use crate::report::palette::{self, LEVELS};
use crate::report::places::{point, same_unit};
use crate::report::plot::{Labels, MARGIN, Plot, Proportions, coordinate};
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::report::text::{minus, number, ordinary};
use crate::report::ticks::half;
use crate::report::words;
use crate::scenario::record::Record;

/// Anchor and title of the figure.
const ID: &str = "figure-value";
const TITLE: &str = "Value slice: V_check";
/// Thickness of the colour bar.
const BAR: f64 = 12.0;

/// The figure.
pub(super) fn figure(record: &Record, grid: Option<&Grid>) -> Figure {
    let Some(grid) = grid else {
        let caption = "Tier and V_check of the state are among the numbers below.".to_owned();
        return Figure {
            id: ID,
            title: TITLE.to_owned(),
            drawing: no_slice(record),
            legend: Vec::new(),
            caption,
        };
    };
    let values = &record.slice.check_margin;
    let zero = (Swatch::Line("zero"), "V_check = 0: boundary of the certified set".to_owned());
    let mut legend = Vec::from_iter(grid.field(values, 1.0).has_zero_lines().then_some(zero));
    legend.push((Swatch::Mark(diamond()), "the state that the slice goes through".to_owned()));
    if values.iter().any(|&value| !ordinary(f64::from(value))) {
        legend.push((Swatch::Area("nf"), "not finite: a failure".to_owned()));
    }
    let [x, y] = slice_states(record).map(|state| words::name(record, state));
    let frozen = record.system.states.len().saturating_sub(2);
    let held = match frozen {
        0 => String::new(),
        1 => "; the other coordinate keeps the state's value".to_owned(),
        _ => format!("; the other {frozen} coordinates keep the state's values"),
    };
    Figure {
        id: ID,
        title: TITLE.to_owned(),
        drawing: Ok(drawing(grid)),
        legend,
        caption: format!(
            "Each cell is one rollout from its centre, {}, over {x} and {y}{held}. Blue is certified, \
             orange is not. Only the sign has a meaning: margins mix units.",
            words::tightened(record)
        ),
    }
}

fn drawing(grid: &Grid) -> String {
    let record = grid.record;
    let states = slice_states(record);
    let [mut x, mut y] = grid.spans();
    if let Some([across, up]) = point(&record.state.x, states) {
        x = x.join(Span::of([across]).unwrap_or(x));
        y = y.join(Span::of([up]).unwrap_or(y));
    }
    let shape = if same_unit(&record.system.states, states) {
        Proportions::Equal
    } else {
        Proportions::Free(330.0)
    };
    let mut plot = Plot::new("value", x, y, shape);
    let limit = limit(&record.slice.check_margin);
    for (class, data) in cells(&plot, grid, limit) {
        plot.path(&format!("cell {class}"), &data);
    }
    let zero = lines(&plot, &grid.field(&record.slice.check_margin, 1.0));
    plot.path("zero-halo", &zero);
    plot.path("zero", &zero);
    if let Some(state) = point(&record.state.x, states) {
        plot.mark(state, &diamond());
    }
    plot.strip(BAR + 45.0, |width| bar(width, limit));
    let [x, y] = states.map(|state| words::axis(record, state));
    let labels = Labels { x: &x, y: &y, whole: false };
    plot.finish(&labels, &description(grid))
}

/// Path data of the cells of each colour.
fn cells(plot: &Plot, grid: &Grid, limit: f64) -> std::collections::BTreeMap<String, String> {
    let mut paths = std::collections::BTreeMap::<String, String>::new();
    let values = &grid.record.slice.check_margin;
    for (class, area) in grid.runs(values, |value| palette::class(value, limit)) {
        *paths.entry(class).or_default() += &plot.rectangle(area);
    }
    paths
}

/// What the colours end at on both sides: the largest size drawn, up to two digits.
fn limit(values: &[f32]) -> f64 {
    let sizes = values.iter().map(|&value| f64::from(value).abs());
    let largest = sizes.filter(|&size| ordinary(size)).fold(0.0, f64::max);
    if largest < f64::from(f32::MIN_POSITIVE) {
        return 1.0;
    }
    let digit = 10.0_f64.powf(largest.log10().floor() - 1.0);
    (largest / digit).ceil() * digit
}

/// The colour bar: steps even in the square root of the value.
fn bar(width: f64, limit: f64) -> String {
    let marks = [-1.0, -0.5, 0.0, 0.5, 1.0_f64].map(|position| {
        let text = minus(&number(position * position.abs() * limit));
        (position, text)
    });
    // The labels at its ends have their middle there, and no more room than the axes leave.
    let inset = marks.iter().map(|(_, text)| half(text) - MARGIN).fold(0.0, f64::max);
    let inner = width - 2.0 * inset;
    let mut bar = steps(inner);
    for (position, text) in marks {
        let at = coordinate(inner * (position + 1.0) / 2.0);
        let low = 4.0 + BAR;
        bar += &format!(
            "<path class=\"tick-mark\" d=\"M{at} {low}v4\"/>\
             <text class=\"tick\" x=\"{at}\" y=\"{}\" text-anchor=\"middle\">{text}</text>",
            low + 17.0
        );
    }
    format!(
        "<g transform=\"translate({} 0)\">{bar}<text class=\"name\" x=\"{}\" y=\"{}\" \
         text-anchor=\"middle\">V_check (no unit, square-root scale)</text></g>",
        coordinate(inset),
        coordinate(inner / 2.0),
        4.0 + BAR + 35.0
    )
}

/// The steps of the colour bar.
fn steps(width: f64) -> String {
    let step = width / (2 * LEVELS) as f64;
    let below = (1..=LEVELS).rev().map(|level| format!("n{level}"));
    let above = (1..=LEVELS).map(|level| format!("p{level}"));
    let one = |(index, class): (usize, String)| {
        let (from, wide) = (coordinate(index as f64 * step), coordinate(step + 0.3));
        format!("<path class=\"cell {class}\" d=\"M{from} 4h{wide}v{BAR}h-{wide}Z\"/>")
    };
    below.chain(above).enumerate().map(one).collect()
}

fn description(grid: &Grid) -> String {
    let values = &grid.record.slice.check_margin;
    let positive = values.iter().filter(|&&value| value > 0.0).count();
    let [x, y] = slice_states(grid.record).map(|state| words::axis(grid.record, state));
    format!(
        "Heat map of V_check over {x} and {y}: {positive} of {} cells are positive.",
        values.len()
    )
}
