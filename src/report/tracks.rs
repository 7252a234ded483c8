//! The ways of bodies through runs, and the shapes around them: in the picture of a certificate and of plans.

use super::figure::{Swatch, cross, dot};
use super::places::{point, same_unit, unit_of, with_unit};
use super::plot::{Labels, Plot};
use super::span::Span;
use super::text::{ordinary, shorten};
use crate::model::{Outline, Shape, ShapeKind};
use crate::scenario::drawn_record::{DrawnBody, DrawnRecord};
use crate::system::{Axis, Body};

/// Share of what has been drawn before by which a failed path may go beyond it.
const BEYOND: f64 = 0.5;
/// Line classes of the bodies, in order; further ones share the last.
const CLASSES: [&str; 3] = ["body first", "body second", "body third"];
/// Bodies named in the legend.
pub(super) const NAMED: usize = 6;
/// Characters of an axis with its direction and unit.
const LABEL: usize = 42;

/// What a picture of runs is made of.
pub(super) struct Scene<'a> {
    /// States of the plant, with the box of starts.
    pub(super) states: &'a [Axis],
    /// Bodies that stand at states.
    pub(super) bodies: &'a [Body],
    /// The states that are drawn where there are no bodies.
    pub(super) plane: [usize; 2],
    /// Bodies at formulas, and shapes.
    pub(super) drawn: Option<&'a DrawnRecord>,
    /// The runs.
    pub(super) runs: Vec<Run<'a>>,
}

/// A run of a picture.
#[derive(Clone, Copy)]
pub(super) struct Run<'a> {
    /// Its states, step by step.
    pub(super) states: &'a [Vec<f32>],
    /// Whether it did what the task asks.
    pub(super) success: bool,
}

/// A body with its way in each run.
pub(super) struct Track {
    /// Name for the legend.
    pub(super) name: String,
    /// The two states that it stands at, if it stands at states.
    pub(super) states: Option<[usize; 2]>,
    /// What its place is called, right and up.
    labels: [String; 2],
    /// The units of its place, as far as they are known.
    units: [String; 2],
    /// How wide it is.
    pub(super) size: Option<f64>,
    /// The track that a line joins it to.
    pub(super) joined: Option<usize>,
    /// Its places in each run; what is no number cannot be drawn.
    paths: Vec<Vec<[f64; 2]>>,
}

