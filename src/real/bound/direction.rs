//! Directions in the plane, as corners of a polygon around the arcs that hold them.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use super::elementary::{cos, sin};
use crate::real::interval::Interval;

/// Arcs of the unit circle; a constant exceeds the true one by at most `1 / cos(pi / 64)`, 0.12 %.
pub(super) const ARCS: usize = 64;

/// A point of the plane.
type Point = [Interval; 2];

/// Start of each arc, and the corner where the tangents at its two ends meet.
static CIRCLE: LazyLock<[(Point, Point); ARCS]> = LazyLock::new(|| {
    // The float is below the true number.
    let turn = Interval::new(TAU, TAU.next_up());
    let angle = |k: f64| turn * Interval::point(k / ARCS as f64);
    let outward = cos(angle(0.5)).reciprocal();
    std::array::from_fn(|k| {
        let (start, middle) = (angle(k as f64), angle(k as f64 + 0.5));
        let corner = [cos(middle) * outward, sin(middle) * outward];
        ([cos(start), sin(start)], corner)
    })
});

/// Twice the signed area between two vectors; positive if `q` is to the left of `p`.
fn cross(p: Point, q: Point) -> Interval {
    p[0] * q[1] - p[1] * q[0]
}

/// Points whose convex hull contains the direction of every vector with coordinates in `at`.
///
/// A chord, its arc and the two tangents at its ends form a triangle that contains the arc. The
/// chord's ends lie between the corners of neighbouring arcs, so they are needed only where a
/// neighbour is left out. An arc is left out if all vectors lie right of its start or left of
/// its end.
pub(super) fn directions(at: Point) -> Vec<Point> {
    let start = |k: usize| CIRCLE[k % ARCS].0;
    let holds: [bool; ARCS] = std::array::from_fn(|k| {
        cross(start(k), at).high >= 0.0 && cross(at, start(k + 1)).high >= 0.0
    });
    let mut points = Vec::with_capacity(ARCS);
    for k in (0..ARCS).filter(|&k| holds[k]) {
        if !holds[(k + ARCS - 1) % ARCS] {
            points.push(start(k));
        }
        points.push(CIRCLE[k].1);
        if !holds[(k + 1) % ARCS] {
            points.push(start(k + 1));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::{ARCS, directions};
    use crate::real::interval::Interval;

    /// Largest `x cos t + y sin t` over the points: the support of their hull.
    fn support(points: &[[Interval; 2]], angle: f64) -> f64 {
        let along = |[x, y]: &[Interval; 2]| x.high * angle.cos() + y.high * angle.sin();
        points.iter().map(along).fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn the_polygon_holds_the_circle_and_no_more_than_it_says() {
        let all = directions([Interval::new(-1.0, 1.0), Interval::new(-1.0, 1.0)]);
        assert_eq!(all.len(), ARCS);
        for i in 0..1000 {
            let angle = 0.01 * f64::from(i);
            let reach = support(&all, angle);
            assert!(reach >= 1.0 - 1e-15, "{angle}: {reach}");
            assert!(reach <= 1.0 / (std::f64::consts::PI / ARCS as f64).cos() + 1e-14);
        }
    }

    #[test]
    fn a_narrow_cone_keeps_few_arcs_and_all_its_directions() {
        for i in 0..200 {
            let angle = 0.0314 * f64::from(i);
            let (x, y) = (3.0 * angle.cos(), 3.0 * angle.sin());
            let side = |v: f64| Interval::new(v - 0.1, v + 0.1);
            let points = directions([side(x), side(y)]);
            assert!((3..=6).contains(&points.len()), "{}", points.len());
            for (dx, dy) in [(-0.1, -0.1), (-0.1, 0.1), (0.1, -0.1), (0.1, 0.1), (0.0, 0.0)] {
                let inside = f64::atan2(y + dy, x + dx);
                assert!(support(&points, inside) >= 1.0 - 1e-15);
            }
        }
    }
}
