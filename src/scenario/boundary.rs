//! Boundary search: the point of the certified set's boundary that is closest to a state.

use super::global::{check_margins, slice_through};
use super::record::SliceRecord;
use super::settings::Settings;
use super::{Context, settings::BoundarySearch};
use crate::error::Result;
use crate::policy::Policy;
use crate::real::Lanes;
use crate::rollout::{Purpose, Query, Stream, Tightening, sample_ball};
use crate::system::System;

/// Directions of each sweep of the ray search.
const DIRECTIONS: u64 = 512;
/// Points along each ray, before the bisection.
const POINTS: usize = 16;
/// Halvings of a bracket.
const BISECTIONS: usize = 20;
/// Spread of the directions around the best one so far, sweep by sweep; the first is uniform.
const SPREADS: [f32; 4] = [0.0, 0.6, 0.3, 0.1];
/// The eight neighbours of a cell.
const NEIGHBOURS: [(isize, isize); 8] =
    [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)];
/// Cosine above which a cell counts as straight ahead, from the study.
const STRAIGHT: f64 = 0.9;

/// A certified state next to one that is not, and its distance from the state searched from.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary<const NX: usize> {
    /// The certified state.
    pub point: [f32; NX],
    /// Its Euclidean distance.
    pub distance: f64,
}

/// The closest boundary point by the method that `settings` ask for; none if there is none.
pub fn search<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
    tightening: &Tightening,
    slice: &SliceRecord,
) -> Result<Option<Boundary<NX>>>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    match settings.growth.boundary {
        BoundarySearch::Slice => {
            let certified: Vec<bool> = slice.check_margin.iter().map(|v| *v > 0.0).collect();
            Ok(on_slice(settings, &settings.state, &certified))
        }
        BoundarySearch::Rays => along_rays(context, settings, tightening),
    }
}

/// The study's choice: a certified cell with an uncertified neighbour (of eight; the rim of the
/// slice counts as uncertified), cells ahead of the velocity preferred, then the nearest.
///
/// `certified` says it of each cell of the slice through `state`, row by row.
pub(crate) fn on_slice<const NX: usize>(
    settings: &Settings<NX>,
    state: &[f32; NX],
    certified: &[bool],
) -> Option<Boundary<NX>> {
    let [columns, rows] = [0, 1].map(|axis| settings.slice[axis].values.len());
    let certified = |row: usize, column: usize| {
        row < rows && column < columns && certified[row * columns + column]
    };
    let states = slice_through(settings, state);
    let mut cells = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let surrounded = NEIGHBOURS.iter().all(|(dr, dc)| {
                certified(row.wrapping_add_signed(*dr), column.wrapping_add_signed(*dc))
            });
            if certified(row, column) && !surrounded {
                cells.push(states[row * columns + column]);
            }
        }
    }
    nearest(settings.growth.heading, state, cells)
}

