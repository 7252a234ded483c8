//! Rows over an axis of words: a mark with its intervals for each value and line.

use super::chart::Chart;
use super::lines;
use crate::report::plot::{Axis, Labels, Plot};
use crate::report::sheet::WIDTH;
use crate::report::span::Span;

/// Width of a lone plot, and of one of several panels.
const WIDTHS: [f64; 2] = [440.0, WIDTH];
/// Characters of a row's name in either.
const NAMES: [usize; 2] = [18, 12];
/// Least height of the axes, for the name beside them.
const LEAST: f64 = 66.0;
/// Height of a row, and of each line in it.
const ROW: [f64; 2] = [16.0, 12.0];

/// The rows of one panel, from top to bottom.
pub(super) fn panel(chart: &Chart<'_, '_, '_>, panel: Option<usize>, number: usize) -> String {
    let layout = chart.layout;
    let (count, places) = (layout.length(), layout.line_places());
    let height = ((ROW[0] + ROW[1] * places.len() as f64) * count as f64).max(LEAST);
    let width = WIDTHS[usize::from(panel.is_some())];
    let limit = NAMES[usize::from(panel.is_some())];
    let names = layout.across.map(|axis| layout.slice.grid.axes[axis].texts(limit));
    let name = |row: usize| names.as_ref().map_or_else(String::new, |names| names[row].clone());
    let middle = |row: usize| (count - row) as f64 - 0.5;
    let rows = Axis {
        span: Span { low: 0.0, high: count as f64 },
        ticks: (0..count).rev().map(|row| (middle(row), name(row))).collect(),
    };
    let id = format!("{}-{number}", chart.measure.id);
    let mut plot = Plot::ticked(&id, [chart.scale.axis(5.0), rows], height, [width, 0.0]);
    for (index, line) in places.iter().enumerate() {
        let shift = (places.len() as f64 - 1.0) / 2.0 - index as f64;
        let shift = shift * ROW[1] / plot.lengths(1.0)[1];
        for (row, reading) in layout.readings(chart.measure, *line, panel).iter().enumerate() {
            let Some(reading) = reading else { continue };
            let up = middle(row) + shift;
            for (band, class) in reading.bands.iter().zip(["inner", "outer"]) {
                let line = plot.line(band.map(|end| [chart.scale.place(end), up]));
                plot.path(&format!("reach {class} hue-{index}"), &line);
            }
            plot.mark([chart.scale.place(reading.value), up], &lines::mark(index));
        }
    }
    if let Some(limit) = chart.limit() {
        let at = chart.scale.place(limit);
        let line = plot.line([[at, 0.0], [at, count as f64]]);
        plot.path("ceiling", &line);
    }
    let (across, description) = (chart.across(), chart.description(panel));
    let labels = Labels { x: chart.measure.label, y: &across, whole: false };
    plot.finish(&labels, &description)
}
