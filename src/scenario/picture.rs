//! The picture of a certificate: a few rollouts, and for a model as text the bodies, shapes and margins
//! around them.

use super::drawn_record::{DrawnBody, DrawnRecord, GroundAxis, GroundRecord};
use super::purpose;
use super::record::{GrowthRecord, PictureRecord, RolloutRecord};
use super::settings::Settings;
use crate::model::{Model, PlacedBody, Plant};
use crate::rollout::{Region, Stream, Tightening, replay};

/// Rollouts drawn in the picture: the state's, and that many starts of the growth.
const PICTURED: usize = 12;
/// Cells of the ground along each axis.
const CELLS: usize = 48;
/// Share of what the frame has to hold by which it is wider on each side.
const ROOM: f64 = 0.08;
/// The same for where targets are looked for.
const SEARCH: f64 = 0.5;

/// A few rollouts: the state's, then starts of the growth's last round.
pub(super) fn picture(plant: &Plant, settings: &Settings, growth: &GrowthRecord) -> PictureRecord {
    let region = Region::Box { low: settings.low.to_vec(), high: settings.high.to_vec() };
    let stream = Stream::new(settings.seed, purpose::PICTURE, 0);
    let sampled = growth.samples.iter().take(PICTURED).map(|sample| sample.x.clone());
    let mut starts: Vec<Vec<f32>> =
        std::iter::once(settings.state.to_vec()).chain(sampled).collect();
    let missing = (PICTURED + 1).saturating_sub(starts.len()) as u64;
    for index in 0..missing {
        starts.push(region.point(stream, index));
    }
    let none = Tightening::none(&settings.spec);
    let rollouts = starts.into_iter().map(|start| RolloutRecord {
        states: finite(replay::states(plant, &start, settings.spec.horizon)),
        success: replay::measure(plant, &start, &settings.spec, &none) > 0.0,
    });
    let rollouts: Vec<RolloutRecord> = rollouts.collect();
    let drawn = drawn(&plant.model, settings, &rollouts);
    PictureRecord { rollouts, drawn }
}

/// States up to the first that is not finite: JSON has no word for it, and nobody draws it.
fn finite(states: Vec<Vec<f32>>) -> Vec<Vec<f32>> {
    let all = |state: &Vec<f32>| state.iter().all(|x| x.is_finite());
    states.into_iter().take_while(all).collect()
}

/// What is drawn beside the `rollouts`, for a model as text.
fn drawn(model: &Model, settings: &Settings, rollouts: &[RolloutRecord]) -> Option<DrawnRecord> {
    if model.native.is_some() {
        return None;
    }
    let states: Vec<&[Vec<f32>]> = rollouts.iter().map(|rollout| &rollout.states[..]).collect();
    let ground = plane(model, settings).map(|plane| ground(model, settings, rollouts, plane));
    Some(DrawnRecord { ground, ..bodies_and_shapes(model, &states) })
}

/// The bodies of `model` along `runs`, a list of states each, and its shapes.
pub fn bodies_and_shapes(model: &Model, runs: &[&[Vec<f32>]]) -> DrawnRecord {
    let along = |body: &PlacedBody, axis| -> Vec<Vec<f32>> {
        runs.iter().map(|states| path(model, body, states, axis)).collect()
    };
    let body = |body: &PlacedBody| DrawnBody {
        name: body.name.clone(),
        written: body.written.clone(),
        size: body.size,
        joined: body.joined,
        right: along(body, 0),
        up: along(body, 1),
    };
    DrawnRecord {
        bodies: model.picture.bodies.iter().map(body).collect(),
        shapes: model.picture.shapes.clone(),
        ground: None,
    }
}

/// Where `body` is along an axis of the picture in a run.
fn path(model: &Model, body: &PlacedBody, states: &[Vec<f32>], axis: usize) -> Vec<f32> {
    let place = |(step, x): (u32, &Vec<f32>)| body.at.eval(&model.at_state(x, step))[axis];
    (0..).zip(states).map(place).collect()
}

