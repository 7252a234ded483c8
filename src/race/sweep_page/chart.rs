//! A measure of the points along an axis: curves over numbers, rows over words.

use super::curves;
use super::grid::Grid;
use super::lines::{self, Layout};
use super::readings::{Measure, Range};
use super::rows;
use crate::report::figure::{Figure, Swatch};
use crate::report::scale::Scale;
use crate::report::sheet::panels;
use crate::report::text::{most_percent, number};

/// Axes that a figure has room for: across, lines, panels.
const DEPTH: usize = 3;
/// Classes of the intervals, the narrowest first.
const REACHES: [&str; 2] = ["reach inner", "reach outer"];

/// A chart: what it shows, and its scale.
pub(super) struct Chart<'c, 'g, 'a> {
    /// The points and how they are laid out.
    pub(super) layout: &'c Layout<'g, 'a>,
    /// What is shown of them.
    pub(super) measure: &'c Measure,
    /// Its scale, the same for all panels.
    pub(super) scale: Scale,
    /// Most that can be reached, as a share.
    pub(super) ceiling: Option<f64>,
}

/// The figure of a measure; `ceiling` is the share that cannot be exceeded.
pub(super) fn figure(grid: &Grid<'_>, measure: &Measure, ceiling: Option<f64>) -> Figure {
    let layout = Layout::new(grid, DEPTH);
    let chart =
        scale(&layout, measure).map(|scale| Chart { layout: &layout, measure, scale, ceiling });
    let constant = constant(&layout, measure);
    let drawn = chart.as_ref().filter(|_| constant.is_none());
    Figure {
        id: measure.id,
        title: measure.title.to_owned(),
        legend: drawn.map_or_else(Vec::new, legend),
        caption: caption(&layout, measure, drawn),
        drawing: match (&chart, constant) {
            (Some(_), Some(value)) => {
                Err(format!("The same at all points shown: {}, {}.", measure.label, number(value)))
            }
            (Some(chart), None) => Ok(drawing(chart)),
            (None, _) => Err("Nothing of this was measured.".to_owned()),
        },
    }
}

/// The value that all of several points have, with the same intervals: nothing to be drawn.
fn constant(layout: &Layout<'_, '_>, measure: &Measure) -> Option<f64> {
    let places = layout.panel_places().into_iter();
    let readings = places.flat_map(|panel| {
        let lines = layout.line_places().into_iter();
        lines.flat_map(move |line| layout.readings(measure, line, panel))
    });
    let readings: Vec<_> = readings.flatten().map(|read| (read.value, read.bands)).collect();
    let (first, rest) = readings.split_first()?;
    (!rest.is_empty() && rest.iter().all(|other| other == first)).then_some(first.0)
}

/// One scale for everything that is shown; `None` without a value.
fn scale(layout: &Layout<'_, '_>, measure: &Measure) -> Option<Scale> {
    let mut values = Vec::new();
    for panel in layout.panel_places() {
        for line in layout.line_places() {
            for reading in layout.readings(measure, line, panel).into_iter().flatten() {
                values.push(reading.value);
                values.extend(reading.bands.into_iter().flatten());
            }
        }
    }
    match measure.range {
        Range::Percent => (!values.is_empty()).then(|| Scale::linear(0.0, 100.0)),
        Range::FromZero => Scale::from_zero(&values),
        Range::Log => Scale::log(&values),
        Range::Fitting => Scale::fitting(&values),
    }
}

fn drawing(chart: &Chart<'_, '_, '_>) -> String {
    let one = |panel: Option<usize>, number: usize| {
        if chart.over_numbers() {
            curves::panel(chart, panel, number)
        } else {
            rows::panel(chart, panel, number)
        }
    };
    let places = chart.layout.panel_places();
    if let [None] = places[..] {
        return one(None, 0);
    }
    let drawn = places
        .into_iter()
        .enumerate()
        .map(|(number, place)| (chart.panel_title(place), one(place, number)));
    panels(&drawn.collect::<Vec<_>>())
}

impl Chart<'_, '_, '_> {
    /// Whether the axis across is one of numbers.
    fn over_numbers(&self) -> bool {
        let axes = &self.layout.slice.grid.axes;
        self.layout.across.is_some_and(|axis| axes[axis].is_numeric())
    }

    /// Name of the axis across.
    pub(super) fn across(&self) -> String {
        let axes = &self.layout.slice.grid.axes;
        self.layout.across.map_or_else(String::new, |axis| axes[axis].label())
    }

    /// Title of a panel; empty for a lone one.
    fn panel_title(&self, panel: Option<usize>) -> String {
        self.layout.named(self.layout.panels.as_ref(), panel)
    }

    /// What is read out in place of a panel.
    pub(super) fn description(&self, panel: Option<usize>) -> String {
        let comma = if panel.is_some() { ", " } else { "" };
        let panel = self.panel_title(panel);
        format!("{} against {}{comma}{panel}", self.measure.title, self.across())
    }

    /// The ceiling in the unit of the measure.
    pub(super) fn limit(&self) -> Option<f64> {
        self.ceiling.map(|share| 100.0 * share)
    }
}

fn legend(chart: &Chart<'_, '_, '_>) -> Vec<(Swatch, String)> {
    let joined = chart.over_numbers();
    let mut legend = chart.layout.legend(|index| match joined {
        true => Swatch::Marked(lines::class(index), lines::mark(index)),
        false => Swatch::Mark(lines::mark(index)),
    });
    let filled = joined && chart.layout.line_places().len() <= curves::FILLED;
    for (class, name) in REACHES.iter().zip(chart.measure.bands) {
        let swatch = match filled && *class == REACHES[0] {
            true => Swatch::Area("band"),
            false => Swatch::Line(class),
        };
        legend.push((swatch, (*name).to_owned()));
    }
    if let Some(share) = chart.ceiling {
        let name = format!("most that can be won: {}", most_percent(share));
        legend.push((Swatch::Line("ceiling"), name));
    }
    legend
}

fn caption(
    layout: &Layout<'_, '_>,
    measure: &Measure,
    chart: Option<&Chart<'_, '_, '_>>,
) -> String {
    let mut caption = measure.caption.to_owned();
    if let Some(chart) = chart {
        if chart.over_numbers() && layout.length() > 1 {
            caption +=
                " Points alone were computed: lines and areas between them only lead the eye.";
        }
        if chart.scale.is_log() {
            caption += " The scale of the values is logarithmic.";
        }
        if chart.over_numbers() && layout.line_places().len() > curves::FILLED {
            caption += " What belongs to one value across stands side by side.";
        }
    }
    caption + &layout.left_out()
}
