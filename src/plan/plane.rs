//! The margins over the plane that runs are drawn in.

use super::closed_loop::Trajectory;
use crate::model::Model;
use crate::rollout::HUGE;

/// Places along each side of the plane.
const PLACES: usize = 61;
/// Share of the plane that lies beyond the paths and the box, on each side.
const ROOM: f64 = 0.08;

/// Margins over two states, the others as at one state, at step 0.
#[derive(Clone, Debug)]
pub struct Plane {
    /// The state across and the state upwards.
    pub states: [usize; 2],
    /// Their values, ascending.
    pub values: [Vec<f64>; 2],
    /// Target margin, row by row upwards, `[values[1], values[0]]`; no number is a violation.
    pub target: Vec<f64>,
    /// Constraint margin in the same order.
    pub constraint: Vec<f64>,
}

impl Plane {
    /// The plane of the first body of `model`, else of its first two states, as far as `runs` and the box
    /// `bounds` reach, the other states as the first run has them at first; none for a single state.
    pub fn new(model: &Model, runs: &[Trajectory], bounds: &[Vec<f32>; 2]) -> Option<Self> {
        let states = model.bodies.first().map_or([0, 1], |body| [body.x, body.y]);
        if states.iter().any(|state| *state >= model.states.len()) || states[0] == states[1] {
            return None;
        }
        let at = runs.first()?.states.first()?;
        let values = states.map(|state| values(reach(runs, bounds, state)));
        let mut plane = Self { states, values, target: Vec::new(), constraint: Vec::new() };
        let mut x: Vec<f64> = at.iter().copied().map(f64::from).collect();
        for row in 0..PLACES {
            for column in 0..PLACES {
                x[states[0]] = plane.values[0][column];
                x[states[1]] = plane.values[1][row];
                plane.target.push(shown(model.target_at(&x, 0)));
                plane.constraint.push(shown(model.constraint_at(&x, 0)));
            }
        }
        Some(plane)
    }
}

/// A margin as a finite number.
fn shown(margin: f64) -> f64 {
    let huge = f64::from(HUGE);
    if margin.is_nan() { -huge } else { margin.clamp(-huge, huge) }
}

/// The ends of a state over all paths and the box.
fn reach(runs: &[Trajectory], bounds: &[Vec<f32>; 2], state: usize) -> [f64; 2] {
    let paths = runs.iter().flat_map(|run| &run.states).map(|x| x[state]);
    let sides = bounds.iter().map(|side| side[state]);
    let ends = [f32::INFINITY, f32::NEG_INFINITY];
    let wider = |[low, high]: [f32; 2], x: f32| [low.min(x), high.max(x)];
    paths.chain(sides).filter(|x| x.is_finite()).fold(ends, wider).map(f64::from)
}

/// Equally spaced values somewhat beyond both ends.
fn values([low, high]: [f64; 2]) -> Vec<f64> {
    let width = if high > low { high - low } else { 1.0 };
    let (from, step) =
        (low - ROOM * width, (high - low + 2.0 * ROOM * width) / (PLACES - 1) as f64);
    (0..PLACES).map(|place| from + place as f64 * step).collect()
}
