//! The Pareto front of a sweep, and its knee.

use super::grid::Grid;
use super::readings::{LATENCY, Measure, SUCCESS};
use crate::report::scale::Scale;

/// A point with what it costs and what it gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// Its index in the grid.
    pub(super) index: usize,
    /// Median latency, ms.
    pub(super) cost: f64,
    /// Races won, percent.
    pub(super) gain: f64,
}

/// The front of a sweep of races.
pub(super) struct Front {
    /// Every point with a latency and a success rate.
    pub(super) candidates: Vec<Candidate>,
    /// Scale of the latency.
    pub(super) scale: Scale,
    /// Those that no other beats in one and equals in the other, by rising latency.
    pub(super) joined: Vec<Candidate>,
    /// The knee among them.
    pub(super) knee: Option<Candidate>,
}

impl Front {
    /// The front; `None` where no point has both.
    pub(super) fn new(grid: &Grid<'_>) -> Option<Self> {
        let candidate = |index: usize| {
            let point = grid.points[index].record;
            let value =
                |measure: &Measure| (measure.read)(grid.record, point).map(|reading| reading.value);
            Some(Candidate { index, cost: value(&LATENCY)?, gain: value(&SUCCESS)? })
        };
        let candidates: Vec<_> = (0..grid.points.len()).filter_map(candidate).collect();
        let costs: Vec<f64> = candidates.iter().map(|candidate| candidate.cost).collect();
        let scale = Scale::log(&costs)?;
        let joined = undominated(&candidates);
        let places = joined.iter().map(|point| [scale.place(point.cost), point.gain]);
        let knee = knee(&places.collect::<Vec<_>>()).map(|place| joined[place]);
        Some(Self { candidates, scale, joined, knee })
    }
}

/// The candidates that no other beats in one and at least equals in the other, by rising cost; of
/// equal ones the first.
fn undominated(candidates: &[Candidate]) -> Vec<Candidate> {
    let mut sorted = candidates.to_vec();
    sorted.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(b.gain.total_cmp(&a.gain)));
    let mut front: Vec<Candidate> = Vec::new();
    for candidate in sorted {
        if front.last().is_none_or(|last| candidate.gain > last.gain) {
            front.push(candidate);
        }
    }
    front
}

/// The place farthest above the chord between the ends of a front that rises in both coordinates,
/// each scaled to [0, 1]; none of fewer than three, or where none lies above it.
fn knee(front: &[[f64; 2]]) -> Option<usize> {
    let ([first, _, ..], [.., last]) = (front, front) else {
        return None;
    };
    let scaled = |point: &[f64; 2]| {
        [0, 1].map(|axis| (point[axis] - first[axis]) / (last[axis] - first[axis]))
    };
    let above = front.iter().map(|point| {
        let [cost, gain] = scaled(point);
        gain - cost
    });
    let above = above.enumerate().filter(|(_, above)| *above > 1e-9);
    let best = above.reduce(|best, next| if next.1 > best.1 { next } else { best });
    best.map(|(place, _)| place)
}

#[cfg(test)]
mod tests {
    use super::{Candidate, knee, undominated};

    fn candidates(values: &[[f64; 2]]) -> Vec<Candidate> {
        let candidate =
            |(index, &[cost, gain]): (usize, &[f64; 2])| Candidate { index, cost, gain };
        values.iter().enumerate().map(candidate).collect()
    }

    fn front(values: &[[f64; 2]]) -> Vec<usize> {
        undominated(&candidates(values)).iter().map(|candidate| candidate.index).collect()
    }

    #[test]
    fn the_front_is_what_no_other_point_dominates() {
        assert_eq!(front(&[]), [0_usize; 0]);
        assert_eq!(front(&[[1.0, 1.0]]), [0]);
        assert_eq!(front(&[[3.0, 5.0], [1.0, 1.0], [2.0, 4.0], [2.5, 4.0], [4.0, 2.0]]), [1, 2, 0]);
        // Equal cost, equal gain, and both.
        assert_eq!(front(&[[1.0, 1.0], [1.0, 2.0]]), [1]);
        assert_eq!(front(&[[2.0, 1.0], [1.0, 1.0]]), [1]);
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0]]), [0]);
    }

    /// Against the definition, pair by pair.
    #[test]
    fn the_front_agrees_with_the_definition() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            f64::from((state >> 60) as u32)
        };
        for _ in 0..200 {
            let all = candidates(&std::array::from_fn::<_, 12, _>(|_| [random(), random()]));
            let dominated = |a: &Candidate| {
                all.iter().any(|b| {
                    let better = b.cost < a.cost || b.gain > a.gain;
                    let first = b.cost == a.cost && b.gain == a.gain && b.index < a.index;
                    b.cost <= a.cost && b.gain >= a.gain && (better || first)
                })
            };
            let mut expected: Vec<_> = all.iter().filter(|a| !dominated(a)).copied().collect();
            expected.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            assert_eq!(undominated(&all), expected);
        }
    }

    #[test]
    fn the_knee_is_farthest_above_the_chord() {
        assert_eq!(knee(&[]), None);
        assert_eq!(knee(&[[0.0, 1.0]]), None);
        assert_eq!(knee(&[[0.0, 1.0], [1.0, 2.0]]), None);
        assert_eq!(knee(&[[0.0, 0.0], [0.25, 0.8], [0.5, 0.9], [1.0, 1.0]]), Some(1));
        // Scaled: the unit of either coordinate does not matter.
        assert_eq!(knee(&[[5.0, 0.0], [5.25, 80.0], [5.5, 90.0], [6.0, 100.0]]), Some(1));
        // Below the chord, or on it, there is none.
        assert_eq!(knee(&[[0.0, 0.0], [0.5, 0.4], [1.0, 1.0]]), None);
        assert_eq!(knee(&[[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]]), None);
    }
}
