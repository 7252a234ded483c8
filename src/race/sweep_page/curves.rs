//! Curves over an axis of numbers, with bands around them.

use super::chart::Chart;
use super::lines::{self, Shown};
use super::readings::Reading;
use crate::report::plot::{Labels, Plot};
use crate::report::scale::Scale;
use crate::report::sheet::WIDTH;
use crate::report::span::Span;
use crate::report::text::escape;

/// Most lines whose bands are filled; those of more would hide each other.
pub(super) const FILLED: usize = 3;
/// Width and height of a lone plot, and of one of several panels.
const SIZES: [[f64; 2]; 2] = [[440.0, 280.0], [WIDTH, 210.0]];
/// Most lines, and characters of each, that are named beside their end.
const NAMED: [usize; 2] = [5, 9];
/// Distance of two ticks upwards, about.
const TICK: f64 = 40.0;
/// Least distance of two names beside each other.
const APART: f64 = 14.0;
/// Shift between neighbouring lines, where their intervals would hide each other.
const SHIFT: f64 = 2.6;

/// The curves of one panel.
pub(super) fn panel(chart: &Chart<'_, '_, '_>, panel: Option<usize>, number: usize) -> String {
    let (names, values) = (names(chart), values(chart));
    let longest = names.iter().map(|name| name.chars().count()).max();
    let right = longest.map_or(0.0, |longest| 4.0 + 7.6 * longest as f64);
    let [width, height] = SIZES[usize::from(panel.is_some())];
    let x = across(&values);
    let axes = [x.axis_at(values.clone()), chart.scale.axis(height / TICK)];
    let id = format!("{}-{number}", chart.measure.id);
    let mut plot = Plot::ticked(&id, axes, height, [width, right]);
    let mut ends = Vec::new();
    for (index, line) in chart.layout.line_places().into_iter().enumerate() {
        let readings = chart.layout.readings(chart.measure, line, panel);
        let shift = shift(chart, index) / plot.lengths(1.0)[0];
        let places = values.iter().map(|(value, _)| x.place(*value) + shift);
        let curve = Curve { chart, index, points: places.zip(readings).collect() };
        curve.draw(&mut plot);
        if let (Some(name), Some(end)) = (names.get(index), curve.end()) {
            ends.push(End { down: plot.down(end), index, name });
        }
    }
    ceiling(chart, &mut plot, x.span());
    beside(&mut plot, ends, height);
    let (across, description) = (chart.across(), chart.description(panel));
    let labels = Labels { x: &across, y: chart.measure.label, whole: false };
    plot.finish(&labels, &description)
}

/// The values across, with their texts.
fn values(chart: &Chart<'_, '_, '_>) -> Vec<(f64, String)> {
    let axes = &chart.layout.slice.grid.axes;
    let values = chart.layout.across.map_or(&[][..], |axis| &axes[axis].values);
    values.iter().filter_map(|(text, number)| Some(((*number)?, (*text).to_owned()))).collect()
}

/// The scale across: of all values of the axis.
fn across(values: &[(f64, String)]) -> Scale {
    let numbers: Vec<f64> = values.iter().map(|(number, _)| *number).collect();
    Scale::fitting(&numbers).unwrap_or(Scale::linear(0.0, 1.0))
}

/// Names of the lines, where they are few and short; else none.
fn names(chart: &Chart<'_, '_, '_>) -> Vec<String> {
    let Some(Shown { axis, places }) = &chart.layout.lines else {
        return Vec::new();
    };
    let axis = &chart.layout.slice.grid.axes[*axis];
    let mut names: Vec<_> = places.iter().map(|&place| axis.value(place)).collect();
    let [most, longest] = NAMED;
    if names.len() > most || names.iter().any(|name| name.chars().count() > longest) {
        names.clear();
    }
    names
}

