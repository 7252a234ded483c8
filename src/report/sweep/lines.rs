//! The lines of a figure: one per value of an axis, each with a colour and a mark of its own.

use super::grid::{Grid, Slice, spread};
use super::readings::{Measure, Reading};
use crate::report::figure::Swatch;

/// Most lines of a figure, and most panels.
pub(super) const MOST: usize = 6;

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

/// Which axes a figure shows, and which of their values: across, as lines, as panels.
pub(super) struct Layout<'g, 'a> {
    /// The points.
    pub(super) slice: Slice<'g, 'a>,
    /// The axis across; none for a sweep without axes.
    pub(super) across: Option<usize>,
    /// The axis of the lines, with the places shown.
    pub(super) lines: Option<(usize, Vec<usize>)>,
    /// The axis of the panels, with the places shown.
    pub(super) panels: Option<(usize, Vec<usize>)>,
}

impl<'g, 'a> Layout<'g, 'a> {
    /// Up to `depth` axes of the grid.
    pub(super) fn new(grid: &'g Grid<'a>, depth: usize) -> Self {
        let order = grid.order();
        let shown = &order[..order.len().min(depth)];
        let slice = grid.slice(shown);
        let some = |index: usize| {
            let axis = *shown.get(index)?;
            Some((axis, spread(grid.axes[axis].values.len(), MOST, slice.base(axis))))
        };
        let (lines, panels) = (some(1), some(2));
        Self { across: shown.first().copied(), lines, panels, slice }
    }

    /// Places of the lines; one line where no axis has any.
    pub(super) fn line_places(&self) -> Vec<Option<usize>> {
        let places = |(_, places): &(usize, Vec<usize>)| places.iter().copied().map(Some).collect();
        self.lines.as_ref().map_or_else(|| vec![None], places)
    }

    /// Places of the panels; one panel where no axis has any.
    pub(super) fn panel_places(&self) -> Vec<Option<usize>> {
        let places = |(_, places): &(usize, Vec<usize>)| places.iter().copied().map(Some).collect();
        self.panels.as_ref().map_or_else(|| vec![None], places)
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

    /// Title of a panel.
    pub(super) fn panel_title(&self, place: usize) -> String {
        let named = |(axis, _): &(usize, Vec<usize>)| self.slice.grid.axes[*axis].named(place);
        self.panels.as_ref().map_or_else(String::new, named)
    }

    /// A swatch for each line; none for a lone one.
    pub(super) fn legend(&self, swatch: impl Fn(usize) -> Swatch) -> Vec<(Swatch, String)> {
        let Some((axis, places)) = &self.lines else {
            return Vec::new();
        };
        let axis = &self.slice.grid.axes[*axis];
        let names = places.iter().map(|&place| axis.named(place));
        names.enumerate().map(|(index, name)| (swatch(index), name)).collect()
    }

    /// What the layout leaves out, in sentences.
    pub(super) fn left_out(&self) -> String {
        let some = |shown: &Option<(usize, Vec<usize>)>| {
            let (axis, places) = shown.as_ref()?;
            let axis = &self.slice.grid.axes[*axis];
            let count = axis.values.len();
            (places.len() < count).then(|| {
                format!(" Of the {count} values of {}, {} are shown.", axis.label(), places.len())
            })
        };
        let parts = [some(&self.lines), some(&self.panels)];
        parts.into_iter().flatten().collect::<String>() + &self.slice.held()
    }
}
