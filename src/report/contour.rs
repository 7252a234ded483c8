//! Zero levels of a sampled field: lines and regions by marching squares.

use std::collections::BTreeMap;

/// A point in the coordinates of the field.
pub(super) type Point = [f64; 2];

/// A field sampled on a grid; values are finite.
pub(super) struct Field {
    /// Positions of the columns, ascending.
    pub(super) x: Vec<f64>,
    /// Positions of the rows, ascending.
    pub(super) y: Vec<f64>,
    /// Row by row: `[y.len(), x.len()]`.
    pub(super) values: Vec<f64>,
}

/// A corner of a cell.
#[derive(Clone, Copy)]
struct Corner {
    point: Point,
    value: f64,
}

impl Field {
    /// Whether it is positive anywhere: whether its region is drawn.
    pub(super) fn is_positive(&self) -> bool {
        self.values.iter().any(|value| *value > 0.0)
    }

    /// Whether it changes its sign: whether it has zero lines.
    pub(super) fn has_zero_lines(&self) -> bool {
        self.is_positive() && self.values.iter().any(|value| *value <= 0.0)
    }

    fn value(&self, column: usize, row: usize) -> f64 {
        self.values[row * self.x.len() + column]
    }

    /// The corners of a cell, counter-clockwise from the lower left.
    fn corners(&self, column: usize, row: usize) -> [Corner; 4] {
        [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(right, up)| {
            let (column, row) = (column + right, row + up);
            let point = [self.x[column], self.y[row]];
            Corner { point, value: self.value(column, row) }
        })
    }

    /// The four edges of a cell in the order of its corners, each by a number of its own.
    fn edges(&self, column: usize, row: usize) -> [usize; 4] {
        let below = |column: usize, row: usize| 2 * (row * self.x.len() + column);
        let left = |column: usize, row: usize| below(column, row) + 1;
        [below(column, row), left(column + 1, row), below(column, row + 1), left(column, row)]
    }

    /// Where values above zero meet the others, as lines; a closed line repeats its first point.
    pub(super) fn zero_lines(&self) -> Vec<Vec<Point>> {
        let mut points = BTreeMap::new();
        let mut links: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for row in 1..self.y.len() {
            for column in 1..self.x.len() {
                for [from, to] in self.segments(column - 1, row - 1, &mut points) {
                    links.entry(from).or_default().push(to);
                    links.entry(to).or_default().push(from);
                }
            }
        }
        joined(links)
            .into_iter()
            .map(|line| line.into_iter().map(|edge| points[&edge]).collect())
            .collect()
    }

    /// The pieces of the zero line in a cell, as pairs of edges; stores where each edge is cut.
    fn segments(
        &self,
        column: usize,
        row: usize,
        points: &mut BTreeMap<usize, Point>,
    ) -> Vec<[usize; 2]> {
        let corners = self.corners(column, row);
        let edges = self.edges(column, row);
        let cut: Vec<usize> = (0..4)
            .filter(|&side| {
                let (from, to) = (corners[side], corners[(side + 1) % 4]);
                let cuts = (from.value > 0.0) != (to.value > 0.0);
                if cuts {
                    points.insert(edges[side], crossing(from, to));
                }
                cuts
            })
            .collect();
        match cut[..] {
            [a, b] => vec![[edges[a], edges[b]]],
            [a, b, c, d] => {
                // A saddle: the mean says whether the two positive corners belong together.
                let mean: f64 = corners.iter().map(|corner| corner.value).sum();
                let pairs = if (mean > 0.0) == (corners[0].value > 0.0) {
                    [[a, b], [c, d]]
                } else {
                    [[d, a], [b, c]]
                };
                pairs.map(|pair| pair.map(|side| edges[side])).to_vec()
            }
            _ => Vec::new(),
        }
    }

    /// Polygons that together cover where the field is above zero.
    pub(super) fn region(&self) -> Vec<Vec<Point>> {
        let mut polygons = Vec::new();
        for row in 1..self.y.len() {
            // Whole cells of a row become one rectangle: a fine slice has tens of thousands.
            let mut run: Option<Vec<Point>> = None;
            for column in 1..self.x.len() {
                let corners = self.corners(column - 1, row - 1);
                if corners.iter().all(|corner| corner.value > 0.0) {
                    let points = corners.map(|corner| corner.point);
                    let [_, lower, upper, _] = points;
                    let run = run.get_or_insert_with(|| points.to_vec());
                    (run[1], run[2]) = (lower, upper);
                } else {
                    polygons.extend(run.take());
                    polygons.push(positive_part(&corners));
                }
            }
            polygons.extend(run);
        }
        polygons.retain(|polygon| polygon.len() > 2);
        polygons
    }
}

