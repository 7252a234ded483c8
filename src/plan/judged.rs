//! What a run came to: its measure, and the step at which its task is done.

use super::closed_loop::Trajectory;
use crate::model::Model;
use crate::rollout::replay::{Margins, margins, measure_of};
use crate::rollout::{RolloutSpec, Tightening};

/// A run as its task sees it, in f64 on the states as they are stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// Measure of the task; positive where it holds.
    pub measure: f64,
    /// The first step from which on it is known to hold.
    pub reached: Option<u32>,
    /// Target margin of each state, `[T + 1]`.
    pub target: Vec<f64>,
    /// Constraint margin of each state, `[T + 1]`.
    pub constraint: Vec<f64>,
}

impl Judged {
    /// Judges a run of at most `spec.horizon` steps.
    pub fn new(model: &Model, run: &Trajectory, spec: &RolloutSpec) -> Self {
        let wide = |x: &Vec<f32>| x.iter().copied().map(f64::from).collect();
        let states: Vec<Vec<f64>> = run.states.iter().map(wide).collect();
        let looks = looks(model, run, &states);
        let all = margins(model, spec.horizon, looks.iter().map(Vec::as_slice));
        let at = |margin: fn(&Model, &[f64], u32) -> f64| -> Vec<f64> {
            (0..).zip(&states).map(|(step, x)| margin(model, x, step)).collect()
        };
        Self {
            measure: prefix(&all, all.len(), spec),
            reached: reached(&all, spec),
            target: at(|model, x, step| model.target_at(x, step)),
            constraint: at(|model, x, step| model.constraint_at(x, step)),
        }
    }

    /// Whether the task holds.
    pub fn success(&self) -> bool {
        self.measure > 0.0
    }
}

/// The states that are looked at: those that are stored, and the points between them.
fn looks(model: &Model, run: &Trajectory, states: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut looks: Vec<Vec<f64>> = states.iter().take(1).cloned().collect();
    for ((step, pair), u) in (0..).zip(states.windows(2)).zip(&run.controls) {
        let u: Vec<f64> = u.iter().copied().map(f64::from).collect();
        let mut parts = model.parts(&pair[0], &u, step);
        parts.truncate(model.points as usize - 1);
        looks.extend(parts);
        looks.push(pair[1].clone());
    }
    looks
}

/// The measure of the first `count` looks.
fn prefix(all: &[Margins], count: usize, spec: &RolloutSpec) -> f64 {
    measure_of(&all[..count], spec, &Tightening::none(spec))
}

/// The first step with which the measure is positive, that of the sample at or after the look: from there on it
/// stays so.
fn reached(all: &[Margins], spec: &RolloutSpec) -> Option<u32> {
    let counts: Vec<usize> = (1..=all.len()).collect();
    let place = counts.partition_point(|&count| prefix(all, count, spec) <= 0.0);
    all.get(place).map(|margins| margins.moment.sample() as u32)
}
