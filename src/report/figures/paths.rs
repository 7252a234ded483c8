//! Trajectories of a few rollouts in the plane of the system's bodies.

use super::course::{self, only_state};
use super::plane::{GroundOf, entry, slice_states};
use super::tracks::{self, Track};
use crate::model::Form;
use crate::report::figure::{Figure, Swatch, cross, dot};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::report::text::{ordinary, shorten};
use crate::report::words;
use crate::scenario::record::Record;

/// Line classes of the bodies, in order; further ones share the last.
const CLASSES: [&str; 3] = ["body first", "body second", "body third"];
/// Bodies named in the legend.
const NAMED: usize = 6;

/// The figure.
pub(super) fn figure(record: &Record, grid: Option<&Grid>) -> Figure {
    let tracks = tracks::tracks(record);
    let ground = ground(record, &tracks, grid);
    let drawing = if record.picture.rollouts.is_empty() {
        Err("The record holds no rollouts.".to_owned())
    } else {
        drawing(record, &tracks, ground.as_ref())
    };
    let legend =
        if drawing.is_ok() { legend(record, &tracks, ground.as_ref()) } else { Vec::new() };
    Figure {
        id: "figure-paths",
        title: "Trajectories of a few rollouts".to_owned(),
        drawing,
        legend,
        caption: caption(record, &tracks, ground.as_ref()),
    }
}

/// What the paths are drawn over: margins of a ground of its own, or of the slice where that is the plane of
/// the first body.
fn ground<'a>(
    record: &'a Record,
    tracks: &[Track],
    slice: Option<&'a Grid<'a>>,
) -> Option<GroundOf<'a>> {
    if only_state(record).is_some() {
        return None;
    }
    let own = tracks::drawn(record).and_then(|drawn| drawn.ground.as_ref());
    if let Some(own) = own.and_then(|ground| GroundOf::picture(record, ground)) {
        return Some(own);
    }
    let first = tracks.first().and_then(|track| track.states);
    slice.filter(|_| first == Some(slice_states(record))).map(GroundOf::slice)
}

fn class(body: usize, success: bool) -> String {
    let class = CLASSES[body.min(CLASSES.len() - 1)];
    format!("{class}{}", if success { "" } else { " failed" })
}

