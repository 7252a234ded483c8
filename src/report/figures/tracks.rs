//! The ways of bodies through the rollouts of a picture, and the shapes around them.

use super::plane::{point, same_unit, slice_states};
use crate::model::{Outline, Shape, ShapeKind};
use crate::report::figure::Swatch;
use crate::report::plot::Plot;
use crate::report::span::Span;
use crate::report::text::{ordinary, shorten};
use crate::report::words;
use crate::scenario::drawn_record::{DrawnBody, DrawnRecord};
use crate::scenario::record::Record;
use crate::system::Body;

/// Share of what has been drawn before by which a failed path may go beyond it.
const BEYOND: f64 = 0.5;

/// A body with its way in each rollout.
pub(super) struct Track {
    /// Name for the legend.
    pub(super) name: String,
    /// The two states that it stands at, if it stands at states.
    pub(super) states: Option<[usize; 2]>,
    /// What its place is called, right and up.
    pub(super) labels: [String; 2],
    /// How wide it is.
    pub(super) size: Option<f64>,
    /// The track that a line joins it to.
    pub(super) joined: Option<usize>,
    /// Its places in each rollout; what is no number cannot be drawn.
    pub(super) paths: Vec<Vec<[f64; 2]>>,
}

/// What the record says of the picture beside its rollouts.
pub(super) fn drawn(record: &Record) -> Option<&DrawnRecord> {
    record.picture.drawn.as_ref()
}

/// The bodies of the record, or the state in the plane of the slice.
pub(super) fn tracks(record: &Record) -> Vec<Track> {
    let placed = drawn(record).map_or(&[][..], |drawn| &drawn.bodies);
    if !placed.is_empty() {
        return placed.iter().map(|body| of_formulas(record, body)).collect();
    }
    if !record.system.bodies.is_empty() {
        return record.system.bodies.iter().map(|body| of_states(record, body)).collect();
    }
    let [x, y] = slice_states(record);
    vec![of_states(record, &Body { name: "state".to_owned(), x, y })]
}

/// A body at two states.
fn of_states(record: &Record, body: &Body) -> Track {
    let states = [body.x, body.y];
    let place = |x: &Vec<f32>| point(x, states).unwrap_or([f64::NAN; 2]);
    let rollouts = record.picture.rollouts.iter();
    Track {
        name: body.name.clone(),
        states: Some(states),
        labels: states.map(|state| words::axis(record, state)),
        size: None,
        joined: None,
        paths: rollouts.map(|rollout| rollout.states.iter().map(place).collect()).collect(),
    }
}

/// A body at formulas.
fn of_formulas(record: &Record, body: &DrawnBody) -> Track {
    let paths =
        body.right.iter().zip(&body.up).map(|(right, up)| {
            right.iter().zip(up).map(|(x, y)| [*x, *y].map(f64::from)).collect()
        });
    let plain = record.system.bodies.iter().find(|plain| plain.name == body.name);
    Track {
        name: body.name.clone(),
        states: plain.map(|plain| [plain.x, plain.y]),
        labels: body.written.clone().map(|formula| shorten(&formula, 40)),
        size: body.size.map(f64::from),
        joined: body.joined,
        paths: paths.collect(),
    }
}

/// Whether one scale fits both axes: at formulas nothing is known of units, and bodies that have a size or
/// are joined stand in a plane of lengths.
pub(super) fn one_scale(record: &Record, tracks: &[Track]) -> bool {
    tracks.iter().all(|track| track.states.is_none_or(|states| same_unit(record, states)))
}

/// What the paths and shapes cover along an axis: all of those that succeed, and of others what stays near
/// them and the box.
pub(super) fn span(record: &Record, tracks: &[Track], axis: usize) -> Option<Span> {
    let of = |success: bool| {
        let rollouts = record.picture.rollouts.iter();
        let those = rollouts.enumerate().filter(move |(_, rollout)| rollout.success == success);
        those.flat_map(move |(number, _)| {
            let paths = tracks.iter().filter_map(move |track| track.paths.get(number));
            paths.flatten().map(move |place| place[axis])
        })
    };
    let firsts = tracks.iter().flat_map(|track| &track.paths).filter_map(|path| path.first());
    let firsts = firsts.map(|place| place[axis]);
    let boxes = tracks.iter().filter_map(|track| track.states).flat_map(|states| {
        let state = record.system.states.get(states[axis]);
        state.map(|state| [state.low, state.high].map(f64::from)).into_iter().flatten()
    });
    let shapes = shapes(record).iter().flat_map(|shape| {
        let extent = shape.outline.extent();
        [extent[axis], extent[axis + 2]]
    });
    let held = Span::of(of(true).chain(firsts).chain(boxes).chain(shapes))?;
    let near = held.widened(BEYOND);
    let failed = of(false).filter(|value| ordinary(*value));
    let failed = Span::of(failed.map(|value| value.clamp(near.low, near.high)));
    Some(failed.map_or(held, |failed| held.join(failed)))
}

/// The shapes of the record.
pub(super) fn shapes(record: &Record) -> &[Shape] {
    drawn(record).map_or(&[], |drawn| &drawn.shapes)
}

/// Draws the shapes, under everything else.
pub(super) fn draw_shapes(plot: &mut Plot, shapes: &[Shape]) {
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
    shapes.iter().map(|shape| (Swatch::Area(area(shape.kind)), shorten(&shape.name, 40)))
}

/// Draws the bodies of the first rollout as large as they are, with the lines that join them, at its first
/// and its last state.
pub(super) fn draw_bodies(plot: &mut Plot, tracks: &[Track]) {
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
