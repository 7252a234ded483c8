//! The worst of many starts: the smallest measures with their index.

use serde::{Deserialize, Serialize};

use crate::rollout::Starts;

/// Most counterexamples of a kind that are kept.
pub(super) const MOST: usize = 20;

/// A start that fails under the policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailingStart {
    /// Its index among those drawn.
    pub index: u64,
    /// The start.
    #[serde(with = "crate::files::number")]
    pub x: Vec<f32>,
    /// Its reach-avoid measure as the backend rolled it out.
    #[serde(with = "crate::files::number")]
    pub measure: f32,
}

/// The smallest measures seen, at most [`MOST`], of equal ones those of the first starts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Worst(Vec<(f32, u64)>);

impl Worst {
    /// Adds a start that failed; what is only a failure in f64 is no counterexample in f32.
    pub(crate) fn add(&mut self, measure: f32, index: u64) {
        if measure > 0.0 {
            return;
        }
        let before =
            |other: &(f32, u64)| other.0.total_cmp(&measure).then(other.1.cmp(&index)).is_lt();
        let place = self.0.partition_point(before);
        self.0.insert(place, (measure, index));
        self.0.truncate(MOST);
    }

    /// Measures and indices, the worst first.
    pub(crate) fn list(&self) -> &[(f32, u64)] {
        &self.0
    }

    /// The starts themselves, of those that were drawn.
    pub(crate) fn starts(&self, drawn: &Starts<'_>) -> Vec<FailingStart> {
        let start =
            |&(measure, index): &(f32, u64)| FailingStart { index, x: drawn.start(index), measure };
        self.0.iter().map(start).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_measures_stay_by_index() {
        let mut worst = Worst::default();
        for index in 0..1000_u64 {
            worst.add(-((index * 7 % 50) as f32), index);
        }
        let list = worst.list();
        assert_eq!(list.len(), MOST);
        // 7 i = 49 mod 50 at i = 7, 57, 107, ...: the first twenty of them.
        assert!(
            list.iter().enumerate().all(|(i, one)| *one == (-49.0, 7 + 50 * i as u64)),
            "{list:?}"
        );
        let mut none = Worst::default();
        none.add(1e-9, 3);
        assert!(none.list().is_empty());
        none.add(-0.0, 4);
        assert_eq!(none.list().len(), 1);
    }
}