/// How far line `index` stands beside its values: nowhere, while the bands are filled.
fn shift(chart: &Chart<'_, '_, '_>, index: usize) -> f64 {
    let lines = chart.layout.line_places().len();
    let middle = (lines - 1) as f64 / 2.0;
    if lines <= FILLED { 0.0 } else { SHIFT * (index as f64 - middle) }
}

/// One line of a panel.
struct Curve<'c, 'g, 'a> {
    chart: &'c Chart<'c, 'g, 'a>,
    index: usize,
    /// Places across with what was read there.
    points: Vec<(f64, Option<Reading>)>,
}

impl Curve<'_, '_, '_> {
    fn draw(&self, plot: &mut Plot) {
        let hue = format!("hue-{}", self.index);
        let filled = self.chart.layout.line_places().len() <= FILLED;
        if filled {
            self.fill(plot, &format!("band {hue}"));
        }
        for (band, class) in ["inner", "outer"].into_iter().enumerate() {
            self.reach(plot, band, &format!("reach {class} {hue}"));
        }
        let scale = self.chart.scale;
        let place = |(x, reading): &(f64, Option<Reading>)| {
            [*x, reading.as_ref().map_or(f64::NAN, |reading| scale.place(reading.value))]
        };
        let line = plot.line(self.points.iter().map(place));
        plot.path(lines::class(self.index), &line);
        for point in self.points.iter().map(place) {
            plot.mark(point, &lines::mark(self.index));
        }
    }

    /// The narrowest band between neighbours that both have one.
    fn fill(&self, plot: &mut Plot, class: &str) {
        let mut data = String::new();
        for pair in self.points.windows(2) {
            let [(x0, left), (x1, right)] = pair else { continue };
            if let (Some(left), Some(right)) = (self.band(left, 0), self.band(right, 0)) {
                let corners = [[*x0, left[0]], [*x1, right[0]], [*x1, right[1]], [*x0, left[1]]];
                data += &plot.polygon(corners);
            }
        }
        plot.path(class, &data);
    }

    /// Each interval as an upright line.
    fn reach(&self, plot: &mut Plot, band: usize, class: &str) {
        let reaches = self.points.iter().filter_map(|(x, reading)| {
            let [low, high] = self.band(reading, band)?;
            Some(plot.line([[*x, low], [*x, high]]))
        });
        let data: String = reaches.collect();
        plot.path(class, &data);
    }

    /// A band of a reading, in places.
    fn band(&self, reading: &Option<Reading>, band: usize) -> Option<[f64; 2]> {
        let band = reading.as_ref()?.bands.get(band)?;
        Some(band.map(|end| self.chart.scale.place(end)))
    }

    /// The place of the last value, if the line goes that far.
    fn end(&self) -> Option<f64> {
        let (_, last) = self.points.last()?;
        last.as_ref().map(|last| self.chart.scale.place(last.value))
    }
}

fn ceiling(chart: &Chart<'_, '_, '_>, plot: &mut Plot, Span { low, high }: Span) {
    if let Some(limit) = chart.limit() {
        let place = chart.scale.place(limit);
        let line = plot.line([[low, place], [high, place]]);
        plot.path("ceiling", &line);
    }
}

/// Where a line ends, which is named there.
struct End<'a> {
    /// How far down.
    down: f64,
    /// Number of the line.
    index: usize,
    name: &'a str,
}

/// Names beside the ends of their lines, apart from each other.
fn beside(plot: &mut Plot, mut ends: Vec<End<'_>>, height: f64) {
    ends.sort_by(|a, b| a.down.total_cmp(&b.down));
    let mut free = f64::NEG_INFINITY;
    for End { down, .. } in &mut ends {
        *down = down.max(free);
        free = *down + APART;
    }
    let mut free = height + APART;
    for End { down, .. } in ends.iter_mut().rev() {
        *down = down.min(free);
        free = *down - APART;
    }
    for End { down, index, name } in ends {
        let name = escape(name);
        plot.beside(down + 4.0, &format!("<text class=\"end hue-{index}\">{name}</text>"));
    }
}