/// The mark at a start: a ring for the first body, a square for the others.
fn start(body: usize) -> String {
    let class = CLASSES[body.min(CLASSES.len() - 1)];
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

fn legend(
    record: &Record,
    tracks: &[Track],
    ground: Option<&GroundOf<'_>>,
) -> Vec<(Swatch, String)> {
    let mut legend: Vec<_> = tracks
        .iter()
        .enumerate()
        .take(NAMED)
        .map(|(index, track)| {
            let class = CLASSES[index.min(CLASSES.len() - 1)];
            let name = format!("{}, from its start", shorten(&track.name, 40));
            let mark = if only_state(record).is_some() { String::new() } else { start(index) };
            (Swatch::Marked(class, mark), name)
        })
        .collect();
    let rollouts = &record.picture.rollouts;
    if rollouts.iter().any(|rollout| rollout.success) {
        let deed = record.system.task.short_words(Form::Past, record.horizon);
        let name = format!("{deed}: solid, ends in a dot");
        legend.push((Swatch::Marked("body first", end(true)), name));
    }
    if rollouts.iter().any(|rollout| !rollout.success) {
        let name = "failed: dashed, ends in a cross".to_owned();
        legend.push((Swatch::Marked("body first failed", end(false)), name));
    }
    if ground.is_some() {
        let (target, violated) = ("target set at the state", "constraint violated at the state");
        let target = (Swatch::Area("target-area target"), target.to_owned());
        let violated = (Swatch::Area("hatched constraint"), violated.to_owned());
        let task = &record.system.task;
        legend.extend(task.has_target().then_some(target));
        legend.extend(task.has_constraint().then_some(violated));
    }
    legend.extend(tracks::shape_legend(tracks::shapes(record)).take(NAMED));
    legend
}

fn caption(record: &Record, tracks: &[Track], ground: Option<&GroundOf<'_>>) -> String {
    let rollouts = &record.picture.rollouts;
    let reached = rollouts.iter().filter(|rollout| rollout.success).count();
    let mut caption = format!(
        "{reached} of {} rollouts {}; an illustration, not a sample that a claim rests on.",
        rollouts.len(),
        record.system.task.words(Form::Past, record.horizon)
    );
    if tracks.iter().any(|track| track.size.is_some() || track.joined.is_some()) {
        caption += " Bodies stand where the first rollout begins and where it ends.";
    }
    let bodiless = record.system.bodies.is_empty() && tracks::drawn(record).is_some();
    if let ([Track { states: Some(states), .. }], true) = (tracks, bodiless) {
        let [x, y] = states.map(|state| words::name(record, state));
        caption += &format!(" The model has no bodies: the states {x} and {y} are drawn.");
    }
    if let Some(ground) = ground {
        caption += ground.words();
        if tracks.len() > 1 {
            let names = tracks[1..].iter().take(NAMED).map(|track| shorten(&track.name, 40));
            let names = names.collect::<Vec<_>>().join(", ");
            caption += &format!(", with the {names} where the state has it; they move with it");
        } else if record.system.states.len() > 2 {
            caption += ", with the other coordinates as in the state";
        }
        caption += "; none was computed where it is grey.";
    }
    caption
}

/// What is drawn of a system with one state: its paths, as far as they stay near the box.
fn course_span(record: &Record, state: usize) -> Option<Span> {
    let rollouts = record.picture.rollouts.iter();
    let values = rollouts.flat_map(|rollout| &rollout.states);
    let values = values.filter_map(|x| entry(x, state));
    let axis = record.system.states.get(state)?;
    let [low, high] = [axis.low, axis.high].map(f64::from);
    let near = |value: f64| value.clamp(2.0 * low - high, 2.0 * high - low);
    Span::of(values.map(near)).map(|span| span.widened(0.05))
}

fn drawing(
    record: &Record,
    tracks: &[Track],
    ground: Option<&GroundOf<'_>>,
) -> Result<String, String> {
    let nothing = || "No state of the rollouts can be drawn.".to_owned();
    let description = format!("Trajectories. {}", caption(record, tracks, ground));
    if let Some(state) = only_state(record) {
        let span = course_span(record, state).ok_or_else(nothing)?;
        return Ok(course::drawing(record, span, state, &description));
    }
    let span = |axis: usize| Some(tracks::span(record, tracks, axis)?.widened(0.05));
    let (mut x, mut y) = (span(0).ok_or_else(nothing)?, span(1).ok_or_else(nothing)?);
    if let Some(ground) = ground {
        let [across, up] = ground.spans();
        (x, y) = (x.join(across), y.join(up));
    }
    let shape = match tracks::one_scale(record, tracks) {
        true => Proportions::Equal,
        false => Proportions::Free(330.0),
    };
    let mut plot = Plot::new("paths", x, y, shape);
    if let Some(ground) = ground {
        ground.draw(&mut plot);
    }
    tracks::draw_shapes(&mut plot, tracks::shapes(record));
    for (number, rollout) in record.picture.rollouts.iter().enumerate() {
        paths(&mut plot, tracks, number, rollout.success);
    }
    tracks::draw_bodies(&mut plot, tracks);
    for (number, rollout) in record.picture.rollouts.iter().enumerate() {
        marks(&mut plot, tracks, number, rollout.success);
    }
    let labels = Labels { x: &label(tracks, 0), y: &label(tracks, 1), whole: false };
    Ok(plot.finish(&labels, &description))
}

/// What the places of the bodies are called along an axis.
fn label(tracks: &[Track], axis: usize) -> String {
    let [first, others @ ..] = tracks else {
        return String::new();
    };
    let name = |track: &Track| track.labels[axis].clone();
    match others {
        [] => name(first),
        [other] => format!("{}, {}", name(first), name(other)),
        _ => format!("{} and {} more", name(first), others.len()),
    }
}

fn paths(plot: &mut Plot, tracks: &[Track], rollout: usize, success: bool) {
    for (index, track) in tracks.iter().enumerate() {
        let line = plot.line(track.paths.get(rollout).into_iter().flatten().copied());
        plot.path(&class(index, success), &line);
    }
}

fn marks(plot: &mut Plot, tracks: &[Track], rollout: usize, success: bool) {
    let drawable = |place: &&[f64; 2]| place.iter().all(|value| ordinary(*value));
    for (index, track) in tracks.iter().enumerate() {
        let Some(path) = track.paths.get(rollout) else { continue };
        if let Some(first) = path.first().filter(drawable) {
            plot.mark(*first, &start(index));
        }
        if let Some(last) = path.last().filter(drawable).filter(|_| index == 0) {
            plot.mark(*last, &end(success));
        }
    }
}