impl Scene<'_> {
    /// The bodies, or the state in the plane of a model that has none.
    pub(super) fn tracks(&self) -> Vec<Track> {
        let placed = self.drawn.map_or(&[][..], |drawn| &drawn.bodies);
        if !placed.is_empty() {
            return placed.iter().map(|body| self.of_formulas(body)).collect();
        }
        if !self.bodies.is_empty() {
            return self.bodies.iter().map(|body| self.of_states(body)).collect();
        }
        let [x, y] = self.plane;
        vec![self.of_states(&Body { name: "state".to_owned(), x, y })]
    }

    /// A body at two states.
    fn of_states(&self, body: &Body) -> Track {
        let states = [body.x, body.y];
        let place = |x: &Vec<f32>| point(x, states).unwrap_or([f64::NAN; 2]);
        let axis = |state: usize| self.states.get(state);
        let name = |state| axis(state).map_or_else(|| format!("state {state}"), |a| a.name.clone());
        Track {
            name: body.name.clone(),
            states: Some(states),
            labels: states.map(name),
            units: states.map(|state| axis(state).map_or_else(String::new, |a| a.unit.clone())),
            size: None,
            joined: None,
            paths: self.runs.iter().map(|run| run.states.iter().map(place).collect()).collect(),
        }
    }

    /// A body at formulas.
    fn of_formulas(&self, body: &DrawnBody) -> Track {
        let paths = body.right.iter().zip(&body.up).map(|(right, up)| {
            right.iter().zip(up).map(|(x, y)| [*x, *y].map(f64::from)).collect()
        });
        let plain = self.bodies.iter().find(|plain| plain.name == body.name);
        let [right, up] = body.written.each_ref().map(|formula| unit_of(self.states, formula));
        // A formula without states, as 0, is a length in the plane of the other one.
        let units = [right.or(up), up.or(right)];
        Track {
            name: body.name.clone(),
            states: plain.map(|plain| [plain.x, plain.y]),
            labels: body.written.clone(),
            units: units.map(|unit| unit.unwrap_or_default().to_owned()),
            size: body.size.map(f64::from),
            joined: body.joined,
            paths: paths.collect(),
        }
    }

    /// Whether one scale fits both axes: at formulas nothing is known of units, and bodies that have a size
    /// or are joined stand in a plane of lengths.
    pub(super) fn one_scale(&self, tracks: &[Track]) -> bool {
        tracks.iter().all(|track| track.states.is_none_or(|at| same_unit(self.states, at)))
    }

    /// What the paths and shapes cover along an axis: all of those that succeed, and of others what stays
    /// near them and the box.
    pub(super) fn span(&self, tracks: &[Track], axis: usize) -> Option<Span> {
        let of = |success: bool| {
            let those = self.runs.iter().enumerate().filter(move |(_, run)| run.success == success);
            those.flat_map(move |(number, _)| {
                let paths = tracks.iter().filter_map(move |track| track.paths.get(number));
                paths.flatten().map(move |place| place[axis])
            })
        };
        let firsts = tracks.iter().flat_map(|track| &track.paths).filter_map(|path| path.first());
        let firsts = firsts.map(|place| place[axis]);
        let boxes = tracks.iter().filter_map(|track| track.states).flat_map(|states| {
            let state = self.states.get(states[axis]);
            state.map(|state| [state.low, state.high].map(f64::from)).into_iter().flatten()
        });
        let held = Span::of(of(true).chain(firsts).chain(boxes));
        let held = held.into_iter().chain(self.shape_span(axis)).reduce(Span::join)?;
        let near = held.widened(BEYOND);
        let failed = of(false).filter(|value| ordinary(*value));
        let failed = Span::of(failed.map(|value| value.clamp(near.low, near.high)));
        Some(failed.map_or(held, |failed| held.join(failed)))
    }

    /// What the shapes cover along an axis.
    pub(super) fn shape_span(&self, axis: usize) -> Option<Span> {
        Span::of(self.shapes().iter().flat_map(|shape| {
            let extent = shape.outline.extent();
            [extent[axis], extent[axis + 2]]
        }))
    }

    /// The shapes.
    pub(super) fn shapes(&self) -> &[Shape] {
        self.drawn.map_or(&[], |drawn| &drawn.shapes)
    }

    /// What lines and marks mean; runs that succeed are called `deed`.
    pub(super) fn legend(&self, tracks: &[Track], deed: &str) -> Vec<(Swatch, String)> {
        let named = tracks.iter().enumerate().take(NAMED).map(|(index, track)| {
            let name = format!("{}, from its start", shorten(&track.name, 40));
            (Swatch::Marked(class(index), start(index)), name)
        });
        let good = format!("{deed}: solid, ends in a dot");
        let bad = "failed: dashed, ends in a cross".to_owned();
        let [good, bad] = [(true, good), (false, bad)].map(|(success, name)| {
            let class = if success { "body first" } else { "body first failed" };
            let drawn = self.runs.iter().any(|run| run.success == success);
            drawn.then(|| (Swatch::Marked(class, end(success)), name))
        });
        named.chain(good).chain(bad).collect()
    }

    /// The picture of shapes, paths, bodies and marks over what `plot` has so far; `describe` is told its labels.
    pub(super) fn finish(
        &self,
        mut plot: Plot,
        tracks: &[Track],
        describe: impl FnOnce([&str; 2]) -> String,
    ) -> String {
        draw_shapes(&mut plot, self.shapes());
        self.draw_paths(&mut plot, tracks);
        draw_bodies(&mut plot, tracks);
        self.draw_marks(&mut plot, tracks);
        let [x, y] = [0, 1].map(|axis| label(tracks, axis));
        plot.finish(&Labels { x: &x, y: &y, whole: false }, &describe([&x, &y]))
    }

    /// Draws the paths of all bodies.
    fn draw_paths(&self, plot: &mut Plot, tracks: &[Track]) {
        for (number, run) in self.runs.iter().enumerate() {
            for (index, track) in tracks.iter().enumerate() {
                let line = plot.line(track.paths.get(number).into_iter().flatten().copied());
                plot.path(&path_class(index, run.success), &line);
            }
        }
    }

    /// Marks where each body starts, and where the first one ends.
    fn draw_marks(&self, plot: &mut Plot, tracks: &[Track]) {
        let drawable = |place: &&[f64; 2]| place.iter().all(|value| ordinary(*value));
        for (number, run) in self.runs.iter().enumerate() {
            for (index, track) in tracks.iter().enumerate() {
                let Some(path) = track.paths.get(number) else { continue };
                if let Some(first) = path.first().filter(drawable) {
                    plot.mark(*first, &start(index));
                }
                if let Some(last) = path.last().filter(drawable).filter(|_| index == 0) {
                    plot.mark(*last, &end(run.success));
                }
            }
        }
    }
}

