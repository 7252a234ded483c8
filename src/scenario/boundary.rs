//! Boundary search: the point of the certified set's boundary that is closest to a state.

use super::criterion::Criterion;
use super::global::slice_through;
use super::growth_plan::Around;
use super::purpose;
use super::settings::Settings;
use super::{Context, settings::BoundarySearch};
use crate::error::Result;
use crate::real::Lanes;
use crate::rollout::{Query, StateList, States, Stream, sample_ball};

/// Directions of each sweep of the ray search.
const DIRECTIONS: u64 = 512;
/// Points along each ray, before the bisection.
const POINTS: usize = 16;
/// Halvings of a bracket.
const BISECTIONS: usize = 20;
/// Directions where a state costs an enclosure instead of a rollout.
const ENCLOSED_DIRECTIONS: u64 = 64;
/// Halvings there: a bracket to within a thousandth of its width.
const ENCLOSED_BISECTIONS: usize = 10;
/// Spread of the directions around the best one so far, sweep by sweep; the first is uniform.
const SPREADS: [f32; 4] = [0.0, 0.6, 0.3, 0.1];
/// The eight neighbours of a cell.
const NEIGHBOURS: [(isize, isize); 8] =
    [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)];
/// Cosine above which a cell counts as straight ahead, from the study.
const STRAIGHT: f64 = 0.9;

/// A certified state next to one that is not, and its distance from the state searched from.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary {
    /// The certified state.
    pub point: Vec<f32>,
    /// Its Euclidean distance.
    pub distance: f64,
}

/// The closest boundary point of the set that `bound` certifies, where there is one; else of the certified
/// set. `band` as in [`Criterion::margins`].
///
/// # Errors
/// Those of the backend.
pub fn center(
    context: Context<'_>,
    settings: &Settings,
    bound: Option<&Criterion<'_>>,
    certified: &Criterion<'_>,
    band: f64,
) -> Result<Option<Center>> {
    let sets = bound.map(|bound| (Around::Bound, bound));
    for (around, criterion) in sets.into_iter().chain([(Around::Set, certified)]) {
        if let Some(boundary) = search(context, settings, criterion, band)? {
            return Ok(Some(Center { around, boundary }));
        }
    }
    Ok(None)
}

/// The centre of a growth.
#[derive(Clone, Debug, PartialEq)]
pub struct Center {
    /// Whose boundary it lies on.
    pub around: Around,
    /// The boundary point.
    pub boundary: Boundary,
}

/// The closest boundary point of the set that `criterion` certifies, by the method that `settings` ask for;
/// none if there is none.
fn search(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
    band: f64,
) -> Result<Option<Boundary>> {
    match settings.growth.boundary {
        BoundarySearch::Slice => {
            let cells = slice_through(settings, &settings.state);
            let (spec, cells, query) = (&settings.spec, cells.view(), Query::Measure);
            let margins = criterion.margins(context, spec, cells, query, band)?;
            let certified: Vec<bool> = margins.iter().map(|margin| *margin > 0.0).collect();
            Ok(on_slice(settings, &settings.state, &certified))
        }
        BoundarySearch::Rays => along_rays(context, settings, criterion),
    }
}

/// The study's choice: a certified cell with an uncertified neighbour (of eight; the rim of the
/// slice counts as uncertified), cells ahead of the velocity preferred, then the nearest.
///
/// `certified` says it of each cell of the slice through `state`, row by row.
pub(crate) fn on_slice(settings: &Settings, state: &[f32], certified: &[bool]) -> Option<Boundary> {
    let [columns, rows] = settings.slice_size();
    let certified = |row: usize, column: usize| {
        row < rows && column < columns && certified[row * columns + column]
    };
    let states = slice_through(settings, state);
    let mut cells: Vec<&[f32]> = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let surrounded = NEIGHBOURS.iter().all(|(dr, dc)| {
                certified(row.wrapping_add_signed(*dr), column.wrapping_add_signed(*dc))
            });
            if certified(row, column) && !surrounded {
                cells.push(states.row(row * columns + column));
            }
        }
    }
    nearest(settings.growth.heading, state, cells)
}

