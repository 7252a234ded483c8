//! Trajectories of a few rollouts in the plane of the system's bodies.

use super::course::{self, only_state};
use super::plane::{entry, margins, point, same_unit, slice_states, target_area};
use crate::model::Form;
use crate::report::figure::{Figure, Swatch, cross, dot};
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::slice::Grid;
use crate::report::span::Span;
use crate::report::text::shorten;
use crate::report::words;
use crate::scenario::record::{Record, RolloutRecord};
use crate::system::Body;

/// Line classes of the bodies, in order; further ones share the last.
const CLASSES: [&str; 3] = ["body first", "body second", "body third"];
/// Bodies named in the legend.
const NAMED: usize = 6;

/// The figure.
pub(super) fn figure(record: &Record, grid: Option<&Grid>) -> Figure {
    let bodies = bodies(record);
    let drawing = if record.picture.rollouts.is_empty() {
        Err("The record holds no rollouts.".to_owned())
    } else {
        drawing(record, &bodies, grid.filter(|_| overlaid(record, &bodies)))
    };
    let legend = if drawing.is_ok() { legend(record, &bodies) } else { Vec::new() };
    Figure {
        id: "figure-paths",
        title: "Trajectories of a few rollouts".to_owned(),
        drawing,
        legend,
        caption: caption(record, &bodies),
    }
}

/// The system's bodies, or the state in the plane of the slice.
fn bodies(record: &Record) -> Vec<Body> {
    if !record.system.bodies.is_empty() {
        return record.system.bodies.clone();
    }
    let [x, y] = slice_states(record);
    vec![Body { name: "state".to_owned(), x, y }]
}

/// Whether the slice's margins are in the plane of the first body.
fn overlaid(record: &Record, bodies: &[Body]) -> bool {
    let states = slice_states(record);
    only_state(record).is_none() && bodies.first().is_some_and(|body| [body.x, body.y] == states)
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

fn legend(record: &Record, bodies: &[Body]) -> Vec<(Swatch, String)> {
    let mut legend: Vec<_> = bodies
        .iter()
        .enumerate()
        .take(NAMED)
        .map(|(index, body)| {
            let class = CLASSES[index.min(CLASSES.len() - 1)];
            let name = format!("{}, from its start", shorten(&body.name, 40));
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
    if overlaid(record, bodies) {
        let (target, violated) = ("target set at the state", "constraint violated at the state");
        let target = (Swatch::Area("target-area target"), target.to_owned());
        let violated = (Swatch::Area("hatched constraint"), violated.to_owned());
        let task = &record.system.task;
        legend.extend(task.has_target().then_some(target));
        legend.extend(task.has_constraint().then_some(violated));
    }
    legend
}

fn caption(record: &Record, bodies: &[Body]) -> String {
    let rollouts = &record.picture.rollouts;
    let reached = rollouts.iter().filter(|rollout| rollout.success).count();
    let mut caption = format!(
        "{reached} of {} rollouts {}; an illustration, not a sample that a claim rests on.",
        rollouts.len(),
        record.system.task.words(Form::Past, record.horizon)
    );
    if overlaid(record, bodies) {
        caption += " Target set and constraint are drawn over the slice";
        if bodies.len() > 1 {
            let names = bodies[1..].iter().take(NAMED).map(|body| shorten(&body.name, 40));
            let names = names.collect::<Vec<_>>().join(", ");
            caption += &format!(", with the {names} where the state has it; they move with it");
        } else if record.system.states.len() > 2 {
            caption += ", with the other coordinates as in the state";
        }
        caption += ".";
    }
    caption
}

/// The part of a body's plane that is drawn: its paths, as far as they stay near the box.
fn span(record: &Record, states: impl Iterator<Item = usize>) -> Option<Span> {
    let mut all: Option<Span> = None;
    for state in states {
        let rollouts = record.picture.rollouts.iter();
        let values = rollouts.flat_map(|rollout| &rollout.states);
        let values: Vec<f64> = values.filter_map(|x| entry(x, state)).collect();
        let axis = record.system.states.get(state)?;
        let [low, high] = [axis.low, axis.high].map(f64::from);
        let near = |value: f64| value.clamp(2.0 * low - high, 2.0 * high - low);
        let here = Span::of(values.into_iter().map(near));
        all = match (all, here) {
            (Some(all), Some(here)) => Some(all.join(here)),
            (all, here) => all.or(here),
        };
    }
    all.map(|span| span.widened(0.05))
}

fn drawing(record: &Record, bodies: &[Body], grid: Option<&Grid>) -> Result<String, String> {
    let nothing = || "No state of the rollouts can be drawn.".to_owned();
    let description = format!("Trajectories. {}", caption(record, bodies));
    if let Some(state) = only_state(record) {
        let span = span(record, std::iter::once(state)).ok_or_else(nothing)?;
        return Ok(course::drawing(record, span, state, &description));
    }
    let mut x = span(record, bodies.iter().map(|body| body.x)).ok_or_else(nothing)?;
    let mut y = span(record, bodies.iter().map(|body| body.y)).ok_or_else(nothing)?;
    if let Some(grid) = grid {
        let [across, up] = grid.spans();
        (x, y) = (x.join(across), y.join(up));
    }
    let equal = bodies.iter().all(|body| same_unit(record, [body.x, body.y]));
    let shape = if equal { Proportions::Equal } else { Proportions::Free(330.0) };
    let mut plot = Plot::new("paths", x, y, shape);
    if let Some(grid) = grid {
        target_area(&mut plot, grid);
        margins(&mut plot, grid);
    }
    for rollout in &record.picture.rollouts {
        paths(&mut plot, bodies, rollout);
    }
    for rollout in &record.picture.rollouts {
        marks(&mut plot, bodies, rollout);
    }
    let labels = Labels {
        x: &label(record, bodies, |body| body.x),
        y: &label(record, bodies, |body| body.y),
        whole: false,
    };
    Ok(plot.finish(&labels, &description))
}

/// Names of the states that the bodies move along, with the unit of the first.
fn label(record: &Record, bodies: &[Body], pick: impl Fn(&Body) -> usize) -> String {
    let [first, others @ ..] = bodies else {
        return String::new();
    };
    let first = words::axis(record, pick(first));
    match others {
        [] => first,
        [other] => format!("{first}, {}", words::axis(record, pick(other))),
        _ => format!("{first} and {} more", others.len()),
    }
}

fn paths(plot: &mut Plot, bodies: &[Body], rollout: &RolloutRecord) {
    for (index, body) in bodies.iter().enumerate() {
        let points =
            rollout.states.iter().map(|x| point(x, [body.x, body.y]).unwrap_or([f64::NAN; 2]));
        let line = plot.line(points);
        plot.path(&class(index, rollout.success), &line);
    }
}

fn marks(plot: &mut Plot, bodies: &[Body], rollout: &RolloutRecord) {
    for (index, body) in bodies.iter().enumerate() {
        let at = |x: Option<&Vec<f32>>| x.and_then(|x| point(x, [body.x, body.y]));
        if let Some(first) = at(rollout.states.first()) {
            plot.mark(first, &start(index));
        }
        if let Some(last) = at(rollout.states.last()).filter(|_| index == 0) {
            plot.mark(last, &end(rollout.success));
        }
    }
}