/// The part of a cell that is above zero.
fn positive_part(corners: &[Corner; 4]) -> Vec<Point> {
    let mut polygon = Vec::new();
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        if from.value > 0.0 {
            polygon.push(from.point);
        }
        if (from.value > 0.0) != (to.value > 0.0) {
            polygon.push(crossing(from, to));
        }
    }
    polygon
}

/// Where the straight line between two samples of different sign is zero.
fn crossing(from: Corner, to: Corner) -> Point {
    let share = from.value / (from.value - to.value);
    [0, 1].map(|axis| from.point[axis] + share * (to.point[axis] - from.point[axis]))
}

/// Lines through linked edges, each edge having one or two neighbours: open lines first.
fn joined(mut links: BTreeMap<usize, Vec<usize>>) -> Vec<Vec<usize>> {
    let ends: Vec<usize> =
        links.iter().filter(|(_, next)| next.len() == 1).map(|(&edge, _)| edge).collect();
    let all: Vec<usize> = links.keys().copied().collect();
    let mut lines = Vec::new();
    for start in ends.into_iter().chain(all) {
        let mut line = vec![start];
        let mut here = start;
        while let Some(next) = links.get_mut(&here).and_then(Vec::pop) {
            if let Some(back) = links.get_mut(&next)
                && let Some(index) = back.iter().position(|&edge| edge == here)
            {
                back.swap_remove(index);
            }
            line.push(next);
            here = next;
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::{Field, Point};

    fn sampled(cells: usize, value: impl Fn(f64, f64) -> f64) -> Field {
        let axis: Vec<f64> =
            (0..=cells).map(|index| 2.0 * index as f64 / cells as f64 - 1.0).collect();
        let values = axis
            .iter()
            .flat_map(|&y| axis.iter().map(move |&x| (x, y)))
            .map(|(x, y)| value(x, y))
            .collect();
        Field { x: axis.clone(), y: axis, values }
    }

    fn area(polygons: &[Vec<Point>]) -> f64 {
        let one = |polygon: &Vec<Point>| -> f64 {
            (0..polygon.len())
                .map(|index| {
                    let [[a, b], [c, d]] = [polygon[index], polygon[(index + 1) % polygon.len()]];
                    (a * d - b * c) / 2.0
                })
                .sum()
        };
        polygons.iter().map(one).sum()
    }

    #[test]
    fn a_disc_has_one_closed_line_at_its_radius() {
        let field = sampled(40, |x, y| 0.25 - x * x - y * y);
        let lines = field.zero_lines();
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].first(), lines[0].last());
        // Linear interpolation of a parabola between samples h apart errs by at most h^2 / 4 in
        // the value, which is h^2 / 4 / (2 * 0.5) in the radius.
        let step: f64 = 2.0 / 40.0;
        for [x, y] in &lines[0] {
            assert!((x.hypot(*y) - 0.5).abs() <= step * step / 4.0 + 1e-12);
        }
    }

    #[test]
    fn a_straight_edge_is_exact() {
        let field = sampled(7, |x, y| x + 0.5 * y - 0.1);
        let lines = field.zero_lines();
        assert_eq!(lines.len(), 1);
        for [x, y] in &lines[0] {
            assert!((x + 0.5 * y - 0.1).abs() < 1e-12);
        }
        // The half plane cuts the square [-1, 1]^2 where x > 0.1 - y / 2: area 2 * 0.9.
        assert!((area(&field.region()) - 1.8).abs() < 1e-12);
    }

    #[test]
    fn saddles_keep_every_segment() {
        let field = sampled(2, |x, y| if (x * y).abs() > 0.5 || x == y { 1.0 } else { -1.0 });
        let count: usize = field.zero_lines().iter().map(|line| line.len() - 1).sum();
        // Each of the four cells has its two zero edges at one negative corner, or a saddle.
        assert!(count >= 4, "{count} segments");
        assert!(area(&field.region()) > 0.0);
    }

    #[test]
    fn one_sign_has_no_line() {
        for value in [-1.0, 0.0, 1.0] {
            assert!(sampled(5, |_, _| value).zero_lines().is_empty());
        }
        assert!((area(&sampled(5, |_, _| 1.0).region()) - 4.0).abs() < 1e-12);
        assert!(sampled(5, |_, _| -1.0).region().is_empty());
        assert!(sampled(0, |_, _| 1.0).region().is_empty());
    }
}
