//! The points of a sweep as a grid: places along its axes, and the slice that a figure shows.

use std::collections::BTreeMap;

use super::readings;
use crate::race::sweep::record::{AxisRecord, PointRecord, SweepRecord};
use crate::report::text::{ordinary, shorten, told_apart};

/// Characters of a value in a legend, a title or a sentence.
const VALUE: usize = 40;
/// Name of the axis that is shown across wherever it varies.
const SAMPLES: &str = "samples";

/// One axis: its values in the order in which they are shown.
pub(super) struct Axis<'a> {
    /// Name, as in the record.
    pub(super) name: &'a str,
    /// Values with the numbers that they stand for: ascending if all are numbers.
    pub(super) values: Vec<(&'a str, Option<f64>)>,
    /// Values short enough for a line, told apart.
    short: Vec<String>,
}

impl<'a> Axis<'a> {
    fn new(record: &'a AxisRecord) -> Self {
        let number = |text: &str| text.parse().ok().filter(|&number| ordinary(number));
        let mut values: Vec<(&str, Option<f64>)> =
            record.values.iter().map(|text| (text.as_str(), number(text))).collect();
        if values.iter().all(|(_, number)| number.is_some()) {
            values.sort_by(|(_, a), (_, b)| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        }
        let texts: Vec<&str> = values.iter().map(|(text, _)| *text).collect();
        Self { name: &record.name, short: told_apart(&texts, VALUE), values }
    }

    /// Whether every value is a number.
    pub(super) fn is_numeric(&self) -> bool {
        self.values.iter().all(|(_, number)| number.is_some())
    }

    /// The value at a place, short enough for a line.
    pub(super) fn value(&self, place: usize) -> String {
        self.short.get(place).cloned().unwrap_or_default()
    }

    /// All values in at most `limit` characters, told apart.
    pub(super) fn texts(&self, limit: usize) -> Vec<String> {
        let texts: Vec<&str> = self.values.iter().map(|(text, _)| *text).collect();
        told_apart(&texts, limit)
    }

    /// Name and value.
    pub(super) fn named(&self, place: usize) -> String {
        format!("{} {}", shorten(self.name, VALUE), self.value(place))
    }

    /// Name with symbol and unit, as it stands beside an axis.
    pub(super) fn label(&self) -> String {
        let known = match self.name {
            "samples" => "samples K",
            "horizon" => "horizon, steps",
            "temperature" => "temperature λ",
            "sigma" => "sigma of the noise",
            "iterations" => "improvements of a plan per step",
            "epsilon" => "risk ε",
            "beta" => "one minus confidence, β",
            "radius" => "radius around a nominal start",
            other => other,
        };
        shorten(known, VALUE)
    }
}

/// A point with its place on each axis.
pub(super) struct Point<'a> {
    /// What came of it.
    pub(super) record: &'a PointRecord,
    /// Its places.
    pub(super) places: Vec<usize>,
}

/// A sweep with its points in place.
pub(super) struct Grid<'a> {
    /// The sweep.
    pub(super) record: &'a SweepRecord,
    /// Its axes.
    pub(super) axes: Vec<Axis<'a>>,
    /// The points whose values are on the axes, in the order of the record.
    pub(super) points: Vec<Point<'a>>,
    found: BTreeMap<Vec<usize>, usize>,
    /// The point with the highest score.
    pub(super) best: Option<usize>,
}

impl<'a> Grid<'a> {
    /// The grid of a record.
    pub(super) fn new(record: &'a SweepRecord) -> Self {
        let axes: Vec<_> = record.axes.iter().map(Axis::new).collect();
        let points: Vec<_> =
            record.points.iter().filter_map(|point| placed(&axes, point)).collect();
        let found = points.iter().map(|point| point.places.clone()).zip(0..).collect();
        let scores = points.iter().map(|point| readings::score(record, point.record));
        let scores = scores.enumerate().filter_map(|(index, score)| Some((index, score?)));
        // Of equal points the first.
        let best = scores.reduce(|best, next| if next.1 > best.1 { next } else { best });
        Self { record, best: best.map(|(index, _)| index), axes, points, found }
    }

    /// The axes with more than one value.
    pub(super) fn varying(&self) -> impl Iterator<Item = usize> {
        (0..self.axes.len()).filter(|&axis| self.axes[axis].values.len() > 1)
    }

