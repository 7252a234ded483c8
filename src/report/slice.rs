//! The slice of a record as a grid of cells and as fields that reach its outer edge.

use super::contour::Field;
use super::span::Span;
use super::text::ordinary;
use crate::rollout::HUGE;
use crate::scenario::drawn_record::GroundRecord;
use crate::scenario::record::Record;

/// Where the cells of a slice lie.
pub(super) struct Grid<'a> {
    /// The record that the slice is from.
    pub(super) record: &'a Record,
    /// Centres of the columns and rows.
    centers: [Vec<f64>; 2],
    /// Edges of the columns and rows: one more than centres.
    pub(super) edges: [Vec<f64>; 2],
}

impl<'a> Grid<'a> {
    /// The grid of the record's slice; `None` if its arrays do not make one.
    pub(super) fn new(record: &'a Record) -> Option<Self> {
        let slice = &record.slice;
        let cells = slice.x.values.len() * slice.y.values.len();
        let fields = [&slice.check_margin, &slice.target_margin, &slice.constraint_margin];
        if cells == 0 || fields.iter().any(|field| field.len() != cells) {
            return None;
        }
        let centers = [centers(&slice.x.values)?, centers(&slice.y.values)?];
        Some(Self::between(record, centers, [slice.x.state, slice.y.state]))
    }

    /// The grid of the ground of the record's picture; `None` if its arrays do not make one.
    pub(super) fn of_ground(record: &'a Record, ground: &GroundRecord) -> Option<Self> {
        let cells = ground.x.values.len() * ground.y.values.len();
        let fields = [&ground.target_margin, &ground.constraint_margin];
        if cells == 0 || fields.iter().any(|field| field.len() != cells) {
            return None;
        }
        let centers = [centers(&ground.x.values)?, centers(&ground.y.values)?];
        Some(Self::between(record, centers, [ground.x.state, ground.y.state]))
    }

    /// Cells around these middles along the axes of `states`.
    fn between(record: &'a Record, centers: [Vec<f64>; 2], states: [usize; 2]) -> Self {
        let edges = [0, 1].map(|axis| edges(&centers[axis], lone_width(record, states[axis])));
        Self { record, centers, edges }
    }

    /// What the slice covers across and upwards.
    pub(super) fn spans(&self) -> [Span; 2] {
        [0, 1].map(|axis| Span {
            low: self.edges[axis][0],
            high: self.edges[axis][self.edges[axis].len() - 1],
        })
    }

    /// Runs of neighbouring cells of a row with the same `label`, as `(label, [x0, y0, x1, y1])`.
    pub(super) fn runs<T: PartialEq>(
        &self,
        values: &[f32],
        label: impl Fn(f64) -> T,
    ) -> Vec<(T, [f64; 4])> {
        let [x, y] = &self.edges;
        let mut runs: Vec<(T, [f64; 4])> = Vec::new();
        for (row, cells) in values.chunks(x.len() - 1).enumerate() {
            for (column, &value) in cells.iter().enumerate() {
                let here = label(f64::from(value));
                match runs.last_mut() {
                    Some((last, area)) if column > 0 && *last == here => area[2] = x[column + 1],
                    _ => runs.push((here, [x[column], y[row], x[column + 1], y[row + 1]])),
                }
            }
        }
        runs
    }

    /// `sign` times the values as a field that continues straight to the outer edge of the cells.
    pub(super) fn field(&self, values: &[f32], sign: f64) -> Field {
        let [columns, rows] = [0, 1].map(|axis| self.centers[axis].len());
        let at = |column: usize, row: usize| {
            let value = f64::from(values[row * columns + column]);
            let huge = f64::from(HUGE);
            // A margin that is not a number is a violation.
            sign * if value.is_nan() { -huge } else { value.clamp(-huge, huge) }
        };
        let [x, y] = [0, 1].map(|axis| padded(&self.centers[axis], &self.edges[axis]));
        let mut padded_values = Vec::with_capacity(x.len() * y.len());
        for row in 0..y.len() {
            for column in 0..x.len() {
                let (near, mirror) = neighbours([column, row], [columns, rows]);
                let value = at(near[0], near[1]);
                let slope = value - at(mirror[0], mirror[1]);
                let reach = if ordinary(value) && ordinary(slope) { 0.5 } else { 0.0 };
                padded_values.push(value + reach * slope);
            }
        }
        Field { x, y, values: padded_values }
    }
}

/// The cell next to a padded position, and the one that a straight line to it comes from: the
/// same cell in the interior, where nothing is continued.
fn neighbours(position: [usize; 2], counts: [usize; 2]) -> ([usize; 2], [usize; 2]) {
    let near = [0, 1].map(|axis| position[axis].saturating_sub(1).min(counts[axis] - 1));
    let mirror = [0, 1].map(|axis| {
        let last = counts[axis] - 1;
        match position[axis] {
            0 => 1.min(last),
            index if index > counts[axis] => last.saturating_sub(1),
            _ => near[axis],
        }
    });
    (near, mirror)
}

/// The values of an axis if they are numbers in ascending order.
fn centers(values: &[f32]) -> Option<Vec<f64>> {
    let values: Vec<f64> = values.iter().map(|&value| f64::from(value)).collect();
    let ascending = values.windows(2).all(|pair| pair[0] < pair[1]);
    (ascending && values.iter().all(|&value| ordinary(value))).then_some(values)
}

/// Edges halfway between the centres; a lone cell is `lone` wide.
fn edges(centers: &[f64], lone: f64) -> Vec<f64> {
    let (first, last) = (centers[0], centers[centers.len() - 1]);
    let [low, high] = match centers {
        [_] => [lone / 2.0; 2],
        [.., before, _] => [(centers[1] - first) / 2.0, (last - before) / 2.0],
        [] => [0.0; 2],
    };
    let inner = centers.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0);
    std::iter::once(first - low).chain(inner).chain([last + high]).collect()
}

/// A tenth of the state's box, or one.
fn lone_width(record: &Record, state: usize) -> f64 {
    let axis = record.system.states.get(state);
    let width = axis.map_or(0.0, |axis| f64::from(axis.high - axis.low) / 10.0);
    if width > 0.0 && ordinary(width) { width } else { 1.0 }
}

/// The centres between the outermost edges.
fn padded(centers: &[f64], edges: &[f64]) -> Vec<f64> {
    let inner = centers.iter().copied();
    std::iter::once(edges[0]).chain(inner).chain([edges[edges.len() - 1]]).collect()
}