/// The nearest of `cells`, of those ahead of the velocity if there are any.
fn nearest(heading: Option<[usize; 4]>, state: &[f32], mut cells: Vec<&[f32]>) -> Option<Boundary> {
    if let Some([x, vx, y, vy]) = heading {
        let speed = f64::from(state[vx]).hypot(f64::from(state[vy]));
        let ahead = |cell: &[f32], least_cosine: f64| {
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
    let measured = cells
        .into_iter()
        .map(|point| Boundary { point: point.to_vec(), distance: distance(point, state) });
    measured.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// Euclidean distance.
pub(super) fn distance(a: &[f32], b: &[f32]) -> f64 {
    let square = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    a.iter().zip(b).map(square).sum::<f64>().sqrt()
}

/// Batched bisection along many directions in the coordinates that vary, then along directions
/// ever closer to the best one.
///
/// Searches inside the box only: the certificate says nothing outside.
fn along_rays(
    context: Context<'_>,
    settings: &Settings,
    criterion: &Criterion<'_>,
) -> Result<Option<Boundary>> {
    let effort = Effort::of(criterion);
    let rays = effort.directions * (POINTS + effort.bisections) as u64;
    context.watch.begin("boundary search", rays * SPREADS.len() as u64);
    let certified = |states: States<'_>| -> Result<Vec<bool>> {
        let inside = |x: &[f32]| settings.in_box(x);
        let asked = StateList::new(states.size()).with(states.iter().filter(|x| inside(x)));
        let (spec, query) = (&settings.spec, Query::Sign);
        let signs = criterion.margins(context, spec, asked.view(), query, 0.0)?;
        let mut signs = signs.into_iter();
        let certified = |x: &[f32]| inside(x) && signs.next().is_some_and(|sign| sign > 0.0);
        Ok(states.iter().map(certified).collect())
    };
    let start_certified = certified(States::one(&settings.state))?[0];
    let mut best: Option<Found> = None;
    for (sweep, spread) in SPREADS.into_iter().enumerate() {
        let around = best.as_ref().map(|found| Cone { axis: &found.direction, spread });
        let directions = directions(settings, effort, sweep as u32, around);
        let found = sweep_rays(settings, effort, directions.view(), start_certified, certified)?;
        let nearer = |found: &Found| {
            best.as_ref().is_none_or(|best| found.boundary.distance < best.boundary.distance)
        };
        if let Some(found) = found.filter(nearer) {
            best = Some(found);
        }
    }
    Ok(best.map(|found| found.boundary))
}

/// How finely rays are searched.
#[derive(Clone, Copy)]
struct Effort {
    /// Directions of each sweep.
    directions: u64,
    /// Halvings of a bracket.
    bisections: usize,
}

impl Effort {
    /// What a state costs decides.
    fn of(criterion: &Criterion<'_>) -> Self {
        let (directions, bisections) = match criterion {
            Criterion::Margins(_) => (DIRECTIONS, BISECTIONS),
            Criterion::Enclosed(_) => (ENCLOSED_DIRECTIONS, ENCLOSED_BISECTIONS),
        };
        Self { directions, bisections }
    }
}

/// Directions around one.
struct Cone<'a> {
    /// The unit direction in its middle.
    axis: &'a [f32],
    /// Length of the offsets from it, before their sums are scaled to length one.
    spread: f32,
}

/// Unit directions in the coordinates that vary: uniform, or spread around a given one.
fn directions(
    settings: &Settings,
    effort: Effort,
    sweep: u32,
    around: Option<Cone<'_>>,
) -> StateList {
    let stream = Stream::new(settings.seed, purpose::DIRECTION, sweep);
    let draw = |index: u64| {
        let mut offset = vec![Lanes([0.0]); settings.state.len()];
        sample_ball::<1>(stream, index, |i| settings.growth.varies[i], &mut offset);
        let direction = unit(offset.into_iter().map(|lane| lane.0[0]).collect());
        match &around {
            Some(Cone { axis, spread }) => {
                let both = axis.iter().zip(direction);
                unit(both.map(|(axis, direction)| axis + spread * direction).collect())
            }
            None => direction,
        }
    };
    StateList::new(settings.state.len()).with((0..effort.directions).map(draw))
}

/// `vector` scaled to length one.
fn unit(mut vector: Vec<f32>) -> Vec<f32> {
    let length = vector.iter().map(|x| x * x).sum::<f32>().sqrt();
    vector.iter_mut().for_each(|x| *x /= length);
    vector
}

/// A boundary point and the direction that it lies in.
struct Found {
    boundary: Boundary,
    direction: Vec<f32>,
}

/// The closest change of `certified` along the rays, with its direction.
fn sweep_rays(
    settings: &Settings,
    effort: Effort,
    directions: States<'_>,
    start_certified: bool,
    certified: impl Fn(States<'_>) -> Result<Vec<bool>>,
) -> Result<Option<Found>> {
    let at = |direction: &[f32], length: f32| -> Vec<f32> {
        let both = settings.state.iter().zip(direction);
        both.map(|(state, direction)| state + length * direction).collect()
    };
    let reach = settings.low.iter().zip(&settings.high).map(|(low, high)| high - low);
    let reach = reach.fold(0.0, f32::max);
    let lengths: Vec<f32> =
        (1..=POINTS).map(|k| reach * (k as f32 / POINTS as f32).powi(2)).collect();
    let size = settings.state.len();
    let points = directions.iter().flat_map(|d| lengths.iter().map(|length| at(d, *length)));
    let inside = certified(StateList::new(size).with(points).view())?;
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
    for _ in 0..effort.bisections {
        let middle =
            |(ray, near, far): &(usize, f32, f32)| at(directions.row(*ray), 0.5 * (near + far));
        let middles = StateList::new(size).with(brackets.iter().map(middle));
        let inside = certified(middles.view())?;
        for ((_, near, far), inside) in brackets.iter_mut().zip(inside) {
            let middle = 0.5 * (*near + *far);
            *(if inside == start_certified { near } else { far }) = middle;
        }
    }
    let closest = brackets.into_iter().min_by(|a, b| a.2.total_cmp(&b.2));
    Ok(closest.map(|(ray, near, far)| {
        // The certified end of the bracket.
        let direction = directions.row(ray).to_vec();
        let point = at(&direction, if start_certified { near } else { far });
        let distance = distance(&point, &settings.state);
        Found { boundary: Boundary { point, distance }, direction }
    }))
}