/// The nearest of `cells`, of those ahead of the velocity if there are any.
fn nearest<const NX: usize>(
    heading: Option<[usize; 4]>,
    state: &[f32; NX],
    mut cells: Vec<[f32; NX]>,
) -> Option<Boundary<NX>> {
    if let Some([x, vx, y, vy]) = heading {
        let speed = f64::from(state[vx]).hypot(f64::from(state[vy]));
        let ahead = |cell: &[f32; NX], least_cosine: f64| {
            let (dx, dy) = (f64::from(cell[x] - state[x]), f64::from(cell[y] - state[y]));
            let projection = dx * f64::from(state[vx]) + dy * f64::from(state[vy]);
            projection > 0.0 && projection > least_cosine * speed * dx.hypot(dy)
        };
        for least_cosine in [0.0, STRAIGHT] {
            if cells.iter().any(|cell| ahead(cell, least_cosine)) {
                cells.retain(|cell| ahead(cell, least_cosine));
            }
        }
    }
    let measured =
        cells.into_iter().map(|point| Boundary { point, distance: distance(&point, state) });
    measured.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// Euclidean distance.
pub(super) fn distance<const NX: usize>(a: &[f32; NX], b: &[f32; NX]) -> f64 {
    let square = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    a.iter().zip(b).map(square).sum::<f64>().sqrt()
}

/// Batched bisection along many directions in the coordinates that vary, then along directions
/// ever closer to the best one.
///
/// Searches inside the box only: the certificate says nothing outside.
fn along_rays<S, P, const NX: usize, const NU: usize>(
    context: Context<'_, S, P>,
    settings: &Settings<NX>,
    tightening: &Tightening,
) -> Result<Option<Boundary<NX>>>
where
    S: System<NX, NU>,
    P: Policy<NX, NU>,
{
    let rays = DIRECTIONS * (POINTS + BISECTIONS) as u64;
    context.watch.begin("boundary search", rays * SPREADS.len() as u64);
    let certified = |states: &[[f32; NX]]| -> Result<Vec<bool>> {
        let margins = check_margins(context, &settings.spec, tightening, states, Query::Sign, 0.0)?;
        let inside =
            |x: &[f32; NX]| (0..NX).all(|i| settings.low[i] <= x[i] && x[i] <= settings.high[i]);
        Ok(states.iter().zip(margins).map(|(x, margin)| margin > 0.0 && inside(x)).collect())
    };
    let start_certified = certified(&[settings.state])?[0];
    let mut best: Option<(Boundary<NX>, [f32; NX])> = None;
    for (sweep, spread) in SPREADS.into_iter().enumerate() {
        let around = best.as_ref().map(|(_, direction)| (*direction, spread));
        let directions = directions(settings, sweep as u32, around);
        let found = sweep_rays(settings, &directions, start_certified, certified)?;
        let nearer = |boundary: &Boundary<NX>| {
            best.as_ref().is_none_or(|(best, _)| boundary.distance < best.distance)
        };
        if let Some(found) = found.filter(|(boundary, _)| nearer(boundary)) {
            best = Some(found);
        }
    }
    Ok(best.map(|(boundary, _)| boundary))
}

/// Unit directions in the coordinates that vary: uniform, or spread around a given one.
fn directions<const NX: usize>(
    settings: &Settings<NX>,
    sweep: u32,
    around: Option<([f32; NX], f32)>,
) -> Vec<[f32; NX]> {
    let stream = Stream::new(settings.seed, Purpose::Direction, sweep);
    let draw = |index: u64| {
        let mut offset = [Lanes([0.0]); NX];
        sample_ball::<1>(stream, index, |i| settings.growth.varies[i], &mut offset);
        let mut direction = unit(offset.map(|lane| lane.0[0]));
        if let Some((center, spread)) = around {
            direction = unit(std::array::from_fn(|i| center[i] + spread * direction[i]));
        }
        direction
    };
    (0..DIRECTIONS).map(draw).collect()
}

/// `vector` scaled to length one.
fn unit<const NX: usize>(vector: [f32; NX]) -> [f32; NX] {
    let length = vector.iter().map(|x| x * x).sum::<f32>().sqrt();
    vector.map(|x| x / length)
}

/// The closest change of `certified` along the rays, with its direction.
fn sweep_rays<const NX: usize>(
    settings: &Settings<NX>,
    directions: &[[f32; NX]],
    start_certified: bool,
    certified: impl Fn(&[[f32; NX]]) -> Result<Vec<bool>>,
) -> Result<Option<(Boundary<NX>, [f32; NX])>> {
    let at = |direction: &[f32; NX], length: f32| -> [f32; NX] {
        std::array::from_fn(|i| settings.state[i] + length * direction[i])
    };
    let reach = settings.low.iter().zip(settings.high).map(|(low, high)| high - low);
    let reach = reach.fold(0.0, f32::max);
    let lengths: Vec<f32> =
        (1..=POINTS).map(|k| reach * (k as f32 / POINTS as f32).powi(2)).collect();
    let points: Vec<_> =
        directions.iter().flat_map(|d| lengths.iter().map(|length| at(d, *length))).collect();
    let inside = certified(&points)?;
    // Brackets [near, far] of the first change along each ray; near has the state's side.
    let mut brackets = Vec::new();
    for (ray, inside) in inside.chunks(POINTS).enumerate() {
        if let Some(k) = inside.iter().position(|inside| *inside != start_certified) {
            brackets.push((
                ray,
                k.checked_sub(1).map_or(0.0, |before| lengths[before]),
                lengths[k],
            ));
        }
    }
    for _ in 0..BISECTIONS {
        let middle =
            |(ray, near, far): &(usize, f32, f32)| at(&directions[*ray], 0.5 * (near + far));
        let inside = certified(&brackets.iter().map(middle).collect::<Vec<_>>())?;
        for ((_, near, far), inside) in brackets.iter_mut().zip(inside) {
            let middle = 0.5 * (*near + *far);
            *(if inside == start_certified { near } else { far }) = middle;
        }
    }
    let closest = brackets.into_iter().min_by(|a, b| a.2.total_cmp(&b.2));
    Ok(closest.map(|(ray, near, far)| {
        // The certified end of the bracket.
        let point = at(&directions[ray], if start_certified { near } else { far });
        (Boundary { point, distance: distance(&point, &settings.state) }, directions[ray])
    }))
}