/// The line class of a body.
fn class(body: usize) -> &'static str {
    CLASSES[body.min(CLASSES.len() - 1)]
}

fn path_class(body: usize, success: bool) -> String {
    format!("{}{}", class(body), if success { "" } else { " failed" })
}

/// The mark at a start: a ring for the first body, a square for the others.
fn start(body: usize) -> String {
    let class = class(body);
    if body == 0 {
        format!("<circle class=\"start {class}\" r=\"3.6\"/>")
    } else {
        format!("<path class=\"start {class}\" d=\"M-3.2-3.2H3.2V3.2H-3.2Z\"/>")
    }
}

/// The mark at the end of the first body's path.
fn end(success: bool) -> String {
    if success { dot(4.2) } else { cross(4.0) }
}

/// What the places of the bodies are called along an axis, with the unit where they share one.
fn label(tracks: &[Track], axis: usize) -> String {
    let [first, others @ ..] = tracks else {
        return String::new();
    };
    let unit = tracks.iter().map(|track| &track.units[axis]).find(|unit| !unit.is_empty());
    let unit = unit.map_or("", String::as_str);
    let shared = |track: &Track| track.units[axis].is_empty() || track.units[axis] == unit;
    let all = tracks.iter().all(shared);
    let name = |track: &Track| match all {
        true => track.labels[axis].clone(),
        false => with_unit(&track.labels[axis], &track.units[axis]),
    };
    let text = match others {
        [] => name(first),
        [other] => format!("{}, {}", name(first), name(other)),
        _ => format!("{} and {} more", name(first), others.len()),
    };
    let side = if first.states.is_some() { "" } else { ["right: ", "up: "][axis] };
    let unit = if all { unit } else { "" };
    let room = LABEL.saturating_sub(side.len() + unit.chars().count());
    with_unit(&format!("{side}{}", shorten(&text, room)), unit)
}

/// Draws the shapes, under everything else.
fn draw_shapes(plot: &mut Plot, shapes: &[Shape]) {
    for shape in shapes {
        let class = area(shape.kind);
        match shape.outline {
            Outline::Box(ends) => {
                let data = plot.rectangle(ends.map(f64::from));
                plot.path(class, &data);
            }
            Outline::Disc(disc) => {
                let [x, y, radius] = disc.map(f64::from);
                plot.ellipse(class, [x, y], plot.lengths(radius));
            }
        }
    }
}

/// Classes of the area of a shape.
fn area(kind: ShapeKind) -> &'static str {
    match kind {
        ShapeKind::Unsafe => "hatched constraint",
        ShapeKind::Target => "target-area target",
        ShapeKind::Plain => "slice",
    }
}

/// Swatches of the shapes.
pub(super) fn shape_legend(shapes: &[Shape]) -> impl Iterator<Item = (Swatch, String)> {
    let named = shapes.iter().take(NAMED);
    named.map(|shape| (Swatch::Area(area(shape.kind)), shorten(&shape.name, 40)))
}

/// Draws the bodies of the first rollout as large as they are, with the lines that join them, at its first
/// and its last state.
fn draw_bodies(plot: &mut Plot, tracks: &[Track]) {
    let path = |track: &Track| track.paths.first().cloned().unwrap_or_default();
    let first: Vec<_> = tracks.iter().map(|track| path(track).first().copied()).collect();
    let last: Vec<_> = tracks.iter().map(|track| path(track).last().copied()).collect();
    draw_bodies_at(plot, tracks, &first);
    draw_bodies_at(plot, tracks, &last);
}

/// Draws each body at its place, where it has one.
fn draw_bodies_at(plot: &mut Plot, tracks: &[Track], places: &[Option<[f64; 2]>]) {
    for (track, place) in tracks.iter().zip(places) {
        let Some(here) = *place else { continue };
        if let Some(there) = track.joined.and_then(|other| places.get(other).copied().flatten()) {
            let line = plot.line([here, there]);
            plot.path("body joint", &line);
        }
        if let Some(size) = track.size {
            plot.ellipse("body extent", here, plot.lengths(0.5 * size));
        }
    }
}