    /// The varying axes that are numbers, the samples of a plan first.
    pub(super) fn numeric(&self) -> Vec<usize> {
        let mut numeric: Vec<_> =
            self.varying().filter(|&axis| self.axes[axis].is_numeric()).collect();
        numeric.sort_by_key(|&axis| self.axes[axis].name != SAMPLES);
        numeric
    }

    /// The axis of the samples of a plan, if it varies.
    pub(super) fn samples(&self) -> Option<usize> {
        self.numeric().into_iter().find(|&axis| self.axes[axis].name == SAMPLES)
    }

    /// The axis across a figure, then the other varying ones: the first numeric one, else the
    /// first that varies, else the first.
    pub(super) fn order(&self) -> Vec<usize> {
        let across = self.numeric().first().copied().or(self.varying().next());
        let Some(across) = across.or((!self.axes.is_empty()).then_some(0)) else {
            return Vec::new();
        };
        std::iter::once(across).chain(self.varying().filter(|&axis| axis != across)).collect()
    }

    /// The slice along `shown`, through the best point.
    pub(super) fn slice(&self, shown: &[usize]) -> Slice<'_, 'a> {
        let base = match self.best {
            Some(best) => self.points[best].places.clone(),
            None => vec![0; self.axes.len()],
        };
        Slice { grid: self, shown: shown.to_vec(), base }
    }

    /// The values of a point in words: of the axes that vary, if any does.
    pub(super) fn name(&self, point: &Point<'_>) -> String {
        let mut axes: Vec<_> = self.varying().collect();
        if axes.is_empty() {
            axes = (0..self.axes.len()).collect();
        }
        let values = axes.into_iter().map(|axis| self.axes[axis].named(point.places[axis]));
        let values: Vec<_> = values.collect();
        if values.is_empty() { "the configuration as it is".to_owned() } else { values.join(", ") }
    }
}

/// The point with its places, if it has one on each axis.
fn placed<'a>(axes: &[Axis<'_>], record: &'a PointRecord) -> Option<Point<'a>> {
    let place = |(index, axis): (usize, &Axis<'_>)| {
        let value = record.values.get(index)?;
        axis.values.iter().position(|(text, _)| text == value)
    };
    let places: Option<Vec<_>> = axes.iter().enumerate().map(place).collect();
    places.map(|places| Point { record, places })
}

/// The points along some axes, with the others where the best point has them.
pub(super) struct Slice<'g, 'a> {
    /// The grid that it is of.
    pub(super) grid: &'g Grid<'a>,
    shown: Vec<usize>,
    base: Vec<usize>,
}

impl<'a> Slice<'_, 'a> {
    /// The point at these places along the axes shown.
    pub(super) fn at(&self, places: &[usize]) -> Option<&'a PointRecord> {
        let mut all = self.base.clone();
        for (&axis, &place) in self.shown.iter().zip(places) {
            all[axis] = place;
        }
        self.grid.found.get(&all).map(|&index| self.grid.points[index].record)
    }

    /// Where the best point lies on an axis.
    pub(super) fn base(&self, axis: usize) -> usize {
        self.base[axis]
    }

    /// What is not shown, in a sentence; nothing if all is.
    pub(super) fn held(&self) -> String {
        let held = self.grid.varying().filter(|axis| !self.shown.contains(axis));
        let held: Vec<_> = held.map(|axis| self.grid.axes[axis].named(self.base[axis])).collect();
        match held.is_empty() {
            true => String::new(),
            false => format!(" Shown is the slice at {}, through the best point.", held.join(", ")),
        }
    }
}

/// At most `limit` of `count` places, evenly spread, `kept` among them.
pub(super) fn spread(count: usize, limit: usize, kept: usize) -> Vec<usize> {
    if count <= limit {
        return (0..count).collect();
    }
    let last = limit.saturating_sub(1).max(1);
    let mut places: Vec<_> = (0..limit).map(|index| index * (count - 1) / last).collect();
    if !places.contains(&kept) {
        let near = (0..places.len()).min_by_key(|&index| places[index].abs_diff(kept));
        near.into_iter().for_each(|index| places[index] = kept);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn a_spread_holds_both_ends_or_what_is_kept() {
        assert_eq!(spread(3, 6, 0), [0, 1, 2]);
        assert_eq!(spread(11, 6, 4), [0, 2, 4, 6, 8, 10]);
        assert_eq!(spread(11, 6, 5), [0, 2, 5, 6, 8, 10]);
        assert_eq!(spread(9, 2, 3), [3, 8]);
    }
}
