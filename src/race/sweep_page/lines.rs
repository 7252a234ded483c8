//! How a figure lays the points out: along an axis, as lines with colours and marks, in panels.

use super::grid::{Grid, Slice, spread};
use super::readings::{Measure, Reading};
use crate::report::figure::Swatch;

/// Most lines of a figure, and most panels.
const MOST: usize = 6;

/// Classes of the lines.
const LINES: [&str; MOST] =
    ["line hue-0", "line hue-1", "line hue-2", "line hue-3", "line hue-4", "line hue-5"];
/// Their marks, around the origin; the first, as round as eight corners are.
const MARKS: [&str; MOST] = [
    "M3.7 0L2.6 2.6L0 3.7L-2.6 2.6L-3.7 0L-2.6-2.6L0-3.7L2.6-2.6Z",
    "M-3.2-3.2H3.2V3.2H-3.2Z",
    "M0-4.6L4.6 0L0 4.6L-4.6 0Z",
    "M0-4.3L4.3 3.4H-4.3Z",
    "M0 4.3L4.3-3.4H-4.3Z",
    "M-1.5-4.2H1.5V-1.5H4.2V1.5H1.5V4.2H-1.5V1.5H-4.2V-1.5H-1.5Z",
];

/// The class of line `index`.
pub(super) fn class(index: usize) -> &'static str {
    LINES[index.min(MOST - 1)]
}

/// The mark of line `index`.
pub(super) fn mark(index: usize) -> String {
    let index = index.min(MOST - 1);
    format!("<path class=\"spot hue-{index}\" d=\"{}\"/>", MARKS[index])
}

/// An axis and the places along it that are shown.
pub(super) struct Shown {
    /// The axis.
    pub(super) axis: usize,
    /// The places.
    pub(super) places: Vec<usize>,
}

/// Which axes a figure shows: across, as lines, as panels.
pub(super) struct Layout<'g, 'a> {
    /// The points.
    pub(super) slice: Slice<'g, 'a>,
    /// The axis across; none for a sweep without axes.
    pub(super) across: Option<usize>,
    /// The axis of the lines.
    pub(super) lines: Option<Shown>,
    /// The axis of the panels.
    pub(super) panels: Option<Shown>,
}

impl<'g, 'a> Layout<'g, 'a> {
    /// Up to `depth` axes of the grid.
    pub(super) fn new(grid: &'g Grid<'a>, depth: usize) -> Self {
        let mut order = grid.order();
        order.truncate(depth);
        let slice = grid.slice(&order);
        let shown = |index: usize| {
            let axis = *order.get(index)?;
            let places = spread(grid.axes[axis].values.len(), MOST, slice.base(axis));
            Some(Shown { axis, places })
        };
        let (lines, panels) = (shown(1), shown(2));
        Self { across: order.first().copied(), lines, panels, slice }
    }

    /// Places of the lines; one line where no axis has any.
    pub(super) fn line_places(&self) -> Vec<Option<usize>> {
        places(self.lines.as_ref())
    }

    /// Places of the panels; one panel where no axis has any.
    pub(super) fn panel_places(&self) -> Vec<Option<usize>> {
        places(self.panels.as_ref())
    }

    /// Number of places across.
    pub(super) fn length(&self) -> usize {
        self.across.map_or(1, |axis| self.slice.grid.axes[axis].values.len())
    }

    /// The places of a point along the axes shown.
    pub(super) fn places(
        &self,
        across: usize,
        line: Option<usize>,
        panel: Option<usize>,
    ) -> Vec<usize> {
        [Some(across), line, panel].into_iter().flatten().collect()
    }

    /// What is read at each place across, for one line of one panel.
    pub(super) fn readings(
        &self,
        measure: &Measure,
        line: Option<usize>,
        panel: Option<usize>,
    ) -> Vec<Option<Reading>> {
        let read = |across: usize| {
            let point = self.slice.at(&self.places(across, line, panel))?;
            (measure.read)(self.slice.grid.record, point)
        };
        (0..self.length()).map(read).collect()
    }

    /// Name and value of a place along an axis that is shown; empty without one.
    pub(super) fn named(&self, shown: Option<&Shown>, place: Option<usize>) -> String {
        match (shown, place) {
            (Some(shown), Some(place)) => self.slice.grid.axes[shown.axis].named(place),
            _ => String::new(),
        }
    }

    /// A swatch for each line; none for a lone one.
    pub(super) fn legend(&self, swatch: impl Fn(usize) -> Swatch) -> Vec<(Swatch, String)> {
        let lines = self.line_places().into_iter().enumerate();
        let entry = |(index, place): (usize, Option<usize>)| {
            place.map(|_| (swatch(index), self.named(self.lines.as_ref(), place)))
        };
        lines.filter_map(entry).collect()
    }

    /// What the layout leaves out, in sentences.
    pub(super) fn left_out(&self) -> String {
        let some = |shown: &Option<Shown>| {
            let Shown { axis, places } = shown.as_ref()?;
            let axis = &self.slice.grid.axes[*axis];
            let (count, name, few) = (axis.values.len(), axis.label(), places.len());
            (few < count).then(|| format!(" Of the {count} values of {name}, {few} are shown."))
        };
        let parts = [some(&self.lines), some(&self.panels)];
        parts.into_iter().flatten().collect::<String>() + &self.slice.held()
    }
}

fn places(shown: Option<&Shown>) -> Vec<Option<usize>> {
    shown.map_or_else(|| vec![None], |shown| shown.places.iter().copied().map(Some).collect())
}
