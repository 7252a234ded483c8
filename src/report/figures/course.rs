//! Rollouts of a system with one state: the state from step to step.

use crate::report::figure::{cross, dot};
use crate::report::places::entry;
use crate::report::plot::{Labels, Plot, Proportions};
use crate::report::span::Span;
use crate::report::words;
use crate::scenario::record::{Record, RolloutRecord};

/// The only state of a system that has no bodies to show.
pub(super) fn only_state(record: &Record) -> Option<usize> {
    let alone = record.system.states.len() == 1 && record.system.bodies.is_empty();
    alone.then_some(0)
}

/// The drawing; `description` is read out in its place.
pub(super) fn drawing(record: &Record, y: Span, state: usize, description: &str) -> String {
    let x = Span { low: 0.0, high: f64::from(record.horizon.max(1)) };
    let mut plot = Plot::new("paths", x, y, Proportions::Free(330.0));
    for rollout in &record.picture.rollouts {
        let class = if rollout.success { "body first" } else { "body first failed" };
        let line = plot.line(points(rollout, state));
        plot.path(class, &line);
    }
    for rollout in &record.picture.rollouts {
        if let Some(last) = points(rollout, state).last().filter(|[_, y]| y.is_finite()) {
            plot.mark(last, &if rollout.success { dot(4.2) } else { cross(4.0) });
        }
    }
    let labels = Labels { x: "step", y: &words::axis(record, state), whole: true };
    plot.finish(&labels, description)
}

/// Step and state, one after the other.
fn points(rollout: &RolloutRecord, state: usize) -> impl Iterator<Item = [f64; 2]> {
    let value = move |x: &Vec<f32>| entry(x, state).unwrap_or(f64::NAN);
    rollout.states.iter().enumerate().map(move |(step, x)| [step as f64, value(x)])
}