/// The two states that the first body moves along; of a model without bodies, those of the slice.
fn plane(model: &Model, settings: &Settings) -> Option<[usize; 2]> {
    let placed = model.picture.bodies.first();
    let body = model.bodies.iter().find(|body| placed.is_none_or(|first| first.name == body.name));
    match (body, placed) {
        (Some(body), _) => Some([body.x, body.y]),
        (None, Some(_)) => None,
        (None, None) => {
            settings.slice.as_ref().map(|slice| slice.each_ref().map(|axis| axis.state))
        }
    }
    .filter(|[x, y]| x != y)
}

/// Margins over the plane of the states `plane`, as far as the frame of the picture goes.
fn ground(
    model: &Model,
    settings: &Settings,
    rollouts: &[RolloutRecord],
    plane: [usize; 2],
) -> GroundRecord {
    let held = held(model, settings, rollouts, plane);
    let wide = margins(model, settings, plane, held.map(|span| widened(span, SEARCH)));
    let target = covered(&wide, &wide.target_margin);
    let frame = [0, 1].map(|axis| {
        let span = target.map_or(held[axis], |target| joined(held[axis], target[axis]));
        widened(span, ROOM)
    });
    margins(model, settings, plane, frame)
}

/// What the frame has to hold: the box, the shapes, the paths of rollouts that succeed, and of others what
/// stays near these.
fn held(
    model: &Model,
    settings: &Settings,
    rollouts: &[RolloutRecord],
    plane: [usize; 2],
) -> [[f64; 2]; 2] {
    [0, 1].map(|axis| {
        let state = plane[axis];
        let paths = |success: bool| {
            let those = rollouts.iter().filter(move |rollout| rollout.success == success);
            those.flat_map(|rollout| &rollout.states).map(move |x| f64::from(x[state]))
        };
        let shapes = model.picture.shapes.iter().flat_map(|shape| {
            let extent = shape.outline.extent();
            [extent[axis], extent[axis + 2]]
        });
        let first = [f64::from(settings.low[state]), f64::from(settings.high[state])];
        let held = shapes.chain(paths(true)).fold(first, reaching);
        let [low, high] = widened(held, SEARCH);
        paths(false).map(|value| value.clamp(low, high)).fold(held, reaching)
    })
}

/// The interval with `value` in it.
fn reaching([low, high]: [f64; 2], value: f64) -> [f64; 2] {
    [low.min(value), high.max(value)]
}

/// The smallest interval that holds both.
fn joined(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The interval, wider by a share of its width on each side, and never empty.
fn widened([low, high]: [f64; 2], share: f64) -> [f64; 2] {
    let width = high - low;
    let reach = if width > 0.0 { share * width } else { 0.5 };
    [low - reach, high + reach]
}

/// Margins over a frame.
fn margins(
    model: &Model,
    settings: &Settings,
    plane: [usize; 2],
    frame: [[f64; 2]; 2],
) -> GroundRecord {
    let [x, y] = [0, 1].map(|axis| cells(plane[axis], frame[axis]));
    let (mut target_margin, mut constraint_margin) = (Vec::new(), Vec::new());
    let mut state = settings.state.to_vec();
    for &up in &y.values {
        for &across in &x.values {
            (state[plane[0]], state[plane[1]]) = (across, up);
            target_margin.push(model.target_at(&state, 0));
            constraint_margin.push(model.constraint_at(&state, 0));
        }
    }
    GroundRecord { x, y, target_margin, constraint_margin }
}

/// The middles of the cells of an axis.
fn cells(state: usize, [low, high]: [f64; 2]) -> GroundAxis {
    let middle = |i: usize| (low + (high - low) * (i as f64 + 0.5) / CELLS as f64) as f32;
    GroundAxis { state, values: (0..CELLS).map(middle).collect() }
}

/// What the cells with a positive margin cover, if there is one.
fn covered(ground: &GroundRecord, margin: &[f32]) -> Option<[[f64; 2]; 2]> {
    let columns = ground.x.values.len();
    let inside = margin.iter().enumerate().filter(|(_, margin)| **margin > 0.0);
    let places = inside.map(|(cell, _)| {
        let [x, y] = [ground.x.values[cell % columns], ground.y.values[cell / columns]];
        [[f64::from(x); 2], [f64::from(y); 2]]
    });
    places.reduce(|a, b| [0, 1].map(|axis| joined(a[axis], b[axis])))
}
